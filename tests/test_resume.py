"""A run that is killed goes on where it was, and ends as if nothing had happened."""

import random
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from lbw_minimal.training import load_state

# A checkpoint every half second, as a smoke run's stages last seconds.
RUN = (
    "import sys, lbw_minimal.training as t; t.Checkpoint.__init__.__defaults__ = (0.5,); "
    "from tasks.__main__ import main; sys.exit(main(sys.argv[1:]))"
)
STAGES = ("translation", "keypoints", "policy")


def start(out, *options):
    arguments = ["push", "--fast", "--threads", "1", "--out", str(out), *options]
    return subprocess.Popen([sys.executable, "-c", RUN, *arguments], stderr=subprocess.DEVNULL)


def flat(tree, name=""):
    if isinstance(tree, dict):
        for k, v in tree.items():
            yield from flat(v, f"{name}/{k}")
    elif isinstance(tree, list):
        for i, v in enumerate(tree):
            yield from flat(v, f"{name}/{i}")
    else:
        yield name, np.asarray(tree)


@pytest.mark.slow
def test_fifteen_kills_change_nothing(tmp_path):
    """Five SIGKILLs at random moments of each stage; weights equal those of an undisturbed run."""
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    assert start(whole).wait() == 0
    dice, options = random.Random(0), ()
    for stage in STAGES:
        for _ in range(5):
            process = start(killed, *options)
            while not (killed / f"{stage}.checkpoint").exists() and process.poll() is None:
                time.sleep(0.02)
            time.sleep(dice.uniform(0, 1.5))
            process.send_signal(signal.SIGKILL)
            process.wait()
            options = ("--resume",)
            for file in killed.glob("*.safetensors"):
                load_state(file)  # whole, or it raises
    assert start(killed, "--resume").wait() == 0
    assert (killed / "report.html").exists()
    for stage in STAGES:
        a, b = (
            dict(flat(load_state(folder / f"{stage}.safetensors"))) for folder in (whole, killed)
        )
        assert a.keys() == b.keys()
        for name in a:
            np.testing.assert_array_equal(a[name], b[name], err_msg=f"{stage}{name}")
