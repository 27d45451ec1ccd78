"""Runs test files again and again without importing torch again: `python -m tests.warm`.

In, a line of JSON for each run: test files, or tests in their order, and how many seconds each
test is known to take. Out, a line for each: whether all passed, the first that did not, and the
seconds of those that did. Every run is a fork of this process, which has imported what is large and
not the kit's own; it ends at the first failure. With "cover" it ends at none, and says which lines
of the kit each test has run.

Seconds are of processor time, so that a busy machine changes neither the order nor the limits.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import tempfile

import coverage
import pytest

from tests.by_line import KIT

# torch's dynamo comes with the first optimizer, and takes 2 s.
MODULES = (
    *("av", "cv2", "gymnasium.wrappers", "matplotlib", "meshcat", "numpy", "PIL"),
    *("safetensors.torch", "torch.nn", "torch._dynamo"),
    *("matplotlib.figure", "mistune", "pybullet", "pybullet_utils.bullet_client"),
)
NO_TESTS = pytest.ExitCode.NO_TESTS_COLLECTED
SLACK, LEAST, UNKNOWN = 5, 20, 60  # a test hangs after 5 times its own seconds, 20 s at least


def spent() -> float:
    """Processor time in s of this process and of its children that have ended."""
    return sum(os.times()[:4])


class Watch:
    """A plugin: keeps the order asked, ends a test that hangs, and writes down how each went."""

    def __init__(self, tests: list[str], seconds: dict[str, float], out: int):
        self.ranks = {test: rank for rank, test in enumerate(tests)}
        self.seconds, self.out = seconds, out

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items):
        items.sort(key=lambda item: self.ranks.get(item.nodeid, 0))

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


class Cover:
    """A plugin: writes down the lines of the kit that each test runs, its fixtures among them."""

    def __init__(self):
        self.coverage = coverage.Coverage(data_file=None, source=list(KIT), config_file=False)
        self.coverage.start()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        self.coverage.switch_context(item.nodeid)
        done = yield
        self.coverage.switch_context("")
        return done

    def lines(self) -> dict[str, dict[str, list[int]]]:
        """{file: {test: [line, ...]}}"""
        self.coverage.stop()
        data, found = self.coverage.get_data(), {}
        for file in data.measured_files():
            for line, tests in data.contexts_by_lineno(file).items():
                for test in filter(None, tests):
                    found.setdefault(file, {}).setdefault(test, []).append(line)
        return found


def child(out: int, watch: Watch, tests: list[str], cover: bool) -> None:
    """Run the tests in this process, and leave it."""
    os.setsid()
    line = ["-q", "-p", "no:cacheprovider", "-m", "not slow and not peers", *tests]
    if cover:
        covered = Cover()
        pytest.main(line, plugins=[watch, covered])
        watch.tell(lines=covered.lines())
        os._exit(0)
    os._exit(pytest.main(["-x", *line], plugins=[watch]))


def run(tests: list[str], seconds: dict[str, float] | None = None, cover: bool = False) -> dict:
    """{"passed": bool, "by": the first test that failed or hung, "why", "seconds": {test: s}}."""
    with tempfile.TemporaryFile() as file:
        pid = os.fork()
        if pid == 0:
            child(file.fileno(), Watch(tests, seconds or {}, file.fileno()), tests, cover)
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        with contextlib.suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)  # what the tests left running
        file.seek(0)
        told = [json.loads(line) for line in file]
    took = {t["ended"]: t["seconds"] for t in told if "ended" in t}
    answer = {"passed": status in (0, NO_TESTS), "by": "", "why": "", "seconds": took}
    if cover:
        lines = next((t["lines"] for t in told if "lines" in t), {})
        failed = [t["failed"] for t in told if "failed" in t]
        return answer | {"lines": lines, "failed": failed, "root": os.getcwd()}
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
