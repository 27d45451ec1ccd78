"""Grade a folder of submissions: `python -m tests.grade FOLDER`.

One folder or one notebook each. A submission is a job of its own: FOLDER may be a single one, too.
Out, in `--out`: class.csv, junit.xml, and for each submission a folder with result.json,
feedback.html and, on request, Gradescope's results.json. What is finished is not graded again
unless it or the checks changed.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import hashlib
import io
import json
import math
import re
import sys
import traceback
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

import torch

from lbw_minimal.training import InputError, write_atomic
from tests.grade import feedback, sandbox
from tests.grade.exercise import Exercise, everything
from tests.grade.judge import UNDONE, Result, best, judge, nothing
from tests.grade.sandbox import Lost, Sandbox
from tests.grade.submission import MOST, RELEASED, Answer, Unreadable, answer, read

MANY = 50  # notebooks of one submission that are read
SEED = 2  # other inputs than those of the students' own checks, which could be learnt by heart


def main(argv=None) -> int:
    """Returns the exit code: 2 where there is nothing to grade, 1 if the grader failed on a
    submission, 130 if it was interrupted."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.grade", description=__doc__.split("\n")[0]
    )
    parser.add_argument("folder", type=Path, help="submissions: one folder or one notebook each")
    parser.add_argument("--out", type=Path, default=Path("grades"))
    parser.add_argument(
        "--notebooks", help="numbers, such as 5 or 5,6; default: all that anyone handed in"
    )
    parser.add_argument(
        "--seed", type=int, default=SEED, help="of the inputs; students have 0 (%(default)s)"
    )
    how = parser.add_mutually_exclusive_group()
    jobs = {"type": int, "choices": range(1, 65), "default": 2, "metavar": "N"}
    how.add_argument("-j", "--jobs", **jobs, help="submissions at a time")
    how.add_argument("--ray", action="store_true", help="grade on a Ray cluster")
    parser.add_argument(
        "--gradescope", action="store_true", help="write results.json for Gradescope, too"
    )
    args = parser.parse_args(argv)
    try:
        entries = submissions(args.folder, args.out)
        ids = wanted(args.notebooks, entries)
        args.out.mkdir(parents=True, exist_ok=True)
    except ValueError as e:
        print(e, file=sys.stderr)
        return 2
    except OSError as e:
        print(f"{args.out}: cannot write there ({e.strerror}); give another --out", file=sys.stderr)
        return 2
    if (lacks := sandbox.warning()) and not args.ray:  # on a cluster each node looks at its own
        print(f"warning: {lacks}", file=sys.stderr)
    torch.set_num_threads(1)

    def job(entry, graded=None):
        try:
            done = grade_once(entry, ids, args.out, args.gradescope, args.seed, graded)
        except Exception as e:  # the class goes on; without a result.json this is tried again
            traceback.print_exc()
            why = f"NOT GRADED, {type(e).__name__}: {e}"
            print(f"{entry.name}: {why}", file=sys.stderr)
            results = [nothing(everything()[id], why) for id in ids]
            return record(entry, results, [why]) | {"failed": True}
        print(f"{entry.name}: {done['points']:g} of {done['most']:g}", flush=True)
        return done

    with ThreadPoolExecutor(args.jobs) as pool:
        try:
            if args.ray:
                grades = on_cluster(job, entries, ids, args.out, args.seed)
            else:
                grades = list(pool.map(job, entries))
        except InputError as e:
            print(e, file=sys.stderr)
            return 2
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            print("interrupted; the same command goes on where this one was", file=sys.stderr)
            return 130
    write_atomic(args.out / "class.csv", table(grades, ids))
    write_atomic(args.out / "junit.xml", feedback.junit(grades))
    return 1 if any("failed" in g for g in grades) else 0


def submissions(folder: Path, out: Path) -> list[Path]:
    """The submissions in a class's folder. Raises ValueError where there are none.

    A folder of notebooks that are all called as they were released is one submission.
    """
    if not folder.exists():
        raise ValueError(f"{folder}: no such folder")
    if not folder.is_dir() and folder.suffix != ".ipynb":
        raise ValueError(f"{folder}: neither a folder nor a notebook; unpack an archive first")
    inside = {path.relative_to(folder) for path in notebooks(folder)}
    released = {path.relative_to(RELEASED) for path in RELEASED.glob("*")}
    if folder.is_file() or (inside and inside <= released):
        print(f"{folder} is graded as one submission")
        return [folder]
    found = sorted(p for p in folder.iterdir() if not hidden(p) and p.resolve() != out.resolve())
    if not found:
        raise ValueError(f"{folder}: no submissions in it")
    return found


def wanted(numbers: str | None, entries: list[Path]) -> list[str]:
    """The exercises of notebooks by their numbers, "5" or "5,6"; else of all that were handed in.

    Raises ValueError where there are none.
    """
    known = sorted({id.split(".")[0] for id in everything()}, key=int)
    given = [n.strip() for n in numbers.split(",")] if numbers else handed_in(entries)
    given = [n.lstrip("0") or "0" for n in given if n]
    if strange := [n for n in given if n not in known]:
        raise ValueError(f"no notebook {', '.join(strange)}: there are {', '.join(known)}")
    if not given:
        raise ValueError(
            "nobody handed in a notebook of the course; --notebooks says which to expect"
        )
    return [id for id in everything() if id.split(".")[0] in given]


def hidden(entry: Path) -> bool:
    """Whether an entry of the class folder is the system's, such as .DS_Store, not a student's."""
    return entry.name[0] == "." and not notebooks(entry)


def notebooks(entry: Path) -> list[Path]:
    """The notebooks of a submission, whatever they are called."""
    if entry.is_symlink():
        return []
    if entry.is_file():
        return [entry] if entry.suffix == ".ipynb" else []
    found = (p for p in sorted(entry.rglob("*.ipynb")) if ".ipynb_checkpoints" not in p.parts)
    return [p for p in found if not p.is_symlink()][:MANY]


def handed_in(entries: list[Path]) -> list[str]:
    """Numbers of the notebooks that the class handed in."""
    found = set()
    for path in (path for entry in entries for path in notebooks(entry)):
        with contextlib.suppress(Unreadable):
            found.add(read(path).number)
    return sorted(found - {""})


def grade(entry: Path, ids: list[str], seed: int = SEED) -> tuple[list[Result], list[str]]:
    """Results of the exercises `ids` in one submission, and what went wrong with its files."""
    books, notes = [], []
    for path in notebooks(entry):
        try:
            books.append(read(path))
        except Unreadable as e:
            notes.append(f"{path.name}: {e}")
    if not books and not notes:
        notes.append("no notebook found; an archive has to be unpacked first")
    known, results = everything(), []
    with Sandbox() as box:
        for id in ids:
            given = answer(known[id], books)
            if given is None:
                results.append(nothing(known[id], "no cell with this exercise", open=True))
                continue
            if given.elsewhere:
                notes.append(
                    f"{id} stands in {given.elsewhere}, too; that of {given.where} was graded"
                )
            results.append(grade_one(known[id], given, box, seed))
    return results, notes


def grade_one(
    exercise: Exercise, given: Answer, box: Sandbox, seed: int = 0, seconds: float = math.inf
) -> Result:
    """The result of one answer, run in the sandbox; the best, where there are several.

    seconds: what is left for the submission.
    """
    if given.open:
        return nothing(exercise, UNDONE, open=True)
    box.start()
    box.allow(min(sandbox.EXERCISE, seconds))
    ways = [
        (a, over) for a in (given, *given.others) for over in ((True, False) if a.own else (False,))
    ]
    return best(lambda a=a, over=over: in_sandbox(exercise, a, over, box, seed) for a, over in ways)


def in_sandbox(exercise: Exercise, given: Answer, over: bool, box: Sandbox, seed: int) -> Result:
    """The result of one cell. over: with the exercise's `given` in place of what the student wrote
    by these names."""
    how = {"over": over, "definitions_only": False}

    def start():
        box.close()
        return box.open(exercise, given.source, given.helpers, given.below, **how)

    def renew():
        if start() is not None:
            raise Lost("the cell runs once, but not a second time")

    try:
        try:
            failed = start()
        except Lost:  # the cells train for too long, or end their process
            how["definitions_only"] = True
            failed = start()
        if failed is not None:
            text = getattr(failed, "text", "")
            why = f"the cell does not run: {failed}: {text}" if text else f"{failed}"
            return nothing(exercise, why)
        return judge(exercise, box.call, seed, renew)
    except Lost as e:
        return nothing(exercise, str(e))
    finally:
        box.close()


def grade_once(entry: Path, ids: list[str], out: Path, gradescope: bool, seed: int, graded) -> dict:
    """Grade a submission and write its pages, unless done before for the same files and checks.

    graded: None; or what a cluster made of it, see `cluster.grade_here`, an exception if it failed.
    """
    if isinstance(graded, Exception):
        raise graded
    folder = out / safe(entry.name)
    digest, done = (graded[0], {}) if graded else before(entry, ids, out, seed)
    if not done:
        results, notes = graded[1:] if graded else grade(entry, ids, seed)
        done = record(entry, results, notes) | {"digest": digest}
        folder.mkdir(parents=True, exist_ok=True)
        write_atomic(folder / "feedback.html", feedback.page(done))
        # Last: it says that all the rest is there.
        write_atomic(folder / "result.json", json.dumps(done, indent=1) + "\n")
    if gradescope:
        text = json.dumps(feedback.gradescope(done), indent=1) + "\n"
        write_atomic(folder / "results.json", text)
    return done


def before(entry: Path, ids: list[str], out: Path, seed: int) -> tuple[str, dict]:
    """A submission's fingerprint, and its record if it was graded before with the same one."""
    digest = fingerprint(entry, ids, seed)
    path = out / safe(entry.name) / "result.json"
    done = json.loads(path.read_text()) if path.exists() else {}
    return digest, done if done.get("digest") == digest else {}


def on_cluster(job, entries: list[Path], ids: list[str], out: Path, seed: int) -> list[dict]:
    """What `job` makes of each submission, those not graded before graded on a Ray cluster.

    Raises InputError without Ray, or where no node's sandbox holds.
    """
    from tests.grade import cluster  # slow, and seldom needed

    grades, there = {}, []
    for entry in entries:
        try:
            digest, done = before(entry, ids, out, seed)
            if not done:
                there.append((entry, (cluster.pack(notebooks(entry), entry), digest, ids, seed)))
                continue
        except OSError:
            pass  # `job` meets it again, and says so
        grades[entry] = job(entry)
    for entry, graded in cluster.spread(there):
        grades[entry] = job(entry, graded)
    return [grades[entry] for entry in entries]


def record(entry: Path, results: list[Result], notes: list[str]) -> dict:
    """What is known of a graded submission, as plain values."""
    return {
        "submission": entry.name,
        "notes": notes,
        "points": sum(r.points for r in results),
        "most": sum(r.most for r in results),
        "exercises": [asdict(r) | {"points": r.points, "most": r.most} for r in results],
    }


def safe(name: str) -> str:
    """A file name for a submission's results, unique and harmless whatever its own name is."""
    plain = re.sub(r"[^A-Za-z0-9_-]+", "_", name.removesuffix(".ipynb"))[:60].strip("_")
    return f"{plain}-{hashlib.sha256(name.encode(errors='surrogateescape')).hexdigest()[:8]}"


def fingerprint(entry: Path, ids: list[str], seed: int) -> str:
    """Of the submission's notebooks and of the checks."""
    sha = hashlib.sha256(f"{','.join(ids)} {seed}".encode())
    for path in notebooks(entry):
        size = path.stat().st_size
        sha.update(f"{path.name} {size}".encode(errors="surrogateescape"))
        sha.update(path.read_bytes() if size <= MOST else b"")
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        sha.update(path.read_bytes())
    return sha.hexdigest()


def table(grades: list[dict], ids: list[str]) -> str:
    """The class as CSV, a row a submission."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["submission", "points", "of", *ids, "notes"])
    for g in grades:
        points = {e["id"]: f"{e['points']:g}" for e in g["exercises"]}
        name = g["submission"]
        if name[0] in "=+-@":  # a spreadsheet would take it for a formula
            name = "'" + name
        totals = (f"{g['points']:g}", f"{g['most']:g}")
        rows.writerow([name, *totals, *(points[id] for id in ids), "; ".join(g["notes"])])
    return text.getvalue()


if __name__ == "__main__":
    sys.exit(main())
