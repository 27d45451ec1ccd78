"""Outside of the kit's environment a command ends in one sentence, not in a traceback."""

import subprocess
import sys
from importlib.metadata import packages_distributions

import pytest

from solutions.__main__ import ROOT
from tasks import needs
from tests.test_house import blocks


def test_a_python_without_the_kit_is_told_where_it_is():
    """Python's option -S hides all that is installed."""
    line = [sys.executable, "-S", "-m", "tasks", "push"]
    done = subprocess.run(line, cwd=ROOT, env={}, capture_output=True, text=True)
    assert done.returncode == 1 and done.stdout == ""
    assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1, done.stderr
    assert "has no torch; run .venv/bin/python -m tasks" in done.stderr
    assert "README.md" in done.stderr


def test_one_package_that_is_missing_is_named_to_who_runs_a_command(monkeypatch):
    monkeypatch.setattr(needs, "find_spec", lambda name: None if name == "cv2" else name)
    with pytest.raises(SystemExit, match="has no cv2;"):
        needs.check("-m")
    needs.check("a_notebook.py")
    monkeypatch.setattr(needs, "find_spec", lambda name: name)
    needs.check("-m")


def test_what_is_looked_for_is_what_the_kit_requires():
    """PyBullet has two builds, of which one is installed."""
    installed, twin = packages_distributions(), "pybullet-arm64"
    found = {installed[name][0].lower().replace(twin, "pybullet") for name in needs.NEEDS}
    required = {line.partition(";")[0] for line in blocks()["The kit"]}
    names = {line.split("=")[0].split(">")[0].split("<")[0].strip() for line in required}
    assert found == names - {twin}
