"""What the lecturer gets of a graded class beside class.csv and the pages: files by their names."""

from __future__ import annotations

from collections.abc import Iterator

from tests.grade import alike, gradebook, items
from tests.grade.handed_in import Submission


def reports(
    entries: list[Submission], grades: list[dict], ids: list[str]
) -> Iterator[tuple[str, str | bytes]]:
    """(name, content) of each; of a single submission no statistics. grades: their records."""
    canvas, moodle = gradebook.students(entries, grades)
    if canvas:
        yield "canvas.csv", gradebook.canvas_csv(canvas, ids)
    if moodle:
        yield "moodle.csv", gradebook.moodle_csv(moodle)
        yield "moodle_feedback.zip", gradebook.moodle_zip(moodle)
    if len(entries) < 2:
        return
    found = items.statistics(grades, ids)
    yield "items.csv", items.items_csv(found)
    yield "hints.csv", items.hints_csv(found)
    yield "items.html", items.items_page(found, len(grades) - len(items.tried(grades)))
    class_ = alike.compare([g["submission"] for g in grades], alike.answers(grades))
    wrong = [{e["id"] for e in g["exercises"] if e["points"] < e["most"]} for g in grades]
    yield "alike.csv", alike.alike_csv(class_)
    yield "alike.html", alike.alike_page(class_, wrong)
