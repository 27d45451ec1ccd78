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
        matrix = np.reshape(whole, (4, 4)).T.copy()
        beyond = size - self.left - self.right, self.top + self.bottom - size
        for row, (pixels, off) in enumerate(zip(self.size, beyond, strict=True)):
            matrix[row] = (size * matrix[row] + off * matrix[3]) / pixels
        return tuple(matrix.T.ravel().tolist())


class Shapes:
    """The shapes of a client's bodies, each as the corners (8, 3) in m of a box round it in the
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
                box_round(kind, size, file.decode(), meshes or {}) @ turn(q).T + place
                for _, _, kind, size, file, place, q, *_ in shapes
            ]
            links = [link for _, link, *_ in shapes]
            self.boxes[body] = links, np.reshape(corners, (-1, 8, 3))

    def window(self, sees: np.ndarray, size: int) -> Window | None:
        """The part of a picture of size x size pixels in which the bodies can be; None if they are
        out of sight.

        sees: projection times view matrix, (4, 4). If a body reaches behind the camera, it is all
        of the picture.
        """
        seen = self._seen(sees[[0, 1, 3]])
        ahead = seen[..., 2] > 0
        seen = seen[ahead.any(axis=1)]  # what is wholly behind the camera is out of sight
        if not len(seen):
            return None
        if seen[..., 2].min() <= 0:
            return Window(0, 0, size, size)
        pixels = (seen[..., :2] / seen[..., 2:] * (1, -1) + 1) / 2 * size
        low = np.clip(np.floor(pixels.min(axis=1)) - MARGIN, 0, size)
        high = np.clip(np.ceil(pixels.max(axis=1)) + MARGIN, 0, size)
        inside = (low < high).all(axis=1)
        if not inside.any():
            return None
        ends = np.concatenate([low[inside].min(axis=0), high[inside].max(axis=0)])
        return Window(*ends.astype(int).tolist())

    def _seen(self, rows):
        """Corners of all boxes as the camera sees them, (n, 8, 3): right, up and ahead, which are
        the rows (3, 4) of a matrix."""
        poses = [
            pose
            for body, (links, _) in self.boxes.items()
            for pose in link_frames(body, links, self.client)
        ]
        if not poses:
            return np.empty((0, 8, 3))
        turns = np.reshape([pybullet.getMatrixFromQuaternion(q) for _, q in poses], (-1, 3, 3))
        places = np.array([place for place, _ in poses]) @ rows[:, :3].T + rows[:, 3]
        corners = np.concatenate([corners for _, corners in self.boxes.values()])
        return corners @ (rows[:, :3] @ turns).swapaxes(1, 2) + places[:, None]


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
        low, high = _ends_of_text(meshes[name]) if name in meshes else _ends_of_file(file)
        return ((low + high) / 2 + CORNERS * (high - low) / 2) * size
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
def _ends_of_file(file):
    return _ends(read_mesh(file))


@cache
def _ends_of_text(text):
    return _ends(read_obj(text))


def _ends(triangles):
    return triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
