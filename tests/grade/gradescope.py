"""Gradescope: the archive that makes it grade submissions, and the results that it reads.

Both follow its specification of autograders: an archive has setup.sh and run_autograder at its root
and is unpacked to /autograder/source; a submission is in /autograder/submission, and its results
are read from /autograder/results/results.json.
"""

from __future__ import annotations

import secrets
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from lbw_minimal.training import InputError
from tests.grade.feedback import result
from tests.grade.handed_in import wanted

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = Path(__file__).parent / "autograder"
# All that the grader needs of the kit: how it judges, what it imports, the cells of the course.
PARTS = ("lbw_minimal/**/*.py", "tests/grade/**/*.py", "notebooks/*.ipynb", "requirements.txt",
         "requirements-lock.txt")  # fmt: skip


def archive(path: Path, numbers: str) -> None:
    """Write the archive that grades notebooks by their numbers, "5" or "5,6".

    It has a seed of its own, which students do not see. Raises InputError for a strange number.
    """
    try:
        ids, _ = wanted(numbers, [])
    except ValueError as e:
        raise InputError(str(e)) from None
    taken = dict.fromkeys(id.split(".")[0] for id in ids)
    settings = f"NOTEBOOKS={','.join(taken)}\nSEED={secrets.randbelow(1 << 31)}\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    with ZipFile(path, "w", ZIP_DEFLATED) as out:
        for script in sorted(SCRIPTS.iterdir()):
            about = ZipInfo(script.name)
            about.compress_type, about.external_attr = ZIP_DEFLATED, 0o755 << 16
            out.writestr(about, script.read_bytes())
        out.writestr("set.env", settings)
        for part in PARTS:
            for file in sorted(ROOT.glob(part)):
                out.write(file, file.relative_to(ROOT).as_posix())


def as_results(done: dict) -> dict:
    """Gradescope's results.json of a record. Students see points and hints at once, as plain text,
    and not what the grader prints."""
    tests = []
    for e in done["exercises"]:
        tests.append(
            {
                "number": e["id"],
                "name": e["title"],
                "score": e["points"],
                "max_score": e["most"],
                "status": "passed" if e["points"] == e["most"] else "failed",
                "output": "\n".join(result(e).lines()),
                "output_format": "text",
                "visibility": "visible",
            }
        )
    return {
        "output": "\n".join(done["notes"]),
        "output_format": "text",
        "test_name_format": "text",
        "visibility": "visible",
        "stdout_visibility": "hidden",
        "tests": tests,
    }
