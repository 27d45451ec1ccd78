"""Where in the camera's picture bodies can be seen, so that no more of it is rendered.

In: the shapes of bodies, once, and their poses, each frame. Out: the rectangle of the picture
outside of which none of them is seen. An arm and what it pushes need about half of the picture, and
a PyBullet that was built without NumPy makes six Python numbers of each pixel that it renders.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from typing import NamedTuple

import numpy as np
import pybullet

from tasks.world.meshes import read_mesh, read_obj

MARGIN = 1  # pixels: the renderer rounds a corner as it likes
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])  # of a box
# Numbers of the corners at which each of its edges begins, (12,), and of those at which it ends.
STARTS, ENDS = np.array([(i, j) for j in range(8) for i in range(j) if i ^ j in (1, 2, 4)]).T
# Radians by which a box round a mesh is turned: none comes first, and wins where it is no worse.
ANGLES = np.radians(sorted(range(-45, 46, 5), key=abs))

Pose = tuple[tuple[float, ...], tuple[float, ...]]  # position in m and quaternion (x, y, z, w)


class Window(NamedTuple):
    """A rectangle of a picture, in pixels; `right` and `bottom` are the first ones beyond it."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.right - self.left, self.bottom - self.top

    def projection(self, whole: Sequence[float], size: int) -> tuple[float, ...]:
        """The projection matrix that fills a picture with this window of what `whole` shows on size
        x size pixels; both (16,), column by column."""
        matrix = list(whole)
        beyond = size - self.left - self.right, self.top + self.bottom - size
        for row, (pixels, off) in enumerate(zip(self.size, beyond, strict=True)):
            pairs = zip(matrix[row::4], matrix[3::4], strict=True)
            matrix[row::4] = [(size * one + off * ahead) / pixels for one, ahead in pairs]
        return tuple(matrix)


class Shapes:
    """The shapes of a client's bodies, each as the corners (3, 8) in m of a box round it in the
    frame of its link."""

    def __init__(self, client: int):
        self.client = client  # PyBullet's number for it
        self.boxes: dict[int, tuple[list[int], np.ndarray]] = {}  # by body: links, corners

    def add(self, body: int, meshes: dict[str, str] | None = None) -> None:
        """Learn a body's shapes. meshes: name and text of the OBJ files that are gone by now.

        One with a shape of which `box_round` does not know the box stays unknown.
        """
        shapes = pybullet.getVisualShapeData(body, physicsClientId=self.client)
        with suppress(OSError, ValueError):
            corners = [
                (box_round(kind, size, file.decode(), meshes or {}) @ turn(q).T + place).T
                for _, _, kind, size, file, place, q, *_ in shapes
            ]
            links = [link for _, link, *_ in shapes]
            self.boxes[body] = links, np.reshape(corners, (-1, 3, 8))

    def window(self, sees: np.ndarray, size: int) -> Window | None:
        """The part of a picture of size x size pixels in which the bodies can be; None if they are
        out of sight.

        sees: projection times view matrix, (4, 4). If a body reaches behind the camera, it is all
        of the picture.
        """
        seen = self._seen(sees[[0, 1, 3]])
        seen = seen[:, seen[2].max(axis=1) > 0]  # what is wholly behind the camera is out of sight
        if not seen.size:
            return None
        if seen[2].min() <= 0:
            return Window(0, 0, size, size)
        x, y = seen[:2] / seen[2]
        low, high = ends_inside(np.array([1 + x, 1 - y]) / 2 * size, size)
        low = np.clip(np.floor(low) - MARGIN, 0, size)
        high = np.clip(np.ceil(high) + MARGIN, 0, size)
        inside = (low < high).all(axis=0)
        if not inside.any():
            return None
        ends = np.concatenate([low[:, inside].min(axis=1), high[:, inside].max(axis=1)])
        return Window(*ends.astype(int).tolist())

    def _seen(self, rows):
        """Corners of all boxes as the camera sees them, (3, n, 8): right, up and ahead, which are
        the rows (3, 4) of a matrix."""
        poses = [
            pose
            for body, (links, _) in self.boxes.items()
            for pose in link_frames(body, links, self.client)
        ]
        if not poses:
            return np.empty((3, 0, 8))
        turns = np.array([pybullet.getMatrixFromQuaternion(q) for _, q in poses])
        places = np.array([place for place, _ in poses]) @ rows[:, :3].T + rows[:, 3]
        corners = np.concatenate([corners for _, corners in self.boxes.values()])
        return (rows[:, :3] @ turns.reshape(-1, 3, 3) @ corners + places[..., None]).swapaxes(0, 1)


def ends_inside(pixels: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """How far boxes reach in a picture of size x size pixels, without what of them is more than
    MARGIN beyond its edges: the lowest x and y of each, (2, n), and the highest; NaN where nothing
    is left.

    pixels: x and y of their corners, (2, n, 8). For x a box is cut at the picture's upper and
    lower edge, for y at its left and right one.
    """
    start = pixels.take(STARTS, axis=2)
    way = pixels.take(ENDS, axis=2) - start  # (2, n, 12)
    edges = np.reshape((-MARGIN, size + MARGIN), (2, 1, 1, 1))
    with np.errstate(divide="ignore", invalid="ignore"):  # some run along the picture's edges
        parts = (edges - start[::-1]) / way[::-1]  # of the way, (2, 2, n, 12)
    parts = np.clip(parts, 0, 1)  # where it comes in and where it leaves, or none
    places = np.where(parts[0] == parts[1], np.nan, start + parts * way)
    return np.fmin.reduce(places, axis=(0, 3)), np.fmax.reduce(places, axis=(0, 3))


def turn(quaternion: Sequence[float] | np.ndarray) -> np.ndarray:
    """Rotation matrix (3, 3) of a quaternion (x, y, z, w)."""
    return np.reshape(pybullet.getMatrixFromQuaternion(quaternion), (3, 3))


def link_frames(body: int, links: Sequence[int], client: int) -> list[Pose]:
    """The poses of links' URDF frames, in which their visual frames are given; the base is -1."""
    joined = [link for link in links if link >= 0]
    states = pybullet.getLinkStates(  # one call: it asks the body for all of its state
        body, joined, computeForwardKinematics=True, physicsClientId=client
    )
    poses = iter(state[4:6] for state in states)
    return [next(poses) if link >= 0 else base_frame(body, client) for link in links]


def base_frame(body: int, client: int) -> Pose:
    """The pose of a base's URDF frame."""
    mass = pybullet.getBasePositionAndOrientation(body, client)
    inertial = pybullet.getDynamicsInfo(body, -1, client)[3:5]
    return pybullet.multiplyTransforms(*mass, *pybullet.invertTransform(*inertial))


def box_round(kind: int, size: Sequence[float], file: str, meshes: dict[str, str]) -> np.ndarray:
    """Corners (8, 3) in m of the box round a shape of `getVisualShapeData`.

    Raises ValueError for other kinds than boxes, balls, cylinders, capsules and meshes, and for
    meshes that are neither OBJ nor binary STL; OSError for a file that is gone.
    """
    if kind == pybullet.GEOM_MESH:
        name = file.rpartition("/")[2]
        return (_least_of_text(meshes[name]) if name in meshes else _least_of_file(file)) * size
    half = {
        pybullet.GEOM_BOX: np.array(size) / 2,
        pybullet.GEOM_SPHERE: np.full(3, size[0]),
        pybullet.GEOM_CYLINDER: np.array([size[1], size[1], size[0] / 2]),
        pybullet.GEOM_CAPSULE: np.array([size[1], size[1], size[0] / 2 + size[1]]),
    }.get(kind)
    if half is None:
        raise ValueError(f"what a shape of PyBullet's type {kind} covers is not known here.")
    return CORNERS * half


@cache
def _least_of_file(file):
    return _least_box(read_mesh(file))


@cache
def _least_of_text(text):
    return _least_box(read_obj(text))


def _least_box(triangles):
    """Corners (8, 3) of the box of least surface, of which least is seen, among those turned about
    one axis after the other, 5 degrees at a time."""
    points, best = np.unique(triangles.reshape(-1, 3), axis=0), np.eye(3)
    for axis in np.eye(3):
        turns = [best @ turn(pybullet.getQuaternionFromAxisAngle(axis, a)) for a in ANGLES]
        best = min(turns, key=lambda turned: round(_surface(np.ptp(points @ turned, axis=0)), 12))
    low, high = (points @ best).min(axis=0), (points @ best).max(axis=0)
    return ((low + high) / 2 + CORNERS * (high - low) / 2) @ best.T


def _surface(sides):
    return sides @ np.roll(sides, 1)
