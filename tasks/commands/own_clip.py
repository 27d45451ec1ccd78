"""A clip of one's own in the folder of a run: its film, its page, and stills for the report.

They stay in that folder. A film that `prepare` has made brings the page and the stills that lie
beside it.
"""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

from lbw_minimal.training import write_atomic
from tasks.commands.links import links
from tasks.commands.prepare import FILM, PAGE, STILLS, Prepared, write

NAV = re.compile(r"<nav.*?</nav>\n", re.DOTALL)


def bring(out: Path, name: str, clip: Prepared, file: Path) -> None:
    """Put film, page and stills of the clip into the run's folder; file: what --video named."""
    page, stills = file.with_name(PAGE), file.with_name(STILLS)
    if file.name == FILM and clip.done is None and page.exists() and stills.exists():
        write_atomic(out / FILM, clip.file)
        shutil.copy(stills, out)
        text, here = page.read_text(encoding="utf-8"), links(out / PAGE)
        write_atomic(out / PAGE, NAV.sub(lambda _: here, text, count=1))
        return
    write(out, name, clip, shlex.join(["python", "-m", "tasks", "prepare", name, str(file)]))
