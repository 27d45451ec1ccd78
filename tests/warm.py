"""Runs test files again and again without importing torch again: `python -m tests.warm`.

In, a line of JSON for each run: test files or tests, names to leave out, and how many seconds each
test is known to take. Out, a line for each: whether all passed, the first that did not, and the
seconds of those that did. Every run is a fork of this process, which has imported what is large and
not the kit's own; it ends at the first failure.

Seconds are of processor time, so that a busy machine changes neither the order nor the limits.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import tempfile
from bisect import bisect

import pytest

# torch's dynamo comes with the first optimizer, and takes 2 s.
MODULES = (
    *("av", "cv2", "gymnasium.wrappers", "matplotlib", "meshcat", "numpy", "PIL"),
    *("safetensors.torch", "torch.nn", "torch._dynamo"),
)
BANDS = (0.2, 1.0, 5.0)  # s: brief tests first, and within a band as they stand
NO_TESTS = pytest.ExitCode.NO_TESTS_COLLECTED
SLACK, LEAST, UNKNOWN = 5, 20, 60  # a test hangs after 5 times its own seconds, 20 s at least


def spent() -> float:
    """Processor time in s of this process and of its children that have ended."""
    return sum(os.times()[:4])


class Watch:
    """A plugin: orders the tests, ends one that hangs, and writes down how each went."""

    def __init__(self, without: list[str], seconds: dict[str, float], out: int):
        self.without, self.seconds, self.out = set(without), seconds, out

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items):
        items[:] = [i for i in items if not self.without & set(re.split(r"\W", i.name.lower()))]
        items.sort(key=lambda i: bisect(BANDS, self.seconds.get(i.nodeid, BANDS[0])))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        known = self.seconds.get(item.nodeid)
        self.tell(began=item.nodeid)
        limit = max(LEAST, SLACK * known) if known else UNKNOWN
        # Both signals end the process, and the one that waits for it sees which test was on.
        signal.setitimer(signal.ITIMER_PROF, limit)
        signal.setitimer(signal.ITIMER_REAL, 30 * limit)  # it waits for what never comes
        start = spent()
        done = yield
        for timer in (signal.ITIMER_PROF, signal.ITIMER_REAL):
            signal.setitimer(timer, 0)
        self.tell(ended=item.nodeid, seconds=spent() - start)
        return done

    def pytest_runtest_logreport(self, report):
        if report.failed:
            self.tell(failed=report.nodeid, why=str(report.longrepr)[-300:])

    def pytest_collectreport(self, report):
        if report.failed:
            self.tell(failed=report.nodeid, why=str(report.longrepr)[-300:])

    def tell(self, **what):
        os.write(self.out, (json.dumps(what) + "\n").encode())


def child(out: int, tests: list[str], without: list[str], seconds: dict[str, float]) -> None:
    """Run the tests in this process, and leave it."""
    os.setsid()
    line = ["-q", "-x", "-p", "no:cacheprovider", "-m", "not slow and not peers", *tests]
    os._exit(pytest.main(line, plugins=[Watch(without, seconds, out)]))


def run(tests: list[str], without: list[str], seconds: dict[str, float]) -> dict:
    """{"passed": bool, "by": the first test that failed or hung, "why", "seconds": {test: s}}."""
    with tempfile.TemporaryFile() as file:
        pid = os.fork()
        if pid == 0:
            child(file.fileno(), tests, without, seconds)
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        with contextlib.suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)  # what the tests left running
        file.seek(0)
        told = [json.loads(line) for line in file]
    took = {t["ended"]: t["seconds"] for t in told if "ended" in t}
    answer = {"passed": status in (0, NO_TESTS), "by": "", "why": "", "seconds": took}
    for failed in (t for t in told if "failed" in t):
        return answer | {"by": failed["failed"], "why": failed["why"]}
    if not answer["passed"]:
        began = [t["began"] for t in told if "began" in t and t["began"] not in took]
        return answer | {"by": began[-1] if began else "", "why": f"ends with {status}"}
    return answer


def main() -> None:
    """Answer until there is no more to run."""
    answers = os.fdopen(os.dup(1), "w")
    null = os.open(os.devnull, os.O_RDWR)
    questions = os.fdopen(os.dup(0))
    os.dup2(null, 0)
    os.dup2(null, 1)
    for name in MODULES:
        __import__(name)
    for line in questions:
        print(json.dumps(run(**json.loads(line))), file=answers, flush=True)


if __name__ == "__main__":
    main()
