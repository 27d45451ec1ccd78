"""The two arms and the Operational Space Controller that moves both (Khatib 1987).

In: a goal for the arm's tip, position in metres and orientation. Out: joint torques that make the
tip behave like a critically damped mass on springs, in all six directions alike, whatever the arm's
pose:
    tau = J^T Lambda (kp e - kd v) + h + N^T M (posture),    Lambda = (J M^-1 J^T)^-1
The robot is the Franka Panda, the human a shoulder, elbow, wrist and hand built from primitives.
"""

from __future__ import annotations

import shutil
import tempfile
import weakref
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pybullet_data

KP = 400.0  # 1/s^2, stiffness per unit of mass: the tip's natural frequency is sqrt(KP) = 20 rad/s
FRICTION = 0.4  # of gripper and hand: rougher ones stick to a pushed object and tip it over
KP_POSTURE = 10.0  # 1/s^2, pull towards the rest posture, in the nullspace of the tip's motion

WHITE = (0.90, 0.90, 0.88, 1)
SKIN, SLEEVE = (0.86, 0.63, 0.50, 1), (0.22, 0.30, 0.44, 1)


@dataclass(frozen=True)
class ArmSpec:
    """What tells one arm from another. Lengths in metres, angles in radians, torques in Nm."""

    urdf: str  # the model, as text
    base: tuple[float, float, float]  # where it stands
    home: tuple[float, ...]  # rest posture, one angle per joint
    down: tuple[tuple[float, ...], ...]  # rotation matrix of the tip when it points at the table
    effort: tuple[float, ...]  # torque limits
    reach_links: tuple[str, ...]  # links that may touch the world; the others never get near it
    colours: dict[str, tuple]  # link name -> rgba
    meshes: dict[str, str] = field(default_factory=dict)  # file name -> OBJ text, beside the URDF


def panda() -> ArmSpec:
    """The Franka Panda of pybullet_data, fingers fixed 3 cm apart, drawn with its low-polygon
    meshes."""
    folder = Path(pybullet_data.getDataPath()) / "franka_panda"
    urdf = (folder / "panda.urdf").read_text()
    # The visual meshes cost ten times the rendering time of the collision meshes.
    urdf = urdf.replace("meshes/visual", "meshes/collision").replace("package://", f"{folder}/")
    # Fingers across the line of sight: they hold a pushed object from two sides, the camera sees
    # one.
    urdf = urdf.replace('type="prismatic"', 'type="fixed"')
    for side in (1, -1):
        urdf = urdf.replace('<origin rpy="0 0 0" xyz="0 0 0.0584"/>',
                            f'<origin rpy="0 0 0" xyz="0 {side * 0.015} 0.0584"/>', 1)  # fmt: skip
    # pybullet_data puts the grasp target 7 mm above the fingers' end; ours is where they touch.
    urdf = urdf.replace('xyz="0 0 0.105"', 'xyz="0 0 0.112"')
    parts = [*(f"link{i}" for i in range(8)), "hand", "leftfinger", "rightfinger"]
    return ArmSpec(
        urdf=urdf,
        base=(0.0, 0.0, 0.0),
        home=(0.0, 0.10, 0.0, -2.45, 0.0, 2.55, 0.785),
        down=((1, 0, 0), (0, -1, 0), (0, 0, -1)),
        effort=(87, 87, 87, 87, 12, 12, 12),
        reach_links=("panda_hand", "panda_leftfinger", "panda_rightfinger"),
        # One colour: patches of an arm in two tones tempt the translation to paint them anywhere.
        colours={f"panda_{name}": WHITE for name in parts},
    )


def limb(*profile, sides: int = 16) -> str:
    """A surface of revolution about x as OBJ text, from (x, radius) pairs in m."""
    x, r = np.array(profile).T
    slope = np.gradient(r, x)
    turn = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.stack([np.zeros(sides), np.cos(turn), np.sin(turn)], 1)  # (sides, 3)
    points = [(x[i], 0, 0) + r[i] * ring for i in range(len(x))]
    normals = [((-slope[i], 0, 0) + ring) / np.hypot(1, slope[i]) for i in range(len(x))]
    rows = [f"v {a:.5f} {b:.5f} {c:.5f}" for a, b, c in np.concatenate(points)]
    rows += [f"vn {a:.4f} {b:.4f} {c:.4f}" for a, b, c in np.concatenate(normals)]
    for i in range(len(x) - 1):
        for j in range(sides):
            a, b = i * sides + j + 1, i * sides + (j + 1) % sides + 1
            c, d = a + sides, b + sides
            rows += [f"f {a}//{a} {b}//{b} {d}//{d}", f"f {a}//{a} {d}//{d} {c}//{c}"]
    return "\n".join(rows) + "\n"


# m, shoulder to elbow, elbow to wrist, wrist to fingertip
UPPER_ARM, FOREARM, HAND = 0.34, 0.36, 0.19


def human() -> ArmSpec:
    """A human-like arm: seven joints, a sleeve to the elbow, a hand with four fingers and a
    thumb."""

    def shape(kind, size, xyz, rpy=(0, 0, 0)):
        what = {
            "mesh": lambda name: f'<mesh filename="{name}"/>',
            "box": lambda *s: f'<box size="{s[0]} {s[1]} {s[2]}"/>',
            "sphere": lambda r: f'<sphere radius="{r}"/>',
        }[kind](*size)
        place = f'<origin xyz="{xyz[0]} {xyz[1]} {xyz[2]}" rpy="{rpy[0]} {rpy[1]} {rpy[2]}"/>'
        return place + f"<geometry>{what}</geometry>"

    def link(name, mass, length, shapes=(), touches=False):
        # A slender rod's inertia; a share for the muscles keeps the light hand stiff against
        # contact.
        i = mass * max(length, 0.1) ** 2 / 12 + 0.01
        body = "".join(f"<visual>{s}</visual>" for s in shapes)
        body += "".join(f"<collision>{s}</collision>" for s in shapes if touches)
        return (f'<link name="{name}"><inertial><origin xyz="{length / 2} 0 0"/><mass value="{mass}"/>'
                f'<inertia ixx="{i}" ixy="0" ixz="0" iyy="{i}" iyz="0" izz="{i}"/></inertial>'
                f"{body}</link>")  # fmt: skip

    def joint(name, parent, child, x, axis=None):
        kind = "fixed" if axis is None else "revolute"
        limit = '<limit lower="-2.9" upper="2.9" effort="90" velocity="20"/>'
        turn = "" if axis is None else f'<axis xyz="{axis}"/>{limit}'
        return (f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
                f'<origin xyz="{x} 0 0"/>{turn}</joint>')  # fmt: skip

    sleeve = [shape("mesh", ("sleeve.obj",), (0, 0, 0))]
    cuff = [shape("mesh", ("cuff.obj",), (0, 0, 0))]
    forearm = [shape("mesh", ("forearm.obj",), (0, 0, 0))]
    # The hand points down like a gripper: its x axis along the fingers, y across, z forward.
    # Knuckles bent, fingertips together under the wrist, as one holds a pen.
    palm = [
        shape("box", (0.085, 0.085, 0.045), (0.045, 0, 0)),
        shape("box", (0.05, 0.08, 0.058), (0.095, 0, 0)),
    ]
    fingers = [
        shape("box", (length, 0.019, 0.023), (0.115 + length / 2, y, 0))
        for y, length in ((-0.033, 0.062), (-0.011, 0.075), (0.011, 0.072), (0.033, 0.055))
    ]
    thumb = [shape("box", (0.065, 0.02, 0.018), (0.118, -0.03, 0.028), (0, 0.35, 0))]
    chain = [
        ("shoulder_yaw", "base", "shoulder1", 0, "0 0 1"),
        ("shoulder_pitch", "shoulder1", "shoulder2", 0, "0 1 0"),
        ("shoulder_roll", "shoulder2", "upper_arm", 0, "1 0 0"),
        ("elbow", "upper_arm", "cuff", UPPER_ARM, "0 1 0"),
        ("forearm_roll", "cuff", "forearm", 0, "1 0 0"),
        ("wrist_pitch", "forearm", "wrist", FOREARM, "0 1 0"),
        ("wrist_yaw", "wrist", "hand", 0, "0 0 1"),
        ("tip_joint", "hand", "tip", HAND, None),
    ]
    links = [
        link("base", 3.0, 0.1, [shape("sphere", (0.07,), (0, 0, 0))]),
        link("shoulder1", 0.3, 0.1),
        link("shoulder2", 0.3, 0.1),
        link("upper_arm", 2.0, UPPER_ARM, sleeve),
        link("cuff", 0.4, 0.1, cuff),
        link("forearm", 1.0, FOREARM, forearm),
        link("wrist", 0.1, 0.05, [shape("sphere", (0.028,), (0, 0, 0))]),
        link("hand", 0.4, 0.15, palm + fingers + thumb, touches=True),
        link("tip", 0.01, 0.0),
    ]
    urdf = (
        '<robot name="human_arm">' + "".join(links) + "".join(joint(*c) for c in chain) + "</robot>"
    )
    meshes = {  # (distance along the limb, radius) in m: a forearm is thickest near the elbow
        "sleeve.obj": limb((-0.04, 0.01), (0, 0.058), (0.20, 0.054), (0.34, 0.050), (0.385, 0.02)),
        "cuff.obj": limb((-0.045, 0.02), (0, 0.048), (0.09, 0.047), (0.092, 0.03)),
        "forearm.obj": limb((0.05, 0.02), (0.07, 0.042), (0.14, 0.042), (0.25, 0.034), (0.33, 0.027),
                            (0.37, 0.027), (0.385, 0.015)),
    }  # fmt: skip
    return ArmSpec(
        urdf=urdf,
        meshes=meshes,
        base=(0.12, 0.0, 0.44),
        home=(0.0, -0.60, 0.0, 1.75, 0.0, 0.42, 0.0),
        down=((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
        effort=(90, 90, 60, 60, 20, 20, 20),
        reach_links=("hand",),
        colours={n: SLEEVE for n in ("base", "upper_arm", "cuff")}
        | {n: SKIN for n in ("forearm", "wrist", "hand")},
    )


ARMS = {"robot": panda, "human": human}
TIP = {"robot": "panda_grasptarget", "human": "tip"}


class Arm:
    """One arm in a PyBullet client, its tip driven by the Operational Space Controller.

    `goal` is the tip's goal position in metres; the orientation goal is always straight down. kp is
    the stiffness in 1/s^2.
    """

    def __init__(self, client, embodiment: str, kp: float = KP):
        self.p, self.spec = client, ARMS[embodiment]()
        self.kp, self.kd = kp, 2 * np.sqrt(kp)  # critically damped
        # kept while we live: the viewer reads meshes
        files = Path(tempfile.mkdtemp(prefix="lbw_arm_"))
        weakref.finalize(self, shutil.rmtree, files, ignore_errors=True)
        for name, text in {"arm.urdf": self.spec.urdf, **self.spec.meshes}.items():
            (files / name).write_text(text)
        # The human's inertias are stated; the Panda file's are placeholders, Bullet's are better.
        flags = client.URDF_USE_INERTIA_FROM_FILE if embodiment == "human" else 0
        self.body = client.loadURDF(
            str(files / "arm.urdf"), self.spec.base, useFixedBase=True, flags=flags
        )
        infos = [client.getJointInfo(self.body, j) for j in range(client.getNumJoints(self.body))]
        self.joints = [i[0] for i in infos if i[2] == client.JOINT_REVOLUTE]  # the 7 that turn
        self.links = {i[12].decode(): i[0] for i in infos}
        self.tip = self.links[TIP[embodiment]]
        self.effort = np.array(self.spec.effort, float)
        self.home = np.array(self.spec.home)
        self.down = np.array(self.spec.down, float)

        base_name = client.getBodyInfo(self.body)[0].decode()
        for name, rgba in self.spec.colours.items():
            link = -1 if name == base_name else self.links[name]
            client.changeVisualShape(self.body, link, rgbaColor=rgba, specularColor=(0, 0, 0))
        for name, link in self.links.items():
            client.changeDynamics(self.body, link, linearDamping=0, angularDamping=0, jointDamping=0,
                                  lateralFriction=FRICTION)  # fmt: skip
            if name not in self.spec.reach_links:
                client.setCollisionFilterGroupMask(self.body, link, 0, 0)
        client.setCollisionFilterGroupMask(self.body, -1, 0, 0)
        # Bullet gives every joint a velocity motor at birth; it would brake the torques.
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
        """Put the tip at that position, pointing down, at rest, by Newton steps from the rest
        posture."""
        q = self.home.copy()
        for _ in range(60):
            self._set(q)
            error = self._error(tip)
            length = np.abs(error).max()
            if length < 1e-9:
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
        self._Kq = self.kp * F @ J + KP_POSTURE * NT_M
        self._Kd = self.kd * F @ J + 2 * np.sqrt(KP_POSTURE) * NT_M
        self._bias = (
            h + self.kp * F @ (self._error(self.goal) + J @ q) + KP_POSTURE * NT_M @ self.home
        )

    def actuate(self) -> None:
        """Send the torques for the next simulation step; Bullet forgets them after each."""
        q, dq = self.state()
        tau = np.clip(self._bias - self._Kq @ q - self._Kd @ dq, -self.effort, self.effort)
        self.p.setJointMotorControlArray(
            self.body, self.joints, self.p.TORQUE_CONTROL, forces=tau.tolist()
        )
