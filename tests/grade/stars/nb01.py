"""Star 1, mind your elbow: how close do flies come to the elbow of an arm whose tip stays put?"""

import numpy as np

import tasks
from tests.grade.star import Star

FLIES = 8
TIP = (0.6, 0.0, 0.1)  # m, where it has to stay
STRAY = 0.01  # m: a tip that is farther off has not stayed
FAR, PAST, SPEED = 0.4, 0.1, 0.3  # m: where a fly comes from, how far it flies on; m/s
HERTZ = 250  # simulation steps a second


def missed_by(spare) -> float:
    """Mean over the flies of how close one comes to the elbow, in cm.

    spare(q, dq, M, J, gap, drift) are torques (7,) in Nm, of which the tip feels nothing.
    """
    env = tasks.bare("reach", observation="state")
    env.reset(seed=0)
    env.arm.reset(np.array(TIP))
    rng = np.random.default_rng(0)
    closest = [_fly(env.arm, spare, rng) for _ in range(FLIES)]
    env.close()
    return 100 * float(np.mean(closest))


def _fly(arm, spare, rng):
    """A fly sets out for where the elbow is now, and flies on: how close it comes, in m. 0, and the
    arm is put back, if the tip does not stay."""
    way = rng.normal(size=3)
    way *= SPEED / np.linalg.norm(way)
    start, closest = elbow(arm) - way * FAR / SPEED, FAR
    for step in range(int((FAR + PAST) / SPEED * HERTZ)):
        gap = start + way * step / HERTZ - elbow(arm)
        q, dq = arm.state()
        M, zeros = arm.mass_matrix(q), [0.0] * len(q)
        J = arm.p.calculateJacobian(arm.body, _link(arm), [0.0] * 3, list(q), zeros, zeros)[0]
        tau = spare(q.copy(), dq.copy(), M.copy(), np.array(J), gap, way.copy())
        act(arm, q, dq, M, np.asarray(tau, float))
        closest = min(closest, float(np.linalg.norm(gap)))
        if np.linalg.norm(arm.tip_pose()[0] - TIP) > STRAY:
            arm.reset(np.array(TIP))
            return 0.0
    return closest


def act(arm, q, dq, M, tau) -> None:
    """A simulation step: the tip is held, and tau (7,) is what the joints do besides."""
    J = arm.jacobian(q)
    Lambda = np.linalg.inv(J @ np.linalg.solve(M, J.T))
    h = np.array(arm.p.calculateInverseDynamics(arm.body, list(q), list(dq), [0.0] * len(q)))
    tau = tau - J.T @ Lambda @ J @ np.linalg.solve(M, tau)  # N^T tau
    tau += J.T @ Lambda @ (arm.kp * arm._error(np.array(TIP)) - arm.kd * (J @ dq)) + h
    tau = np.clip(tau, -arm.effort, arm.effort)
    arm.p.setJointMotorControlArray(arm.body, arm.joints, arm.p.TORQUE_CONTROL, forces=tau.tolist())
    arm.p.stepSimulation()
    arm.brake()


def _link(arm):
    return arm.links["panda_link4"]


def elbow(arm) -> np.ndarray:
    """Where it is (3,), in m."""
    return np.array(arm.p.getLinkState(arm.body, _link(arm), computeForwardKinematics=True)[4])


STAR = Star(missed_by, "cm", bar=18, naive=14.6, ours=21.1)
