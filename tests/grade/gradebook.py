"""Points and pages as Canvas and Moodle take them back, for submissions that were downloaded there.

Who is who stands in the names of the downloaded files, so nobody else is in the tables; and who
could not be graded is left out, since an empty cell would erase a grade. The formats are those of
Canvas's gradebook import, Moodle's offline grading worksheet, and its zip of feedback files.
"""

from __future__ import annotations

import io
import re
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from tests.grade import feedback
from tests.grade.files import printable
from tests.grade.handed_in import CANVAS, MOODLE, Submission
from tests.grade.sheets import sheet

Graded = list[tuple[str, str, dict]]  # a student's name, their number on the platform, the record


def students(entries: list[Submission], grades: list[dict]) -> tuple[Graded, Graded]:
    """Canvas's and Moodle's among the graded submissions."""
    canvas: Graded = []
    moodle: Graded = []
    for entry, grade in zip(entries, grades, strict=True):
        path = entry.paths[0][0]
        if "failed" in grade:
            continue
        if found := MOODLE.fullmatch(path.name):
            name, _, number = found["who"].rpartition("_")
            moodle.append((printable(name), number, grade))
        elif (found := CANVAS.fullmatch(path.name)) and not path.is_dir():
            canvas.append((printable(found["who"]), found["id"], grade))
    return canvas, moodle


def canvas_csv(graded: Graded, ids: list[str]) -> str:
    """Canvas finds a student by ID; by the last column's name it finds the assignment, or asks
    which one is meant."""
    numbers = list(dict.fromkeys(id.split(".")[0] for id in ids))
    title = f"LbW notebook{'s'[: len(numbers) > 1]} {', '.join(numbers)}"
    head = ["Student", "ID", "SIS User ID", "SIS Login ID", "Section", title]
    rows = [["    Points Possible", "", "", "", "", f"{graded[0][2]['most']:g}"]]
    rows += [[name, number, "", "", "", f"{g['points']:g}"] for name, number, g in graded]
    return sheet(head, rows)


def moodle_csv(graded: Graded) -> str:
    """Moodle finds a student by the identifier. "-" says that no grade was given before. Without
    a column for comments, those that are there stay."""
    head = ["Identifier", "Full name", "Grade", "Maximum Grade", "Last modified (grade)"]
    rows = [
        [f"Participant {number}", name, f"{g['points']:g}", f"{g['most']:g}", "-"]
        for name, number, g in graded
    ]
    # A lone "-" is no formula, and has to stay as it is.
    return sheet(head, rows).replace(",'-\n", ",-\n")


def moodle_zip(graded: Graded) -> bytes:
    """The feedback pages in the folders that Moodle's own zip of the submissions has."""
    data = io.BytesIO()
    with ZipFile(data, "w") as out:
        for name, number, grade in graded:
            plain = re.sub(r"[\\/:_]", " ", name)  # Moodle looks for the number behind the first _
            folder = f"{plain}_{number}_assignsubmission_file_"
            page = ZipInfo(f"{folder}/feedback.html")  # of 1980: two gradings are the same bytes
            page.compress_type = ZIP_DEFLATED
            out.writestr(page, feedback.page(grade))
    return data.getvalue()
