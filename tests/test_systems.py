"""What a student does works without the modules that only Linux has.

`HIDE` takes from Python what Windows lacks; what it hides is then hidden from every library, too.
"""

import itertools
import json
import os
import signal
import subprocess
import sys
import time

import pytest

from lbw_minimal import training
from solutions.__main__ import ROOT, sources
from tests.grade import __main__ as grader
from tests.grade import notebook, sandbox
from tests.grade.exercise import everything
from tests.grade.submission import RELEASED, answer, read

HIDE = """
import ctypes, os, signal, sys
for name in ("resource", "fcntl", "pwd", "grp", "termios"):
    sys.modules[name] = None
del signal.SIGALRM, signal.alarm, signal.setitimer, signal.SIGKILL, os.fork, os.killpg, os.setsid
_CDLL = ctypes.CDLL
def CDLL(name, *args, **kwargs):
    if name is None or name == "ucrtbase":
        raise TypeError("there is no such library here")
    return _CDLL(name, *args, **kwargs)
ctypes.CDLL = CDLL
"""
ELSEWHERE = {"PYTHONWARNINGS": "ignore", "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
ELSEWHERE |= {"LBW_FAST": "1"}  # three episodes of the first notebook tell as much as ten
DONE = "that was all"
SERVE = f"""
import contextlib, io, json, traceback
for line in sys.stdin:
    folder, code = json.loads(line)
    os.chdir(folder)
    said, failed = io.StringIO(), ""
    try:
        with contextlib.redirect_stdout(said):
            exec(code, dict(__name__="__main__"))
    except BaseException:
        failed = traceback.format_exc()
    print(json.dumps([said.getvalue(), failed]), {DONE!r}, sep="\\n", flush=True)
"""


@pytest.fixture(scope="module")
def elsewhere():
    """Run code in a folder, in a Python without what Linux has; what it printed."""
    line = [sys.executable, "-c", HIDE + SERVE]
    with subprocess.Popen(line, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                          env=os.environ | ELSEWHERE) as process:  # fmt: skip

        def run(code, folder):
            process.stdin.write(json.dumps([str(folder), code]) + "\n")
            process.stdin.flush()
            lines = list(itertools.takewhile(lambda text: text != DONE + "\n", process.stdout))
            assert process.poll() is None, "the process has ended"
            said, failed = json.loads(lines[-1])
            assert not failed, failed[-3000:]
            return said

        yield run
        process.kill()


def test_a_run_and_its_page(elsewhere, tmp_path):
    """The policy's training is cut short: its loop has nothing of the system in it."""
    line = ["reach", "--set", "policy_steps=60", "--episodes", "1", "--threads", "1"]
    code = f"from tasks.__main__ import main\nassert main({line}) == 0"
    said = elsewhere(code, tmp_path)
    run = tmp_path / "runs" / "reach"
    assert said.splitlines()[-1] == f"report: {run.relative_to(tmp_path) / 'report.html'}"
    assert "A test episode" in (run / "report.html").read_text(encoding="utf-8")
    assert "memory_mb" not in json.loads((run / "metrics.json").read_text(encoding="utf-8"))


@pytest.mark.slow
def test_a_smoke_run_through_every_stage(elsewhere, tmp_path):
    elsewhere("from tasks.__main__ import main\nassert main(['push', '--fast']) == 0", tmp_path)
    assert (tmp_path / "runs" / "push" / "report.html").exists()


def test_a_check_in_a_notebook_and_in_the_terminal(elsewhere, tmp_path):
    """An answer of the solved notebook 6 gets its points, and one that never ends is stopped."""
    book = sources()[6]
    source = answer(everything()["6.1"], [read(book)]).source
    said = elsewhere(
        f"""
import numpy as np, torch
from tests.grade import check, notebook
exec({source!r})
assert check("6.1") == {everything()["6.1"].points}
notebook.WALL = 1
def r1(z, z_E):
    while True:
        pass
assert check("6.1") == 0

from tests.grade import test_notebooks as terminal
from tests.grade.submission import answer, read
from pathlib import Path
answers = answer(terminal.ALL["6.1"], [read(Path({str(book)!r}))])
result = terminal.graded(terminal.ALL["6.1"], answers, None)
assert result.points == result.most
""",
        tmp_path,
    )
    assert "does a loop never end?" in said


@pytest.mark.parametrize("path", sorted(RELEASED.glob("00*.ipynb")), ids=lambda p: p.stem)
def test_the_first_notebook_up_to_its_first_exercise(elsewhere, path):
    cells = [c.source for c in read(path).cells]
    first = next(i for i, c in enumerate(cells) if "raise NotImplementedError" in c)
    code = "import os, sys\nget_ipython = lambda: None\ndisplay = print\n"
    elsewhere(code + "\n".join(cells[:first]), path.parent)


def last(start):
    """As an answer does, in a function: Python 3.13 may lose an interrupt of a loop in a `with`."""
    while time.monotonic() - start < 20:
        pass


def test_the_time_of_an_answer_is_kept_without_an_alarm(monkeypatch):
    monkeypatch.delattr(signal, "SIGALRM")
    before, start = signal.getsignal(signal.SIGINT), time.monotonic()
    with pytest.raises(TimeoutError, match="no answer within 1 s"), notebook._within(1):
        last(start)
    assert time.monotonic() - start < 10
    assert signal.getsignal(signal.SIGINT) is before  # Ctrl-C is what it was


@pytest.mark.parametrize(("system", "machine"), [("win32", "AMD64"), ("darwin", "arm64"),
                                                 ("linux", "aarch64")])  # fmt: skip
def test_grading_a_class_says_where_it_can_be_done(system, machine, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(sandbox.sys, "platform", system)
    monkeypatch.setattr(sandbox.platform, "machine", lambda: machine)
    assert grader.main([str(tmp_path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "Linux on x86-64" in line and "WSL2" in line and "container" in line


def test_memory_is_counted_in_bytes_on_linux_and_on_macos(monkeypatch):
    block = bytearray(50 << 20)
    most = training.peak_memory()
    assert 50 << 20 < most < 64 << 30 and len(block)
    monkeypatch.setattr(training.sys, "platform", "darwin")  # which gives bytes, not KiB
    assert training.peak_memory() == pytest.approx(most / 1024, rel=0.1)


def test_memory_is_unknown_where_the_system_does_not_tell(monkeypatch):
    monkeypatch.setitem(sys.modules, "resource", None)
    assert training.peak_memory() is None
