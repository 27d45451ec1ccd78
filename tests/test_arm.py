"""The arms and their controller: claims about kinematics and about how the tip moves."""

import itertools
import xml.etree.ElementTree as ET

import cv2
import numpy as np
import pytest

import tasks
from tasks.reach import Reach
from tasks.world.bodies import human, limb, panda

EMBODIMENTS = ("robot", "human")


def test_the_pandas_limits_are_those_of_its_file():
    limits = [
        joint.find("limit")
        for joint in ET.fromstring(panda().urdf).iter("joint")
        if joint.get("type") == "revolute"
    ]
    assert panda().effort == tuple(float(limit.get("effort")) for limit in limits)
    assert panda().speed == tuple(float(limit.get("velocity")) for limit in limits)


def test_the_humans_wrist_is_weaker_than_its_elbow_and_that_than_its_shoulder():
    assert human().effort == (90, 90, 60, 60, 20, 20, 20)  # Nm
    assert human().speed == panda().speed


def test_hand_and_fingers_may_touch_the_world():
    assert panda().reach_links == ("panda_hand", "panda_leftfinger", "panda_rightfinger")
    assert human().reach_links == ("hand",)


def test_a_limb_is_round_and_its_normals_lean_to_its_thin_end():
    """A cone of half a right angle: its normals lean as much; sixteen corners to a ring."""
    rows = [row.split() for row in limb((0.0, 1.0), (1.0, 0.0)).splitlines()]
    points, normals = (
        np.array([row[1:] for row in rows if row[0] == kind], float) for kind in ("v", "vn")
    )
    assert len(points) == len(normals) == 2 * 16
    np.testing.assert_allclose(np.hypot(*points[:16, 1:].T), 1, atol=1e-4)
    np.testing.assert_allclose(normals[:, 0], np.sqrt(0.5), atol=1e-3)
    np.testing.assert_allclose(normals[:16, 1:], points[:16, 1:] * np.sqrt(0.5), atol=1e-3)


@pytest.fixture(params=EMBODIMENTS)
def env(request):
    env = Reach(embodiment=request.param, observation="state")
    env.reset(seed=0)
    yield env
    env.close()


def test_nothing_but_hand_and_fingers_touches_what_is_in_the_way(env):
    """A ball of a metre lies over the whole arm, its foot among it."""
    p, arm = env.world.p, env.arm
    ball = p.createMultiBody(1.0, p.createCollisionShape(p.GEOM_SPHERE, radius=1.0))
    p.performCollisionDetection()
    touched = {contact[3] for contact in p.getContactPoints(arm.body, ball)}
    assert touched == {arm.links[name] for name in arm.spec.reach_links}


def test_at_rest_the_tip_points_straight_down(env):
    """The pitches of shoulder, elbow and wrist add up to it, to a hundredth of a radian."""
    env.arm._set(env.arm.home)
    x, _ = env.arm.tip_pose()
    assert np.abs(env.arm._error(x)[3:]).max() < 0.01
    assert 0.4 < x[0] < 0.7 and abs(x[1]) < 0.001 and x[2] > 0


def test_jacobian_agrees_with_finite_differences(env):
    arm, h = env.arm, 1e-3
    q, _ = arm.state()
    _, R = arm.tip_pose()
    numeric = np.zeros((6, 7))
    for i, step in enumerate(np.eye(7) * h):
        arm._set(q + step)
        x1, R1 = arm.tip_pose()
        arm._set(q - step)
        x2, R2 = arm.tip_pose()
        W = (R1 - R2) @ R.T / (2 * h)  # the skew matrix of the angular velocity
        numeric[:, i] = [*(x1 - x2) / (2 * h), W[2, 1], W[0, 2], W[1, 0]]
    np.testing.assert_allclose(arm.jacobian(q), numeric, atol=2e-4)


@pytest.mark.parametrize("step", [(0.03, 0, 0), (0, 0, -0.03), (0.04, 0, 0.03)])
def test_tip_follows_the_critically_damped_curve(env, step):
    arm = env.arm
    start = arm.tip_pose()[0]
    arm.goal = start + step
    moved = []
    for _ in range(25):
        arm.prepare()
        for _ in range(10):
            arm.actuate()
            env.world.p.stepSimulation()
            moved.append(arm.tip_pose()[0] - start)
    length = np.linalg.norm(step)
    along = np.array(moved) @ step / length
    t = np.arange(1, len(along) + 1) / 250
    ideal = length * (1 - np.exp(-20 * t) * (1 + 20 * t))  # natural frequency sqrt(400) = 20 rad/s
    assert np.abs(along - ideal).max() < 0.05 * length
    aside = np.array(moved) - np.outer(along, step) / length
    assert np.abs(aside).max() < 0.05 * length


def test_hand_keeps_pointing_down_in_a_fast_sweep(env):
    tilt = []
    for i in range(48):
        env.step(np.array([1, 0, -1]) * (1 if (i // 8) % 2 == 0 else -1))
        tilt.append(np.abs(env.arm._error(env.arm.goal)[3:]).max())
    assert max(tilt) < 0.01  # rad


def test_posture_torque_does_not_move_the_tip(env):
    """The nullspace projection: a posture torque must leave the tip's acceleration at zero."""
    q, _ = env.arm.state()
    J, M = env.arm.jacobian(q), env.arm.mass_matrix(q)
    Lambda = np.linalg.inv(J @ np.linalg.solve(M, J.T))
    tau = (M - J.T @ Lambda @ J) @ np.ones(7)  # N^T M (posture)
    np.testing.assert_allclose(J @ np.linalg.solve(M, tau), 0, atol=1e-6)


def test_reset_puts_the_tip_where_it_was_told(env):
    for goal in ((0.45, 0, 0.05), (0.70, 0.01, 0.15)):
        env.arm.reset(np.array(goal))
        np.testing.assert_allclose(env.arm.tip_pose()[0], goal, atol=1e-5)


def test_a_reset_far_away_is_exact_and_turns_no_elbow_upside_down(env):
    """Of a row of arms with the tip in one place the one that is near the rest posture."""
    arm = env.arm
    for goal in itertools.product((0.3, 0.45, 0.6), (-0.3, 0, 0.3), (0.02, 0.2, 0.4)):
        arm.reset(np.array(goal))
        (q, dq), free = arm.state(), np.linalg.svd(arm.jacobian(arm.state()[0]))[2][-1]
        assert np.abs(arm._error(np.array(goal))).max() < 1e-6 and not dq.any()
        assert np.abs(q - arm.home).max() < 2.5, goal
        assert abs(free @ (q - arm.home)) < 0.35, goal


def test_the_way_to_a_goal_is_turned_back_in_radians(env):
    """The tip is turned by 0.02 about each axis in turn, and lacks as much the other way."""
    arm = env.arm
    x, R = arm.tip_pose()
    for axis in np.eye(3):
        turn = rotation(0.02 * axis)
        arm.tip_pose = lambda turn=turn: (x + 0.01, turn @ R)
        np.testing.assert_allclose(arm._error(x), [*3 * [-0.01], *(-0.02 * axis)], atol=1e-5)


def rotation(vector):
    """Matrix (3, 3) of a rotation vector in rad."""
    return cv2.Rodrigues(np.array(vector))[0]


def test_a_goal_that_asks_for_too_much_comes_nearer_until_the_fastest_joint_is_at_its_limit(env):
    """Half of a speed that would be twice a joint's limit, in the same direction."""
    arm = env.arm
    x, home = arm.tip_pose()[0], arm.state()[0]
    pulls = []
    for way in (0.005, 0.3, 0.6):
        arm.goal = x + (way, 0, 0)
        arm.prepare()
        pulls.append(arm._bias - arm._Kq @ home - arm._h)
    arm.speed = np.full(7, np.inf)
    arm.goal = x + (0.3, 0, 0)
    arm.prepare()
    free = arm._bias - arm._Kq @ home - arm._h
    np.testing.assert_allclose(pulls[1], pulls[2], atol=1e-6)  # both are cut to the same
    share = np.linalg.norm(pulls[1]) / np.linalg.norm(free)
    J, M = arm.jacobian(home), arm.mass_matrix(home)
    dq = 10 * np.linalg.solve(M, J.T) @ np.linalg.inv(J @ np.linalg.solve(M, J.T))[:, 0] * 0.3
    assert share == pytest.approx((arm.spec.speed / np.abs(dq)).min(), rel=0.01)  # KP / KD is 10


def test_a_stiffer_arm_is_as_much_stiffer_in_its_posture():
    """A fortieth of the tip's; or slide's elbow would swing up when actions alternate."""
    for name in ("push", "slide"):
        env = tasks.bare(name, observation="state")
        assert env.arm.kp_posture == pytest.approx(env.KP / 40) and env.arm.kp == env.KP
        env.close()


def test_what_gravity_takes_beyond_a_joints_torque_is_all_that_is_sent(env):
    """Nothing is left to drive with; the drive never turns round."""
    arm, sent = env.arm, []
    arm.goal = arm.tip_pose()[0] + (0.05, 0, 0.05)
    arm.prepare()
    q, dq = arm.state()
    asked = arm._bias - arm._Kq @ q - arm._Kd @ dq
    i = np.abs(arm._h).argmax()
    arm._bias = arm._bias + np.sign(arm._h[i]) * np.abs(asked).max() * np.eye(7)[i]
    arm.effort = np.full(7, 1e6)
    arm.effort[i] = 0.9 * np.abs(arm._h[i])
    send = arm.p.setJointMotorControlArray
    arm.p.setJointMotorControlArray = lambda *args, **more: sent.append(more["forces"])
    arm.actuate()
    arm.p.setJointMotorControlArray = send
    np.testing.assert_allclose(sent[0], arm._h)


def test_no_torque_is_above_the_joints_limit_and_all_are_cut_by_one_factor(env):
    """A goal far away asks for more than a joint has; what gravity takes is not cut."""
    arm, sent = env.arm, []
    send = arm.p.setJointMotorControlArray
    arm.p.setJointMotorControlArray = lambda *args, **more: (
        sent.append(np.array(more["forces"])) or send(*args, **more)
    )
    arm.speed = np.full(7, np.inf)  # or the speed limit would make the goal come nearer
    arm.goal = arm.tip_pose()[0] + (0.1, 0, 0.3)
    arm.prepare()
    arm.kp_before = arm._bias.copy()
    q, dq = arm.state()
    asked = arm._bias - arm._Kq @ q - arm._Kd @ dq
    arm.effort = np.abs(arm._h) + 0.5 * np.abs(asked - arm._h).max() * np.linspace(0.2, 1, 7)
    arm.actuate()
    del arm.p.setJointMotorControlArray
    assert (np.abs(asked) > arm.effort).any()
    assert (np.abs(sent[-1]) <= arm.effort + 1e-9).all()
    assert np.isclose(np.abs(sent[-1]), arm.effort).any()
    share = (sent[-1] - arm._h) / (asked - arm._h)
    np.testing.assert_allclose(share, share[0])
    assert 0 < share[0] < 1


def test_a_twisted_arm_comes_back_to_its_posture_while_its_tip_stays(env):
    """In the nullspace of the tip: a seventh of a radian is a fifth of it after a second."""
    arm = env.arm
    q, _ = arm.state()
    J = arm.jacobian(q)
    free = np.linalg.svd(J)[2][-1]  # moves no tip, to first order
    arm._set(q + 0.15 * free)
    tip = arm.tip_pose()[0]
    arm.goal = tip.copy()
    before = np.abs(free @ (arm.state()[0] - q))
    for _ in range(25):
        env.step(np.zeros(3))
    after, moved = np.abs(free @ (arm.state()[0] - q)), arm.tip_pose()[0] - tip
    assert after < 0.4 * before and np.abs(moved).max() < 0.004


def test_a_posture_comes_back_critically_damped(env):
    """What is left of a small turn falls as (1 + w t) exp(-w t), w the root of the gain.

    To 0.06; with half of the damping it would be off by 0.3, and swing over.
    """
    arm, left = env.arm, []
    q, _ = arm.state()
    arm.home, free = q.copy(), np.linalg.svd(arm.jacobian(q))[2][-1]
    arm._set(q + 0.03 * free)
    arm.goal = arm.tip_pose()[0].copy()
    for _ in range(50):
        env.step(np.zeros(3))
        left.append(free @ (arm.state()[0] - q) / 0.03)
    wt = np.sqrt(arm.kp_posture) * np.arange(1, 51) / 25
    np.testing.assert_allclose(left, (1 + wt) * np.exp(-wt), atol=0.1)


def test_a_tip_gives_way_three_millimetres_out_of_its_box_and_no_sooner(env):
    """As if a contact had pressed it out, while its goal stays inside."""
    arm = env.arm
    middle, (_, high) = arm.goal.copy(), arm.box
    for out, goal in ((0.0025, middle), (0.0035, high)):
        arm.goal = middle
        arm.prepare()
        arm._x = high + (0, 0, out)
        arm.actuate()
        np.testing.assert_allclose(arm.goal, goal, atol=1e-9)
