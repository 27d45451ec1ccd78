"""The Operational Space Controller that moves both arms.

In: a goal for the arm's tip, position in metres and orientation. Out: joint torques that make the
tip behave like a critically damped mass on springs, in all six directions alike, whatever the arm's
pose:
    tau = J^T Lambda (kp e - kd v) + h + N^T M (posture),    Lambda = (J M^-1 J^T)^-1
After Khatib 1987, IEEE J. Robotics and Automation 3(1), 43-53, speed limit included; kp and
the posture are ours.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tasks.world.bodies import ARMS, TIP

if TYPE_CHECKING:
    from pybullet_utils.bullet_client import BulletClient

KP = 400.0  # 1/s^2, stiffness per unit of mass: the tip's natural frequency is sqrt(KP) = 20 rad/s
FRICTION = 0.4  # of gripper and hand: rougher ones stick to a pushed object and tip it over
# Of kp: the pull towards the rest posture, in the nullspace of the tip's motion. It has to bear the
# tip's acceleration: with 10 instead of 40 1/s^2 slide's elbow swings up when actions alternate.
POSTURE = 1 / 40
YIELD = 0.003  # m out of its box, where a tip gives way; in free motion it is 1.1 mm at most
EXACT = 1e-7  # m and rad, close enough for a reset; Bullet's poses are exact to 4e-8


class Arm:
    """One arm in a PyBullet client, its tip driven by the Operational Space Controller.

    `goal` is the tip's goal position in metres; the orientation goal is always straight down.
    box: the corners (low, high) of the goal's box, in m. kp: the tip's stiffness in 1/s^2.
    overspeed: how many times their rated speeds the joints may reach.
    """

    def __init__(
        self,
        client: BulletClient,
        embodiment: str,
        box: tuple[tuple[float, ...], tuple[float, ...]],
        kp: float = KP,
        overspeed: float = 1.0,
    ):
        self.p, self.spec, self.box = client, ARMS[embodiment](), np.array(box)
        self.kp, self.kd = kp, 2 * np.sqrt(kp)  # critically damped
        self.kp_posture = POSTURE * kp
        # The human's inertias are stated; the Panda file's are placeholders, Bullet's are better.
        flags = client.URDF_USE_INERTIA_FROM_FILE if embodiment == "human" else 0
        with tempfile.TemporaryDirectory(prefix="lbw_arm_") as folder:
            for name, text in {"arm.urdf": self.spec.urdf, **self.spec.meshes}.items():
                Path(folder, name).write_text(text, encoding="utf-8")
            self.body = client.loadURDF(
                str(Path(folder, "arm.urdf")), self.spec.base, useFixedBase=True, flags=flags
            )
        infos = [client.getJointInfo(self.body, j) for j in range(client.getNumJoints(self.body))]
        self.joints = [i[0] for i in infos if i[2] == client.JOINT_REVOLUTE]  # the 7 that turn
        self.links = {i[12].decode(): i[0] for i in infos}
        self.tip = self.links[TIP[embodiment]]
        self.effort = np.array(self.spec.effort, float)
        self.speed = overspeed * np.array(self.spec.speed)
        self.home = np.array(self.spec.home)
        self.down = np.array(self.spec.down, float)

        base_name = client.getBodyInfo(self.body)[0].decode()
        for name, rgba in self.spec.colours.items():
            link = -1 if name == base_name else self.links[name]
            client.changeVisualShape(self.body, link, rgbaColor=rgba, specularColor=(0, 0, 0))
        for name, link in self.links.items():
            client.changeDynamics(
                self.body, link,
                linearDamping=0, angularDamping=0, jointDamping=0, lateralFriction=FRICTION,
            )  # fmt: skip
            if name not in self.spec.reach_links:
                client.setCollisionFilterGroupMask(self.body, link, 0, 0)
        client.setCollisionFilterGroupMask(self.body, -1, 0, 0)
        # Bullet gives every joint a velocity motor at birth; it would work against the torques.
        n = len(self.joints)
        client.setJointMotorControlArray(
            self.body, self.joints, client.VELOCITY_CONTROL, forces=[0] * n
        )
        self._zeros, self._origin = [0.0] * n, [0.0, 0.0, 0.0]

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Joint angles (7,) in rad and velocities (7,) in rad/s."""
        states = self.p.getJointStates(self.body, self.joints)
        return np.array([s[0] for s in states]), np.array([s[1] for s in states])

    def tip_pose(self) -> tuple[np.ndarray, np.ndarray]:
        """Tip position (3,) in m and rotation matrix (3, 3), from the joints' current angles."""
        state = self.p.getLinkState(self.body, self.tip, computeForwardKinematics=True)
        return np.array(state[4]), np.array(self.p.getMatrixFromQuaternion(state[5])).reshape(3, 3)

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """(6, 7): the tip's linear velocity over its angular velocity, per joint velocity."""
        # The point is given in the link's own URDF frame.
        linear, angular = self.p.calculateJacobian(
            self.body, self.tip, self._origin, list(q), self._zeros, self._zeros
        )
        return np.array(linear + angular)

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """(7, 7) joint space inertia in kg m^2."""
        return np.array(self.p.calculateMassMatrix(self.body, list(q)))

    def reset(self, tip: np.ndarray) -> None:
        """Put the tip there (m), pointing down, at rest, by Newton steps from the rest posture."""
        q = self.home.copy()
        for _ in range(60):
            self._set(q)
            error = self._error(tip)
            length = np.abs(error).max()
            if length < EXACT:
                break
            J = self.jacobian(q)
            inverse = np.linalg.pinv(J)
            posture = self.home - q
            posture -= inverse @ (J @ posture)
            # Short steps, and near the rest posture: a long one may land with the elbow upside
            # down.
            q = q + inverse @ error * min(1, 0.05 / length) + 0.2 * posture * (length > 1e-3)
        self.goal = np.array(tip, float)

    def _set(self, q):
        for joint, angle in zip(self.joints, q, strict=True):
            self.p.resetJointState(self.body, joint, angle)

    def _error(self, goal):
        """(6,): what the tip lacks to the goal, in m and, as a rotation vector, in rad."""
        x, R = self.tip_pose()
        return np.concatenate([goal - x, 0.5 * np.cross(R, self.down, axis=0).sum(1)])

    def prepare(self) -> None:
        """Linearise the controller about the current state, once a control step.

        Within 40 ms J, M and h hardly change, so the torque is linear in q and dq: two small
        products.
        """
        q, dq = self.state()
        J, M = self.jacobian(q), self.mass_matrix(q)
        M_inv_JT = np.linalg.solve(M, J.T)  # (7, 6)
        Lambda = np.linalg.inv(J @ M_inv_JT)  # (6, 6)
        F = J.T @ Lambda  # (7, 6), acceleration of the tip -> joint torque
        NT_M = M - F @ J  # (7, 7) = N^T M, as M_inv_JT^T M = J
        h = np.array(self.p.calculateInverseDynamics(self.body, list(q), list(dq), self._zeros))
        error = self._error(self.goal)
        # At these joint speeds damper and spring balance: a goal that asks for more comes nearer.
        speed = self.kp / self.kd * np.abs(M_inv_JT @ (Lambda @ error))  # (7,) rad/s
        error /= max(1.0, (speed / self.speed).max())
        self._Kq = self.kp * F @ J + self.kp_posture * NT_M
        self._Kd = self.kd * F @ J + 2 * np.sqrt(self.kp_posture) * NT_M
        self._bias = h + self.kp * F @ (error + J @ q) + self.kp_posture * NT_M @ self.home
        self._h, self._q, self._x, self._dx_dq = h, q, self.tip_pose()[0], J[:3]

    def actuate(self) -> None:
        """Send the torques for the next simulation step; Bullet forgets them after each."""
        q, dq = self.state()
        x = self._x + self._dx_dq @ (q - self._q)
        inside = np.clip(x, *self.box)
        if np.abs(x - inside).max() > YIELD:
            # Only contact drives the tip out of its box: a gripper that presses on a thing bends at
            # its light wrist, and the tip slides along x, 1.4 times as far as it presses.
            self.goal = inside
            self.prepare()
        tau = self._bias - self._Kq @ q - self._Kd @ dq
        over = np.abs(tau) > self.effort
        if over.any():
            # One factor for all joints. When each was cut on its own, the tip left its line and the
            # elbow swung up: slide's tip was up to 63 cm out of its box, its joints at 61 rad/s.
            drive, room = tau - self._h, np.copysign(self.effort, tau) - self._h
            tau = self._h + max(0.0, (room[over] / drive[over]).min()) * drive
        self.p.setJointMotorControlArray(
            self.body, self.joints, self.p.TORQUE_CONTROL, forces=tau.tolist()
        )

    def brake(self) -> None:
        """Hold the joints to their speed limits, after a simulation step.

        Only contact breaks them, when a knock on the tip or a hard press spins the light wrist: its
        torque is too weak to slow it down in time.
        """
        q, dq = self.state()
        for i in np.flatnonzero(np.abs(dq) > self.speed):
            speed = np.copysign(self.speed[i], dq[i])
            self.p.resetJointState(self.body, self.joints[i], q[i], speed)
