"""Grade a folder of submissions: `python -m tests.grade FOLDER`.

One folder or one notebook each, or files that a learning platform named after students. A
submission is a job of its own: FOLDER may be a single one, too. Out, in `--out`: class.csv,
junit.xml, and for each submission a folder with result.json, feedback.html and, on request,
Gradescope's results.json. What is finished is not graded again unless it or the checks changed.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import math
import queue
import re
import secrets
import sys
import time
import traceback
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

from lbw_minimal import cluster
from tests.grade import arguments

if __name__ == "__main__":  # Ray starts while what is imported below is read, which takes as long
    arguments.start_ray()

from lbw_minimal.training import InputError, write_atomic
from tests.grade import alike, feedback, sandbox
from tests.grade.exercise import Exercise, everything
from tests.grade.files import File, in_order, printable
from tests.grade.gradescope import as_results
from tests.grade.handed_in import Submission, submissions, wanted
from tests.grade.judge import UNDONE, Result, best, judge, nothing, settle
from tests.grade.reports import reports
from tests.grade.sandbox import Lost, Sandbox
from tests.grade.sheets import sheet
from tests.grade.submission import Answer, Notebook, Unreadable, answer, parse

SEED = 2  # of one submission alone; students check themselves with 0


def main(argv=None) -> int:
    """Returns the exit code: 2 where there is nothing to grade, 1 if the grader failed on a
    submission or could not write, 130 if it was interrupted."""
    args = arguments.read(argv)
    if not (args.ray or sandbox.holds()):
        say(f"error: {sandbox.ELSEWHERE}", sys.stderr)
        return 2
    try:
        entries = submissions(args.folder, args.out, args.one)
        ids, chosen = wanted(args.notebooks, entries)
        args.out.mkdir(parents=True, exist_ok=True)
        args.seed = noted_seed(args.out, args.seed)
    except ValueError as e:
        say(e, sys.stderr)
        return 2
    except OSError as e:
        say(f"{args.out}: cannot write there ({e.strerror}); give another --out", sys.stderr)
        return 2
    if not args.ray:  # on a cluster each node looks at its own
        if args.require_bubblewrap and (lacks := sandbox.bubblewrap()[1]):
            say(lacks, sys.stderr)
            return 2
        if lacks := sandbox.warning():
            say(f"warning: {lacks}", sys.stderr)
        settle()
    if entries[0].paths[0][0] == args.folder:
        say(f"{args.folder} is graded as one submission")
    if chosen:
        say(chosen)
    try:
        grades = _grade_all(args, entries, ids)
    except InputError as e:
        say(e, sys.stderr)
        return 2
    except KeyboardInterrupt:
        say("interrupted; the same command goes on where this one was", sys.stderr)
        return cluster.INTERRUPTED
    with ThreadPoolExecutor(1) as aside:  # to end Ray takes as long as to write the reports
        if args.ray:
            aside.submit(cluster.leave)
        written = _written(args.out, entries, grades, ids)
    return 0 if written and not any("failed" in g for g in grades) else 1


def _written(out: Path, entries: list[Submission], grades: list[dict], ids: list[str]) -> bool:
    """Write what is said of the class as a whole. Returns whether all of it is there."""
    written = [
        keep(out / "class.csv", table(grades, ids)),
        keep(out / "junit.xml", feedback.junit(grades)),
    ]
    if not written[0]:
        say(table(grades, ids))
    try:
        written += [keep(out / name, data) for name, data in reports(entries, grades, ids)]
    except Exception as e:  # a fault in a report costs no grade
        say(f"{traceback.format_exc()}the reports: NOT WRITTEN, {type(e).__name__}", sys.stderr)
        written.append(False)
    return all(written)


def noted_seed(out: Path, given: int | None) -> int:
    """The seed of a class's inputs, noted in seed.txt: one given, or that of before, or a new one.

    Nobody can know it beforehand, so an answer cannot hold a table of the inputs.
    """
    path = out / "seed.txt"
    if given is None:
        try:
            given = int(path.read_bytes())
        except (OSError, ValueError):
            given = secrets.randbelow(1 << 31)
    noted = keep(path, f"{given}\n")
    say(f"seed of the inputs: {given}{f', noted in {path}' if noted else ''}")
    return given


def say(text: object, where=None) -> None:
    """Print what may hold a stranger's words; a terminal that is gone stops nothing."""
    where = where or sys.stdout
    coding = getattr(where, "encoding", None) or "utf-8"
    text = printable(str(text)).encode(coding, "backslashreplace").decode(coding)
    with contextlib.suppress(OSError, ValueError):
        print(text, file=where, flush=True)


def keep(path: Path, text: str | bytes) -> bool:
    """Write a file; where that fails (a full disk) say so. Returns whether it is there."""
    try:
        write_atomic(path, text)
    except OSError as e:
        say(f"{path}: NOT WRITTEN, {e.strerror}", sys.stderr)
        return False
    return True


def _grade_all(args, entries: list[Submission], ids: list[str]) -> list[dict]:
    """The records of all submissions. Raises InputError where a cluster cannot grade, and
    KeyboardInterrupt."""
    boxes: queue.SimpleQueue[Sandbox] = queue.SimpleQueue()
    for _ in range(args.jobs):
        boxes.put(Sandbox())
    done = []

    def job(entry, graded=None):
        box = boxes.get()
        try:
            grades = grade_once(entry, ids, args.out, args.gradescope, args.seed, box, graded)
            points = f"{grades['points']:g} of {grades['most']:g}"
        except Exception as e:  # the class goes on; without a result.json this is tried again
            box.kill()
            points = f"NOT GRADED, {type(e).__name__}: {e}"
            say(f"{traceback.format_exc()}{entry.name}: {points}", sys.stderr)
            results = [nothing(everything()[id], points) for id in ids]
            grades = record(entry, results, [points]) | {"failed": True}
        finally:
            boxes.put(box)
        done.append(entry)
        say(f"[{len(done)}/{len(entries)}] {entry.name}: {points}")
        return grades

    with ThreadPoolExecutor(args.jobs) as pool:
        try:
            if args.ray:
                return on_cluster(job, entries, ids, args)
            return list(pool.map(job, entries))
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        finally:
            pool.shutdown()
            while not boxes.empty():
                boxes.get().kill()


def grade(
    files: list[File], ids: list[str], seed: int = SEED, box: Sandbox | None = None
) -> tuple[list[Result], list[str]]:
    """Results of the exercises `ids` in a submission's notebooks, and what was odd about these.

    box: a sandbox to run them in, else one of their own.
    """
    if box is None:
        with Sandbox() as box:
            return grade(files, ids, seed, box)
    books, notes = [], []
    for file in in_order(files):
        try:
            books.append(parse(file))
        except Unreadable as e:
            notes.append(f"{file.name}: {e}")
    if not files:
        notes.append("no notebook found; an archive has to be unpacked first")
    known, results, left = everything(), [], float(sandbox.SUBMISSION)
    answers: dict[str, Answer] = {}
    later = Repeats()
    twice: dict[tuple[str, str], list[str]] = {}
    for id in ids:
        given = answer(known[id], books)
        if given is None:
            results.append(nothing(known[id], "no cell with this exercise", open=True))
            continue
        if given.elsewhere:
            twice.setdefault((given.elsewhere, given.where), []).append(id)
        box.start()
        answers[id] = given
        began = time.monotonic()
        results.append(grade_one(known[id], given, box, seed, left, later))
        left -= time.monotonic() - began
    for id in later.doubted(box):
        began = time.monotonic()
        results[ids.index(id)] = grade_one(known[id], answers[id], box, seed, left)
        left -= time.monotonic() - began
    for result in results:
        given = answers.get(result.id)
        result.source = given.source if given and not (given.open or given.broken) else ""
    for (other, taken), some in twice.items():
        stand = "stand" if some[1:] else "stands"
        notes.append(f"{', '.join(some)} {stand} in {other}, too; that of {taken} was graded")
    if more := _not_set(books, ids):
        notes.append(f"not graded, since it was not set: notebook {', '.join(more)}")
    return results, notes


def _not_set(books: list[Notebook], ids: list[str]) -> list[str]:
    """Numbers of notebooks that a student has worked on though they were not asked for."""
    there = {book.number for book in books if book.number}
    more = there - {id.split(".")[0] for id in ids}
    worked = [
        n
        for n in more
        if any(
            (given := answer(e, books)) and not given.open
            for e in everything().values()
            if e.id.split(".")[0] == n
        )
    ]
    return sorted(worked, key=int)


class Repeats:
    """Right answers that have yet to be given once more by a process that was not asked before.

    To start one takes longer than most answers. So an answer is repeated in the process of the
    student's next exercise, when that has been judged: nothing can be gained there any more. Where
    it fails the other exercise may be the reason, and it is graded in processes of its own.
    """

    def __init__(self):
        self.waiting: list[tuple] = []  # (exercise, how to define the answer, what has to agree)
        self.failed: list[str] = []

    def settle(self, define, box: Sandbox) -> None:
        """Repeat those that wait. define: `box.open` or `box.reopen`."""
        while self.waiting:
            exercise, (cells, how), agrees = self.waiting.pop()
            try:
                if define(exercise, *cells, **how) is None and agrees(box.call):
                    continue
            except Lost:
                pass
            finally:
                define = box.reopen if box.channel else box.open
            self.failed.append(exercise.id)

    def doubted(self, box: Sandbox) -> list[str]:
        """Repeat the rest; the ids of all that failed."""
        box.allow(sandbox.EXERCISE)
        self.settle(box.open, box)
        box.close()
        return list(dict.fromkeys(self.failed))


def grade_one(
    exercise: Exercise,
    given: Answer,
    box: Sandbox,
    seed: int = 0,
    seconds: float = math.inf,
    later: Repeats | None = None,
) -> Result:
    """The result of one answer, run in the sandbox; the best, where there are several.

    seconds: what is left for the submission, see `sandbox.SUBMISSION`. later: where what was right
    is put to be repeated; else that is done at once.
    """
    if given.open:
        return nothing(exercise, UNDONE, open=True)
    if given.broken:
        return nothing(exercise, "a merge conflict is left in its cell (<<<<<<<): resolve it")
    if seconds <= 0:
        return nothing(exercise, f"the submission has used up its {sandbox.SUBMISSION} s")
    box.allow(min(sandbox.EXERCISE, seconds))
    ways = [
        (a, over) for a in (given, *given.others) for over in ((True, False) if a.own else (False,))
    ]
    return best(
        lambda a=a, over=over: in_sandbox(exercise, a, over, box, seed, later) for a, over in ways
    )


def in_sandbox(
    exercise: Exercise, given: Answer, over: bool, box: Sandbox, seed: int, later: Repeats | None
) -> Result:
    """The result of one cell. over: with the exercise's `given` in place of what the student wrote
    by these names. later: see `grade_one`."""
    cells = (given.source, given.helpers, given.below)
    how = {"over": over, "definitions_only": False}
    right = []

    def start():
        box.close()
        return box.open(exercise, *cells, **how)

    def renew(agrees):
        if later:
            right.append((exercise, (cells, how), agrees))
            return ""
        if start() is not None:
            return "the cell runs once, but not a second time"
        return "" if agrees(box.call) else "the same input gives another answer after other inputs"

    try:
        try:
            failed = start()
        except Lost:  # the cells train for too long, or end their process
            how["definitions_only"] = True
            failed = start()
        if failed is not None:
            why = f"the cell does not run: {failed.in_full()}" if failed.text else f"{failed}"
            return nothing(exercise, why)
        result = judge(exercise, box.call, seed, renew)
        if later and box.channel:
            later.settle(box.reopen, box)
        if later:
            later.waiting += right
        return result
    except Lost as e:
        return nothing(exercise, str(e))
    finally:
        box.close()


def grade_once(
    entry: Submission, ids: list[str], out: Path, gradescope: bool, seed: int, box: Sandbox, graded
) -> dict:
    """Grade a submission and write its pages, unless done before for the same files and checks.

    graded: None; or what a cluster made of it, see `cluster.grade_here`, an exception if it failed.
    Pages that cannot be written cost no points.
    """
    if isinstance(graded, Exception):
        raise graded
    folder = out / safe(entry.name)
    if graded:
        digest, results, notes = graded
        done = {}
    else:
        files, notes = entry.files()
        digest, done = before(entry, files, ids, out, seed)
    if not done:
        if not graded:
            results, more = grade(files, ids, seed, box)
            notes = notes + more
        done = record(entry, results, notes) | {"digest": digest}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            write_atomic(folder / "feedback.html", feedback.page(done))
            # Last: it says that all the rest is there.
            write_atomic(folder / "result.json", json.dumps(done, indent=1) + "\n")
        except OSError as e:
            done["failed"] = True
            done["notes"].append(f"its pages could not be written ({e.strerror})")
            say(f"{entry.name}: {done['notes'][-1]}", sys.stderr)
    if gradescope and "failed" not in done:
        text = json.dumps(as_results(done), indent=1) + "\n"
        done |= {} if keep(folder / "results.json", text) else {"failed": True}
    return done


def before(
    entry: Submission, files: list[File], ids: list[str], out: Path, seed: int
) -> tuple[str, dict]:
    """A submission's fingerprint, and its record if it was graded before with the same one."""
    digest = fingerprint(files, ids, seed)
    path = out / safe(entry.name) / "result.json"
    try:
        done = json.loads(path.read_bytes()) if path.is_file() else {}
        same = done["digest"] == digest and {"points", "most", "exercises", "notes"} <= set(done)
    except (OSError, ValueError, KeyError, TypeError):  # half a file, or somebody else's
        same = False
    return digest, done if same else {}


def on_cluster(job, entries: list[Submission], ids: list[str], args) -> list[dict]:
    """What `job` makes of each submission, those not graded before graded on a Ray cluster.

    Raises InputError without Ray, or where no node's sandbox holds.
    """
    from tests.grade.cluster import spread

    grades, there = {}, []
    for entry in entries:
        with contextlib.suppress(Exception):  # `job` meets it again, and says so
            files, notes = entry.files()
            digest, done = before(entry, files, ids, args.out, args.seed)
            if not done:
                how = (ids, args.seed, args.require_bubblewrap)
                there.append((entry, (files, notes, digest, *how)))
                continue
        grades[entry] = job(entry)
    for entry, graded in spread(there):
        grades[entry] = job(entry, graded)
        with contextlib.suppress(Exception):  # what the reports need anyway: the cluster goes on
            alike.read(grades[entry])
    return [grades[entry] for entry in entries]


def record(entry: Submission, results: list[Result], notes: list[str]) -> dict:
    """What is known of a graded submission, as plain values that can be printed and written."""
    exercises = [asdict(r) | {"points": r.points, "most": r.most} for r in results]
    for e in exercises:
        e["example"] = printable(e["example"])
        for outcome in e["outcomes"]:
            outcome["message"] = printable(outcome["message"])
    return {
        "submission": printable(entry.name),
        "notes": [printable(note) for note in notes],
        "points": sum(r.points for r in results),
        "most": sum(r.most for r in results),
        "exercises": exercises,
    }


def safe(name: str) -> str:
    """A file name for a submission's results, unique and harmless whatever its own name is."""
    plain = re.sub(r"[^A-Za-z0-9_-]+", "_", name.removesuffix(".ipynb"))[:60].strip("_")
    return f"{plain}-{hashlib.sha256(name.encode(errors='surrogateescape')).hexdigest()[:8]}"


def fingerprint(files: list[File], ids: list[str], seed: int) -> str:
    """Of the submission's notebooks and of the checks."""
    sha = hashlib.sha256(f"{','.join(ids)} {seed} {_checks()}".encode())
    for file in in_order(files):
        sha.update(f"{file.name} {file.why} {len(file.data)}".encode())
        sha.update(file.data)
    return sha.hexdigest()


@functools.cache
def _checks() -> str:
    """A fingerprint of the grader's own code."""
    sha = hashlib.sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        sha.update(path.read_bytes())
    return sha.hexdigest()


def table(grades: list[dict], ids: list[str]) -> str:
    """The class as CSV, a row a submission."""
    rows = []
    for g in grades:
        marks = {e["id"]: f"{e['points']:g}" for e in g["exercises"]}
        totals = (f"{g['points']:g}", f"{g['most']:g}")
        rows.append([g["submission"], *totals, *(marks[id] for id in ids), "; ".join(g["notes"])])
    return sheet(["submission", "points", "of", *ids, "notes"], rows)


if __name__ == "__main__":
    sys.exit(main())
