"""A class with hostile, broken and odd submissions, made by a seed, is graded as it should be."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
needs_sandbox = pytest.mark.skipif(sys.platform != "linux", reason="needs Linux's sandbox")


def graded(tmp_path, whole, odd, path=""):
    """What a class of its own process says; path: folders to look for bubblewrap in first."""
    made = ("--whole", str(whole), "--odd", str(odd))
    done = subprocess.run(
        [sys.executable, "-m", "tests.hostile", str(tmp_path / "made"), *made],
        cwd=ROOT, capture_output=True, text=True,
        env=os.environ | {"PATH": f"{path}{os.pathsep}{os.environ['PATH']}"},
    )  # fmt: skip
    return done.stdout.rpartition("\n")[0].rpartition("\n")[2], done.stdout + done.stderr


@needs_sandbox
@pytest.mark.slow
def test_a_small_class_of_hostile_submissions_is_graded_as_it_should_be(tmp_path):
    said, everything = graded(tmp_path, 3, 22)
    assert said == "all as it should be", everything


@needs_sandbox
@pytest.mark.slow
@pytest.mark.parametrize("bubblewrap", ["as it is", "refused"])
def test_a_class_of_500_of_which_200_are_hostile(tmp_path, bubblewrap):
    if bubblewrap == "refused":
        (tmp_path / "bwrap").write_text("#!/bin/sh\necho 'no permission' >&2\nexit 1\n")
        (tmp_path / "bwrap").chmod(0o755)
    said, everything = graded(tmp_path, 300, 200, str(tmp_path))
    assert said == "all as it should be", everything
