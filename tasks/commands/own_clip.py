"""A clip of one's own in the folder of a run: its film, its page, and stills for the report.

They stay in that folder. A film that `prepare` has made brings the page and the stills that lie
beside it.
"""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

from lbw_minimal.training import read_json, write_atomic
from tasks.commands.links import FILM, NOTE, links, note_of
from tasks.commands.prepare import PAGE, STILLS, Prepared, write

NAV = re.compile(r"<nav.*?</nav>\n", re.DOTALL)


def bring(out: Path, name: str, clip: Prepared, file: Path) -> dict[str, str]:
    """Put film, page and stills of the clip into the run's folder; file: what --video named.

    Returns the clip's name, its "corrections", and the "command" that has to come before the run's,
    if there is one.
    """
    page, stills, note = (file.with_name(beside) for beside in (PAGE, STILLS, NOTE))
    made = all(beside.exists() for beside in (page, stills, note))
    if file.name == FILM and clip.done is None and made:
        write_atomic(out / FILM, clip.file)
        if out.resolve() != file.parent.resolve():
            shutil.copy(stills, out)
            shutil.copy(note, out)
        text, here = page.read_text(encoding="utf-8"), links(out / PAGE)
        write_atomic(out / PAGE, NAV.sub(lambda _: here, text, count=1))
        return read_json(note)
    command = shlex.join(["python", "-m", "tasks", "prepare", name, str(file)])
    said = note_of(file, name, command)
    write(out, name, clip, said)
    return said | {"command": ""}  # the run's own does it as well
