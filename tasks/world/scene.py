"""The scene: table, wall, camera, light, and the shapes from which a task is built.

The camera looks from the side along y: x goes right in the image, z up. Lengths in metres. What
never moves is rendered once, with its depth; a frame renders what moves and puts it in front of
that.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import struct
import sys
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import cv2
import numpy as np


def _flush_c() -> None:
    """C holds a printed line back when stdout is a file; where it cannot be asked for it, it stays.

    Its library is found among what this process has loaded, on Windows by its name.
    """
    with contextlib.suppress(OSError, TypeError, AttributeError):
        ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None).fflush(None)


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """PyBullet prints a line from C when it is imported, and one for every client."""
    sys.stdout.flush()
    keep, null = (os.dup(1), os.dup(2)), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    try:
        yield
    finally:
        _flush_c()
        for stream, copy in enumerate(keep, start=1):
            os.dup2(copy, stream)
            os.close(copy)
        os.close(null)


with _silence():
    import pybullet
    from pybullet_utils.bullet_client import BulletClient

    from tasks.world.windows import Shapes, Window

SIZE = 84  # pixels, both sides of every frame
# The renderer does not smooth edges. Averaging lets a frame show motion below a pixel.
SUPERSAMPLE = 2
WHOLE = Window(0, 0, SIZE * SUPERSAMPLE, SIZE * SUPERSAMPLE)
DT = 1 / 250  # s, one simulation step
SUBSTEPS = 10  # simulation steps per control step
FPS = 25  # control steps and frames per second, as in Fetch: 1 / (DT * SUBSTEPS)
TABLE_FRICTION = 1.0  # Bullet multiplies it by the object's own
# m, half the thickness of gripper and fingers: a tip that pushes a thing stands this far behind it.
FINGER = 0.012

CAMERA_PITCH, CAMERA_FOV = -12.0, 25.0  # degrees

RED, GREEN = (0.78, 0.12, 0.10, 1), (0.15, 0.60, 0.25, 1)
# Middle tones: a tanh decoder saturates on white, and translation swaps wall and table when their
# tones are extreme.
LOOKS = {
    "robot": {
        "wall": (0.56, 0.60, 0.64, 1),
        "table": (0.36, 0.38, 0.42, 1),
        "light": (0.3, -1.0, 1.6),
    },
    "human": {
        "wall": (0.68, 0.63, 0.54, 1),
        "table": (0.50, 0.36, 0.25, 1),
        "light": (-0.5, -1.0, 1.4),
    },
}


Colour = tuple[float, ...]  # red, green, blue, opacity, 0 to 1
Vector = Sequence[float] | np.ndarray  # (3,)


def numbers(image: np.ndarray | tuple, kind: type[np.uint8 | np.float32]) -> np.ndarray:
    """An image as the camera gives it, as an array of bytes or floats; flat if it was a tuple.

    A PyBullet that was built without NumPy gives tuples. np.asarray asks each number for its type,
    which takes six times as long as packing all of them at once.
    """
    if isinstance(image, tuple):
        if kind is np.uint8:
            return np.frombuffer(bytearray(image), kind)
        image = np.frombuffer(struct.Struct(f"{len(image)}f").pack(*image), kind)
    return np.asarray(image, kind)


class Part(NamedTuple):
    """A part of a body that has several, placed relative to the body."""

    kind: str  # "box", "cylinder" or "sphere"
    size: Vector  # m: half extents, (radius, height), or (radius,)
    place: Vector  # m
    colour: Colour
    mass: float  # kg
    solid: bool = True  # whether it can be touched


def silent_client() -> BulletClient:
    """A simulator of its own, without a window. PyBullet's greeting is kept from stdout."""
    with _silence():
        return BulletClient(connection_mode=pybullet.DIRECT)


class World:
    """One PyBullet client with wall and table, its camera, and the shapes tasks are built from.

    camera: the point it looks at, in m, and its distance from there.
    """

    def __init__(self, embodiment: str, camera: tuple[tuple[float, float, float], float]):
        self.p = silent_client()
        self.client = self.p._client  # PyBullet's number for it
        self.shapes = Shapes(self.client)  # of what moves
        self.scenery: list[int] = []
        look = LOOKS[embodiment]
        self.p.setGravity(0, 0, -9.81)
        self.p.setPhysicsEngineParameter(fixedTimeStep=DT, deterministicOverlappingPairs=1)
        self.table = self.box((0.80, 0.30, 0.02), (0.80, 0, -0.02), look["table"])
        self.p.changeDynamics(self.table, -1, lateralFriction=TABLE_FRICTION)
        self.view = self.p.computeViewMatrixFromYawPitchRoll(
            *camera, yaw=0, pitch=CAMERA_PITCH, roll=0, upAxisIndex=2
        )
        self.projection = self.p.computeProjectionMatrixFOV(CAMERA_FOV, 1.0, 0.3, 3.0)
        self.light = look["light"]
        size = SIZE * SUPERSAMPLE
        shade = np.linspace(1.06, 0.94, size)[:, None, None]  # lighter near the ceiling
        self.backdrop = np.uint8(np.broadcast_to(shade * look["wall"][:3] * 255, (size, size, 3)))
        self.depth = np.full((size, size), 0.999, np.float32)  # 1 is where nothing is

    def paint(self) -> None:
        """Take what stands now as scenery: it is rendered here, with its depth, and never again."""
        self.scenery = [self.p.getBodyUniqueId(i) for i in range(self.p.getNumBodies())]
        self.shapes.boxes.clear()
        self.backdrop, self.depth = self._composite(WHOLE)
        self.show_scenery(False)

    def show_scenery(self, visible: bool) -> None:
        """Show the scenery to a reader of the scene, like the 3-D viewer, or hide it again."""
        for body in self.scenery:
            rgba = (*self.p.getVisualShapeData(body)[0][7][:3], float(visible))
            self.p.changeVisualShape(body, -1, rgbaColor=rgba)

    def box(
        self, half: Vector, position: Vector, rgba: Colour, mass: float = 0.0, solid: bool = True
    ) -> int:
        """Add a box of half extents `half`. Mass 0 (kg) fixes it; if not solid, it is not felt."""
        return self._body(Part("box", half, position, rgba, mass, solid))

    def cylinder(
        self, radius: float, height: float, position: Vector, rgba: Colour, mass: float = 0.0,
        solid: bool = True,
    ) -> int:  # fmt: skip
        """Add an upright cylinder."""
        return self._body(Part("cylinder", (radius, height), position, rgba, mass, solid))

    def sphere(
        self, radius: float, position: Vector, rgba: Colour, mass: float = 0.0, solid: bool = True
    ) -> int:
        """Add a ball."""
        return self._body(Part("sphere", (radius,), position, rgba, mass, solid))

    def _body(self, part):
        visual, collision = self._shapes(part)
        return self._added(self.p.createMultiBody(part.mass, collision, visual, part.place))

    def fixed(self, parts: list[Part], position: Vector) -> int:
        """Add one free body: the first part, with the others fixed to it."""
        first, *rest = parts
        visual, collision = self._shapes(first)
        places = [np.subtract(part.place, first.place) for part in rest]
        links = self._links(rest, places, [0] * len(rest), [self.p.JOINT_FIXED] * len(rest))
        position = np.add(position, first.place)
        return self._added(self.p.createMultiBody(first.mass, collision, visual, position, **links))

    def sliding(self, parts: list[Part], position: Vector, axis: Vector) -> int:
        """Add a body of fixed parts that slides along `axis` on a rail, its joint 0."""
        first, *rest = parts
        places = [first.place, *(np.subtract(part.place, first.place) for part in rest)]
        joints = [self.p.JOINT_PRISMATIC] + [self.p.JOINT_FIXED] * len(rest)
        links = self._links(parts, places, [0] + [1] * len(rest), joints, axis)
        return self._added(self.p.createMultiBody(0, -1, -1, position, **links))

    def _links(self, parts, places, parents, joints, axis=(0, 0, 1)):
        """The parts as links, in the words of `createMultiBody`; parent 0 is the base, 1 link 0."""
        shapes, n = [self._shapes(part) for part in parts], len(parts)
        return {
            "linkMasses": [part.mass for part in parts],
            "linkVisualShapeIndices": [visual for visual, _ in shapes],
            "linkCollisionShapeIndices": [collision for _, collision in shapes],
            "linkPositions": places,
            "linkOrientations": [(0, 0, 0, 1)] * n,
            "linkInertialFramePositions": [(0, 0, 0)] * n,
            "linkInertialFrameOrientations": [(0, 0, 0, 1)] * n,
            "linkParentIndices": parents,
            "linkJointTypes": joints,
            "linkJointAxis": [axis] * n,
        }

    def _shapes(self, part):
        """Numbers of the visual and the collision shape; -1 is none."""
        p, size = self.p, part.size
        kind, look, touch = {
            "box": (p.GEOM_BOX, {"halfExtents": size}, {"halfExtents": size}),
            "cylinder": (
                p.GEOM_CYLINDER,
                {"radius": size[0], "length": size[-1]},
                {"radius": size[0], "height": size[-1]},
            ),
            "sphere": (p.GEOM_SPHERE, {"radius": size[0]}, {"radius": size[0]}),
        }[part.kind]
        visual = p.createVisualShape(kind, rgbaColor=part.colour, specularColor=(0, 0, 0), **look)
        return visual, p.createCollisionShape(kind, **touch) if part.solid else -1

    def _added(self, body):
        # Bullet's default damping of 0.04, of a body and all its links, would brake a sliding
        # object on top of friction.
        self.p.changeDynamics(body, -1, linearDamping=0, angularDamping=0)
        self.shapes.add(body)
        return body

    def take_apart(self) -> None:
        """Put everything that moves freely where it touches nothing."""
        for i in range(self.p.getNumBodies()):
            body = self.p.getBodyUniqueId(i)
            if self.p.getDynamicsInfo(body, -1)[0] > 0:  # neither scenery nor an arm nor a rail
                self.p.resetBasePositionAndOrientation(body, (0, 10 + i, 10), (0, 0, 0, 1))

    def render(self) -> np.ndarray:
        """The camera's picture, (84, 84, 3) uint8 RGB."""
        picture, _ = self._composite(self._window())
        return cv2.resize(picture, (SIZE, SIZE), interpolation=cv2.INTER_AREA)

    def _window(self):
        """Where what moves can be seen: anywhere, if not all of it was added here."""
        if self.p.getNumBodies() != len(self.scenery) + len(self.shapes.boxes):
            return WHOLE
        return self.shapes.window(self._sees(), WHOLE.right)

    def _composite(self, window):
        """What moves over the backdrop, and its depth, both SUPERSAMPLE times the final size; no
        more than a window of it is rendered, or nothing."""
        picture, depth = self.backdrop.copy(), self.depth.copy()
        if window is None:
            return picture, depth
        width, height = window.size
        # Its segments are not needed, but PyBullet fills what it is told to leave out with whatever
        # its memory holds: large numbers, dear to make where it lacks NumPy.
        _, _, rgba, near, _ = self.p.getCameraImage(
            width, height, self.view, window.projection(self.projection, WHOLE.right),
            lightDirection=self.light, shadow=0,
            lightAmbientCoeff=0.65, lightDiffuseCoeff=0.35, lightSpecularCoeff=0.0,
            renderer=self.p.ER_TINY_RENDERER,
        )  # fmt: skip
        there = slice(window.top, window.bottom), slice(window.left, window.right)
        near = numbers(near, np.float32).reshape(height, width)
        seen = (near < depth[there]).view(np.uint8)
        rgb = cv2.cvtColor(numbers(rgba, np.uint8).reshape(height, width, 4), cv2.COLOR_RGBA2RGB)
        for new, old in ((rgb, picture), (near, depth)):  # NumPy's own way takes 40 times as long
            cv2.copyTo(new, seen, old[there])
        return picture, depth

    def _sees(self):
        """From metres to the picture, (4, 4): projection times view."""
        projection, view = np.reshape((self.projection, self.view), (2, 4, 4)).swapaxes(1, 2)
        return projection @ view

    def position(self, body: int) -> np.ndarray:
        """Centre of a body, (3,) in m."""
        return np.array(self.p.getBasePositionAndOrientation(body)[0])

    def pixel(self, point: Vector) -> np.ndarray:
        """Where a world point (m) appears in the image: (x right, y down) in pixels."""
        clip = self._sees() @ np.append(point, 1.0)
        return (clip[:2] / clip[3] * (1, -1) + 1) / 2 * SIZE
