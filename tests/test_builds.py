"""Two builds of PyBullet, with NumPy inside and without, give the same frames and states.

Each runs in a process of its own. `make builds` puts the one that .venv lacks into .venv-bullet.
"""

import hashlib
import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest

import tasks
from solutions.__main__ import ROOT
from tasks import TASKS
from tasks.world.scene import WHOLE, numbers

OTHER = ROOT / ".venv-bullet"
WORKER = """
import hashlib, sys, time
import numpy as np, pybullet, tasks
from tasks.world import expert_actions

def digest(task, arm):
    env = tasks.bare(task, embodiment=arm, observation="state")
    sha = hashlib.sha256()
    for seed in range(3):
        env.reset(seed=seed, options={"scatter": True})
        sha.update(env.world.render())
    env.reset(seed=3)
    for i, action in enumerate(expert_actions(env, np.random.default_rng(0))):
        sha.update(env.step(action)[0])
        if i % 5 == 0:
            sha.update(env.world.render())
        sha.update(np.array(env.world.p.getJointStates(env.arm.body, env.arm.joints), object)[:, 0]
                   .astype(float))
        sha.update(env.object_position())
    env.close()
    return sha.hexdigest()

def cost(task, arm):
    # milliseconds of processor time: of a step with its frame, and of the frame alone
    env, spent = tasks.bare(task, embodiment=arm), np.zeros(2)
    env.reset(seed=0)
    for n, action in enumerate(expert_actions(env, np.random.default_rng(0)), start=1):
        start = time.process_time()
        env.step(action)
        middle = time.process_time()
        env.world.render()
        spent += middle - start, time.process_time() - middle
    env.close()
    return (1e3 * spent / n).tolist()

print(pybullet.isNumpyEnabled(), flush=True)
for line in sys.stdin:
    print(eval(line), flush=True)
"""


class Build:
    """A process with one build of PyBullet, the one found first on `path`."""

    def __init__(self, path):
        env = os.environ | {"PYTHONPATH": f"{path}{os.pathsep}{ROOT}", "OMP_NUM_THREADS": "1"}
        self.process = subprocess.Popen([sys.executable, "-c", WORKER], env=env, text=True,
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE)  # fmt: skip
        self.has_numpy = self.process.stdout.readline().strip() == "1"

    def ask(self, expression):
        self.process.stdin.write(f"{expression}\n")
        self.process.stdin.flush()
        return self.process.stdout.readline().strip()


@pytest.fixture(scope="module")
def builds():
    if not OTHER.is_dir():
        pytest.skip("needs the other build: make builds")
    both = [Build(ROOT), Build(OTHER)]
    if not both[0].has_numpy:
        pytest.skip("needs Python 3.11 on Linux x86-64, which has both builds")
    yield both
    for build in both:
        build.process.kill()
        build.process.wait()


@pytest.mark.parametrize("arm", ["robot", "human"])
@pytest.mark.parametrize("task", TASKS)
def test_frames_and_states_of_an_episode_are_the_same(builds, task, arm):
    first, second = (build.ask(f"digest({task!r}, {arm!r})") for build in builds)
    assert len(first) == len(hashlib.sha256().hexdigest())
    assert first == second


@pytest.mark.parametrize("arm, most", [("robot", (1.3, 1.35)), ("human", (1.4, 1.6))])
def test_a_frame_without_numpy_costs_little_more(builds, arm, most):
    """Both builds in turns, the lesser of two, in the mean of the tasks. An episode's step costs
    the robot 1.10 to 1.19 times as much, and a frame alone 1.15 to 1.21; the human, whose frames
    take less than half the time, 1.16 to 1.25 and 1.34 to 1.44."""
    rounds = [
        [[json.loads(build.ask(f"cost({task!r}, {arm!r})")) for build in builds] for task in TASKS]
        for _ in range(2)
    ]
    with_numpy, without = np.moveaxis(np.min(rounds, axis=0), 1, 0)  # (5, 2) each
    ratios = without / with_numpy
    for task, *figures in zip(TASKS, ratios, with_numpy, without, strict=True):
        print(task, *(f"{r:.2f} ({a:.1f} to {b:.1f} ms)" for r, a, b in zip(*figures, strict=True)))
    step, frame = ratios.mean(axis=0)
    print(f"mean of {arm}: step {step:.2f}, frame alone {frame:.2f}")
    assert step < most[0]
    assert frame < most[1]


def test_one_build_has_numpy_inside_and_the_other_has_not(builds):
    assert [build.has_numpy for build in builds] == [True, False]


def test_a_frame_is_the_same_from_tuples_and_their_reading_is_cheap(monkeypatch):
    """As PyBullet returns them without NumPy inside. Read number by number, an image took 6 ms."""
    env = tasks.bare("push")
    env.reset(seed=0)
    world = env.world
    want, times = world.render(), {}
    real = world.p.getCameraImage  # of this client: others may be open

    def tuples(*args, **kwargs):
        return [tuple(np.ravel(x).tolist()) if np.ndim(x) else x for x in real(*args, **kwargs)]

    picture = tuples(168, 168, world.view, world.projection)
    for name, read in (("ours", numbers), ("one by one", np.asarray)):
        start = time.process_time()
        for _ in range(10):
            read(picture[2], np.uint8), read(picture[3], np.float32)
        times[name] = time.process_time() - start
    assert times["ours"] < 0.5 * times["one by one"]
    monkeypatch.setattr(world.p, "getCameraImage", tuples, raising=False)
    assert np.array_equal(world.render(), want)


def test_the_segments_of_a_frame_are_small_numbers(monkeypatch):
    """Python has those ready. Left out, they are as large as floats read as whole numbers: without
    NumPy inside, one more number to make of each pixel."""
    env = tasks.bare("push")
    env.reset(seed=0)
    world = env.world
    real, segments = world.p.getCameraImage, []

    def camera(*args, **kwargs):
        image = real(*args, **kwargs)
        segments.append(np.unique(image[4]))
        return image

    monkeypatch.setattr(world.p, "getCameraImage", camera, raising=False)
    world.render()
    assert len(segments) == 1
    assert -1 <= segments[0][0] < segments[0][-1] < world.p.getNumBodies()


def test_what_moves_is_seen_where_it_is_nearer_than_the_scenery(monkeypatch):
    world = tasks.bare("push").world
    behind = np.full((168, 168), 0.5, np.float32)
    monkeypatch.setattr(world, "depth", behind)
    monkeypatch.setattr(world, "_window", lambda: WHOLE)
    for depth, seen in ((0.49, True), (0.5, False), (0.51, False)):
        red = np.tile(np.uint8([250, 0, 0, 255]), (168, 168, 1))
        image = 168, 168, red, np.full((168, 168), depth, np.float32), None
        monkeypatch.setattr(world.p, "getCameraImage", lambda *a, i=image, **k: i, raising=False)
        assert (world.render() == [250, 0, 0]).all() == seen
