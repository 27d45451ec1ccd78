"""People made of limbs: surfaces, where limbs are put, and what is drawn of whom."""

import tracemalloc

import numpy as np
import pybullet as p
import pytest

from lbw_minimal.clips.drawn_shapes import HANDS
from tasks.world.people import STRETCHED, Person, facing, hand, joined, limb
from tasks.world.scene import silent_client

GROUND = np.array([0.4, 0.4, 0.4])


@pytest.fixture(scope="module")
def client():
    return silent_client()


def matrix(quaternion):
    return np.reshape(p.getMatrixFromQuaternion(quaternion), (3, 3))


def person(client, seed, tool=None):
    """Somebody, with or without a tool."""
    client.resetSimulation()
    while True:
        seed += 100
        one = Person(client, np.random.default_rng(seed), GROUND)
        if tool is None or bool(one.tool) == tool:
            return one


def frame(client, body):
    """Where a body is, and its x axis."""
    at, turned = client.getBasePositionAndOrientation(body)
    return np.array(at), matrix(turned)[:, 0]


def test_a_limb_is_as_long_and_thick_as_asked_and_its_normals_look_out():
    points, normals, corners = limb(0.3, 0.05, 0.03, flat=0.5)
    assert points[:, 0].min() == pytest.approx(-0.05) and points[:, 0].max() == pytest.approx(0.33)
    assert np.abs(points[:, 1]).max() == pytest.approx(0.05)
    assert np.abs(points[:, 2]).max() == pytest.approx(0.025)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(np.ones(len(points)))
    assert ((normals * points * (0, 1, 1)).sum(1) > 0).all()
    assert normals[points[:, 0] < -0.04, 0].max() < 0 < normals[points[:, 0] > 0.325, 0].min()
    a, b, c = points[corners.reshape(-1, 3)].swapaxes(0, 1)
    outwards = np.cross(b - a, c - a)
    middle = (a + b + c) / 3 * (0, 1, 1)
    assert ((outwards * middle).sum(1) > 0).all()


def test_joined_surfaces_keep_their_triangles():
    one, other = limb(0.1, 0.02, 0.02), limb(0.2, 0.03, 0.01)
    both = joined([one, other])
    assert np.array_equal(
        both.points[both.corners[len(one.corners) :]], other.points[other.corners]
    )


@pytest.mark.parametrize("kind", HANDS)
def test_a_hand_ends_at_its_tip_and_begins_behind_the_wrist(kind):
    points = hand(kind, 0.15).points
    assert -0.22 < points[:, 0].min() < -0.13 and -0.01 < points[:, 0].max() < 0.01
    assert np.ptp(points[:, 2]) < np.ptp(points[:, 1]) + 0.04


@pytest.mark.parametrize("ahead", [(1, 0, 0), (-1, 0, 0), (0, 0, -2), (0.3, -0.5, 0.1)])
def test_a_turn_takes_x_ahead_after_a_roll_about_x(ahead):
    plain, rolled = matrix(facing(np.array(ahead))), matrix(facing(np.array(ahead), 0.7))
    assert plain[:, 0] == pytest.approx(np.array(ahead) / np.linalg.norm(ahead), abs=1e-4)
    about = np.array([[1, 0, 0], [0, np.cos(0.7), -np.sin(0.7)], [0, np.sin(0.7), np.cos(0.7)]])
    assert rolled == pytest.approx(plain @ about, abs=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_an_arm_goes_from_the_shoulder_by_elbow_and_wrist_to_the_tip(client, seed):
    one = person(client, seed, tool=False)
    tip, shoulder = np.array([0.1, 0, 0.05]), np.array([-0.25, 0.1, 0.3])
    one.put(tip, shoulder)
    (upper, along), (fore, on), (palm, ahead) = (frame(client, body) for body in one.limbs[:3])
    assert palm == pytest.approx(tip, abs=1e-6)
    wrist = tip - one.hand * ahead
    assert upper + one.upper * along == pytest.approx(fore, abs=1e-4)
    assert fore + one.fore * on == pytest.approx(wrist, abs=1e-4)
    near = np.linalg.norm(wrist - shoulder) < STRETCHED * (one.upper + one.fore)
    assert not near or upper == pytest.approx(shoulder, abs=1e-4)


def test_a_shoulder_that_is_too_far_away_comes_nearer(client):
    one = person(client, 0, tool=False)
    one.put(np.zeros(3), np.array([-3.0, 0, 1]))
    (upper, _), (_, _), (_, ahead) = (frame(client, body) for body in one.limbs[:3])
    reach = np.linalg.norm(upper + one.hand * ahead)
    assert reach == pytest.approx(STRETCHED * (one.upper + one.fore), rel=1e-3)


def test_a_tool_ends_at_the_tip_and_is_in_the_hand(client):
    one = person(client, 0, tool=True)
    tip = np.array([0.1, 0, 0.05])
    one.put(tip, np.array([-0.25, 0.1, 0.3]))
    at, along = frame(client, one.stick)
    assert at + (one.tool + one.held) * along == pytest.approx(tip, abs=1e-4)
    assert frame(client, one.limbs[2])[0] == pytest.approx(tip - one.tool * along, abs=1e-4)
    assert one.stick in one.bodies and len(one.bodies) == len(one.limbs) + 1


def test_people_differ_and_the_same_dice_make_the_same(client):
    looks = []
    for seed in (1, 1, 2, 3):
        one = person(client, seed)
        looks.append([client.getVisualShapeData(body)[0][7] for body in one.bodies])
    assert looks[0] == looks[1] and looks[2] != looks[1] != looks[3]


def test_a_process_that_makes_many_people_keeps_none_of_them(client):
    """PyBullet keeps the lists that meshes are made of: 30 people had left 9 MB behind."""
    for seed in range(60):  # until no one is larger than all before
        person(client, seed)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for seed in range(30):
        person(client, seed)
    kept = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert kept < 500_000
