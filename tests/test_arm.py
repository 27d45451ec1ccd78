"""The arms and their controller: claims about kinematics and about how the tip moves."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from tasks.reach import Reach
from tasks.world.bodies import human, panda

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


@pytest.fixture(params=EMBODIMENTS)
def env(request):
    env = Reach(embodiment=request.param, observation="state")
    env.reset(seed=0)
    yield env
    env.close()


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
