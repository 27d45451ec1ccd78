"""Triangles of mesh files, and the normals with which round surfaces look round, edges sharp."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np

CREASE = np.cos(np.radians(40))  # faces that meet at less than this angle are one round surface


def normals(corners: np.ndarray) -> np.ndarray:
    """Unit normals (F, 3, 3) at triangles' corners: the mean of faces that meet there smoothly."""
    # (F, 3), length 2 x area
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit = face / np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-30)
    # Files repeat a vertex for every face, so equal places make a corner, not equal indices.
    size = max(np.ptp(corners.reshape(-1, 3), axis=0).max(), 1e-30)
    _, corner = np.unique(np.round(corners.reshape(-1, 3) / size, 5), axis=0, return_inverse=True)
    corner = corner.reshape(-1, 3)
    out = np.empty_like(corners)
    order = np.argsort(corner, axis=None)
    for group in np.split(order, np.cumsum(np.bincount(corner.ravel()))[:-1]):
        f = group // 3  # the faces that meet in this corner
        smooth = unit[f] @ unit[f].T > CREASE  # (n, n)
        out.reshape(-1, 3)[group] = smooth @ face[f]
    length = np.linalg.norm(out, axis=-1, keepdims=True)
    return np.where(length > 1e-30, out / np.maximum(length, 1e-30), unit[:, None])


def read_mesh(path: Path | str) -> np.ndarray:
    """Triangles (F, 3, 3) of a Wavefront OBJ or binary STL file. Raises ValueError for others."""
    path = Path(path)
    if path.suffix.lower() == ".stl":
        # an 80-byte title, the count, then 50 bytes a triangle
        data = np.fromfile(path, np.uint8)[80:]
        count = data[:4].view("<u4")[0] if len(data) >= 4 else -1
        if len(data) != 4 + 50 * int(count):
            raise ValueError(f"{path.name}: not a binary STL file; export it as one.")
        return data[4:].reshape(-1, 50)[:, 12:48].copy().view("<f4").reshape(-1, 3, 3).astype(float)
    if path.suffix.lower() != ".obj":
        raise ValueError(f"{path.name}: the viewer reads OBJ and binary STL meshes; convert it.")
    return read_obj(path.read_text(encoding="utf-8", errors="replace"))


def read_obj(text: str) -> np.ndarray:
    """Triangles (F, 3, 3) of a Wavefront OBJ file's text."""
    vertices, faces = [], []
    for line in text.splitlines():
        kind, *rest = line.split() or [""]
        if kind == "v":
            vertices.append([float(x) for x in rest[:3]])
        elif kind == "f":
            # Indices start at 1; negative ones count back from the last vertex so far.
            ids = [int(x.split("/")[0]) for x in rest]
            ids = [i - 1 if i > 0 else len(vertices) + i for i in ids]
            faces += [(ids[0], b, c) for b, c in pairwise(ids[1:])]
    return np.array(vertices)[np.array(faces)]
