"""All scenes, both arms: the browser's mirror stands as in PyBullet, and the picture is whole.

`PYTHONPATH=. python tests/test_scenes.py` draws the robots' portraits anew, after a change that is
meant; the shipped weights then have to be trained anew, too.
"""

from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from test_viewer import commands

import tasks
from tasks.world import World, expert_actions, random_actions
from tasks.world.scene import numbers
from tasks.world.viewer import mirror, transform

PORTRAITS = Path(__file__).parent / "robots.png"
SCENES = [(name, arm) for name in tasks.TASKS for arm in ("robot", "human")]


def make(name, arm):
    return getattr(tasks.module(name), name.capitalize())(embodiment=arm, observation="state")


def poses(page):
    """What the page says of its links: {path: 4x4} and, of those that move, {path: (T, 7)}."""
    told = commands(page)
    still = {
        c["path"]: np.reshape(c["matrix"], (4, 4)).T for c in told if c["type"] == "set_transform"
    }
    moving = {}
    for part in (part for c in told for part in c.get("animations", [])):
        tracks = {t["name"]: [k["value"] for k in t["keys"]] for t in part["clip"]["tracks"]}
        moving[part["path"]] = np.hstack([tracks[".position"], tracks[".quaternion"]])
    return still, moving


@pytest.mark.parametrize(("name", "arm"), SCENES)
def test_poses_in_the_browser_equal_pybullets_in_30_random_states(name, arm):
    env = make(name, arm)
    p, rng, wanted = env.world.p, np.random.default_rng(0), []
    env.reset(seed=0)
    scene = mirror(env)
    for i in range(30):
        if i % 10 == 0:
            env.reset(seed=i, options={"scatter": True})
            actions = random_actions(rng)
        env.step(next(actions))
        scene.snap()
        wanted.append([frame(p, body, link) for body, link in scene.links])
    page = scene.html(name)
    still, moving = poses(page)
    assert len(page) < 2e6
    for row, (body, link) in enumerate(scene.links):
        path = f"/meshcat/{body}/{link}"
        truth = np.array([w[row] for w in wanted])
        if path in moving:
            told = np.array([transform(x[:3], x[3:]) for x in moving[path][:30]])
        else:
            told = np.broadcast_to(still[path], truth.shape)
        np.testing.assert_allclose(told, truth, atol=1e-6)
    env.close()


def frame(p, body, link):
    """4x4 URDF frame of a link, from PyBullet's centre of mass and the inertial frame in it."""
    if link < 0:
        mass = p.getBasePositionAndOrientation(body)
    else:
        mass = p.getLinkState(body, link, computeForwardKinematics=True)[:2]
    inertial = p.getDynamicsInfo(body, link)[3:5]
    return transform(*mass) @ np.linalg.inv(transform(*inertial))


@pytest.mark.parametrize(("name", "arm"), SCENES)
def test_painting_the_scenery_once_changes_no_pixel(name, arm, monkeypatch):
    """As if everything were in the scene: the depth keeps what is in front in front."""
    fast = make(name, arm)
    monkeypatch.setattr(World, "paint", lambda world: None)
    full = make(name, arm)
    for env in (fast, full):
        env.reset(seed=3)
    for action in expert_actions(fast, np.random.default_rng(0)):
        fast.step(action)
        full.step(action)
    difference = np.abs(fast.world.render().astype(int) - full.world.render())
    assert (difference > 2).mean() < 1e-3
    fast.close()
    full.close()


def portrait(name):
    """The robot (84, 84, 3) after half a second of its expert."""
    env = make(name, "robot")
    env.reset(seed=0)
    for action in islice(expert_actions(env), 12):
        env.step(action)
    frame = env.world.render()
    env.close()
    return frame


@pytest.mark.parametrize("name", tasks.TASKS)
def test_the_robot_and_its_scene_look_as_they_did_to_the_shipped_weights(name):
    """The films of the human do this for its arm and scene, see test_recordings."""
    column = 84 * tasks.TASKS.index(name)
    known = np.asarray(Image.open(PORTRAITS))[:, column : column + 84].astype(int)
    assert (np.abs(portrait(name) - known) > 3).mean() < 1e-3


@pytest.mark.parametrize("kind", [np.uint8, np.float32])
def test_a_picture_in_tuples_has_the_numbers_of_one_in_arrays(kind):
    """As PyBullet gives it that was built without NumPy: bytes, or floats as C rounds them."""
    picture = np.array([0, 1, 200, 255] if kind is np.uint8 else [0.0, 0.1, 0.999, 1.0], kind)
    for given in (picture, tuple(picture.tolist())):
        found = numbers(given, kind)
        assert found.dtype == kind
        np.testing.assert_array_equal(found, picture)


if __name__ == "__main__":
    Image.fromarray(np.concatenate([portrait(name) for name in tasks.TASKS], 1)).save(PORTRAITS)
