"""What comes out of grading: the student's page, and the class as JUnit XML."""

from __future__ import annotations

from html import escape
from xml.etree import ElementTree

from tests.grade.judge import TRY, Outcome, Result
from tests.grade.webpage import webpage, words


def result(e: dict) -> Result:
    """What a record holds of an exercise."""
    outcomes = [Outcome(**o) for o in e["outcomes"]]
    return Result(e["id"], e["title"], outcomes, e["open"], e["example"])


def page(done: dict) -> str:
    """The feedback page of one submission, HTML that loads nothing."""
    parts = []
    for e in done["exercises"]:
        items, said = [], set()
        for o in e["outcomes"]:
            new = o["message"] and o["message"] not in said
            said.add(o["message"])
            hint = f'<span class="hint">{words(o["message"])}</span>' if new else ""
            state = "wrong" if o["message"] else "ok"
            mark = f"{o['points']:g}/{o['most']:g}"
            items.append(f'<li class="{state}">{mark} {words(o["label"])}{hint}</li>')
        points = f'<span class="points">{e["points"]:g} / {e["most"]:g}</span>'
        head = f"<h2>{points}{e['id']} {escape(e['title'])}</h2>"
        paste = f"<p>{TRY}</p><pre>{escape(e['example'])}</pre>" if e["example"] else ""
        parts.append(f"{head}<ul>{''.join(items)}</ul>{paste}")
    notes = "".join(f"<p>{escape(note)}</p>" for note in done["notes"])
    name = escape(done["submission"])
    head = f"<h1>{name}: {done['points']:g} of {done['most']:g} points</h1>"
    return webpage(done["submission"], f"{head}{notes}{''.join(parts)}")


def junit(grades: list[dict]) -> str:
    """The class as JUnit XML: a suite a submission, a case an exercise."""
    root = ElementTree.Element("testsuites")
    for g in grades:
        cases, name = g["exercises"], g["submission"]
        failed = [e for e in cases if e["points"] < e["most"]]
        counts = {"tests": str(len(cases)), "failures": str(len(failed))}
        suite = ElementTree.SubElement(root, "testsuite", {"name": name} | counts)
        for e in cases:
            case = ElementTree.SubElement(
                suite, "testcase", {"classname": name, "name": f"{e['id']} {e['title']}"}
            )
            if e in failed:
                mark = f"{e['points']:g} of {e['most']:g}"
                failure = ElementTree.SubElement(case, "failure", {"message": mark})
                failure.text = "\n".join(result(e).lines())
    return ElementTree.tostring(root, encoding="unicode") + "\n"
