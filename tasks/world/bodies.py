"""The two arms as models: links, joints, meshes and colours, written as URDF text.

The robot is the Franka Panda of pybullet_data, the human a shoulder, elbow, wrist and hand built
from primitives. Lengths in metres, masses in kilograms.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pybullet_data

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
    speed: tuple[float, ...]  # joint speed limits, rad/s
    reach_links: tuple[str, ...]  # links that may touch the world; the others never get near it
    colours: dict[str, tuple]  # link name -> rgba
    meshes: dict[str, str] = field(default_factory=dict)  # file name -> OBJ text, beside the URDF


def panda() -> ArmSpec:
    """The Panda of pybullet_data, fingers fixed 3 cm apart, drawn with its low-polygon meshes."""
    folder = Path(pybullet_data.getDataPath()) / "franka_panda"
    urdf = (folder / "panda.urdf").read_text(encoding="utf-8")
    # The visual meshes cost ten times the rendering time of the collision meshes.
    urdf = urdf.replace("meshes/visual", "meshes/collision").replace("package://", f"{folder}/")
    # The fingers lie across the line of sight: they hold a pushed object from two sides, and the
    # camera sees one.
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
        # Both are panda.urdf's, which are the real arm's.
        effort=(87, 87, 87, 87, 12, 12, 12),
        speed=(2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61),
        reach_links=("panda_hand", "panda_leftfinger", "panda_rightfinger"),
        # One colour: patches of an arm in two tones tempt the translation to paint them anywhere.
        colours={f"panda_{name}": WHITE for name in parts},
    )


def limb(*profile: tuple[float, float], sides: int = 16) -> str:
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


def _shape(kind, size, xyz, rpy=(0, 0, 0)):
    what = {
        "mesh": lambda name: f'<mesh filename="{name}"/>',
        "box": lambda *s: f'<box size="{s[0]} {s[1]} {s[2]}"/>',
        "sphere": lambda r: f'<sphere radius="{r}"/>',
    }[kind](*size)
    place = f'<origin xyz="{xyz[0]} {xyz[1]} {xyz[2]}" rpy="{rpy[0]} {rpy[1]} {rpy[2]}"/>'
    return place + f"<geometry>{what}</geometry>"


def _link(name, mass, length, shapes=(), touches=False):
    # A slender rod's inertia; a share for the muscles keeps the light hand stiff against contact.
    i = mass * max(length, 0.1) ** 2 / 12 + 0.01
    body = "".join(f"<visual>{s}</visual>" for s in shapes)
    body += "".join(f"<collision>{s}</collision>" for s in shapes if touches)
    return (
        f'<link name="{name}"><inertial><origin xyz="{length / 2} 0 0"/><mass value="{mass}"/>'
        f'<inertia ixx="{i}" ixy="0" ixz="0" iyy="{i}" iyz="0" izz="{i}"/></inertial>'
        f"{body}</link>"
    )


def _joint(name, parent, child, x, axis=None):
    kind = "fixed" if axis is None else "revolute"
    limit = '<limit lower="-2.9" upper="2.9" effort="90" velocity="20"/>'
    turn = "" if axis is None else f'<axis xyz="{axis}"/>{limit}'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} 0 0"/>{turn}</joint>'
    )


def _hand() -> list[str]:
    # It points down like a gripper: its x axis along the fingers, y across, z forward. Knuckles
    # bent, fingertips together under the wrist, as one holds a pen.
    palm = [
        _shape("box", (0.085, 0.085, 0.045), (0.045, 0, 0)),
        _shape("box", (0.05, 0.08, 0.058), (0.095, 0, 0)),
    ]
    fingers = [
        _shape("box", (length, 0.019, 0.023), (0.115 + length / 2, y, 0))
        for y, length in ((-0.033, 0.062), (-0.011, 0.075), (0.011, 0.072), (0.033, 0.055))
    ]
    thumb = _shape("box", (0.065, 0.02, 0.018), (0.118, -0.03, 0.028), (0, 0.35, 0))
    return [*palm, *fingers, thumb]


def human() -> ArmSpec:
    """A human-like arm: seven joints, a sleeve to the elbow, four fingers and a thumb."""
    sleeve, cuff, forearm = (
        [_shape("mesh", (f"{name}.obj",), (0, 0, 0))] for name in ("sleeve", "cuff", "forearm")
    )
    links = [
        _link("base", 3.0, 0.1, [_shape("sphere", (0.07,), (0, 0, 0))]),
        _link("shoulder1", 0.3, 0.1),
        _link("shoulder2", 0.3, 0.1),
        _link("upper_arm", 2.0, UPPER_ARM, sleeve),
        _link("cuff", 0.4, 0.1, cuff),
        _link("forearm", 1.0, FOREARM, forearm),
        _link("wrist", 0.1, 0.05, [_shape("sphere", (0.028,), (0, 0, 0))]),
        _link("hand", 0.4, 0.15, _hand(), touches=True),
        _link("tip", 0.01, 0.0),
    ]
    joints = [
        _joint("shoulder_yaw", "base", "shoulder1", 0, "0 0 1"),
        _joint("shoulder_pitch", "shoulder1", "shoulder2", 0, "0 1 0"),
        _joint("shoulder_roll", "shoulder2", "upper_arm", 0, "1 0 0"),
        _joint("elbow", "upper_arm", "cuff", UPPER_ARM, "0 1 0"),
        _joint("forearm_roll", "cuff", "forearm", 0, "1 0 0"),
        _joint("wrist_pitch", "forearm", "wrist", FOREARM, "0 1 0"),
        _joint("wrist_yaw", "wrist", "hand", 0, "0 0 1"),
        _joint("tip_joint", "hand", "tip", HAND),
    ]
    meshes = {  # (distance along the limb, radius) in m: a forearm is thickest near the elbow
        "sleeve.obj": limb((-0.04, 0.01), (0, 0.058), (0.20, 0.054), (0.34, 0.050), (0.385, 0.02)),
        "cuff.obj": limb((-0.045, 0.02), (0, 0.048), (0.09, 0.047), (0.092, 0.03)),
        "forearm.obj": limb(
            *((0.05, 0.02), (0.07, 0.042), (0.14, 0.042), (0.25, 0.034)),
            *((0.33, 0.027), (0.37, 0.027), (0.385, 0.015)),
        ),
    }
    return ArmSpec(
        urdf='<robot name="human_arm">' + "".join(links + joints) + "</robot>",
        meshes=meshes,
        base=(0.12, 0.0, 0.44),
        home=(0.0, -0.60, 0.0, 1.75, 0.0, 0.42, 0.0),
        down=((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
        effort=(90, 90, 60, 60, 20, 20, 20),
        speed=(2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61),
        reach_links=("hand",),
        colours={n: SLEEVE for n in ("base", "upper_arm", "cuff")}
        | {n: SKIN for n in ("forearm", "wrist", "hand")},
    )


ARMS = {"robot": panda, "human": human}
TIP = {"robot": "panda_grasptarget", "human": "tip"}
