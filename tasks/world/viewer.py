"""The meshcat mirror of a PyBullet scene, recorded to one HTML page without a server, port or
process.

In: a client and the poses its links pass through. Out: a page in which the scene plays and turns
with the mouse. A link's frame is animated; its shapes hang below it where the URDF puts them, so
the browser computes
    world <- link (URDF frame, animated) <- visual frame (fixed) <- drawing (fixed, e.g. y up to z
    up)
Traps: the pose of a base is its centre of mass, not its frame; meshcat's cylinders lie along y,
Bullet's along z; meshcat has no capsule.
"""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import meshcat
import numpy as np
import pybullet as p
import umsgpack
from meshcat import geometry as g
from meshcat.animation import Animation, AnimationClip, AnimationTrack

from lbw_minimal.training import write_atomic
from tasks.world.env import TaskEnv
from tasks.world.meshes import normals, read_mesh, read_obj
from tasks.world.scene import Vector, World
from tasks.world.windows import link_frames, turn

# m, from the side, like the environments' camera
EYE, TARGET = (0.5, -1.2, 0.45), (0.42, 0.0, 0.22)
# degrees, from bottom to top: the whole arm, where the environments' camera frames the skill
FOV = 46
# Width by height of the narrowest picture that shows the arm from its base on at that angle. On a
# screen that is narrower, as a phone's, the angle is as much larger.
NARROWEST = 1.2
# turned by 90 degrees about x
Y_TO_Z = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ margin: 0 }} #scene {{ width: 100vw; height: 100vh; overflow: hidden }}
#paper {{ display: none; max-width: 100%; max-height: 95vh; margin: auto }}
@media print {{ #scene {{ height: 0; visibility: hidden }} #paper {{ display: block }} }}
</style>
</head>
<body>
<div id="scene"></div>
<canvas id="paper" role="img" aria-label="{title}"></canvas>
<script>
/* meshcat: Copyright (c) 2018 Robin Deits, MIT License. With it: */
{notices}
{meshcat}
</script>
<script>
const pane = document.getElementById("scene"), viewer = new MeshCat.Viewer(pane);
for (const command of {commands})
  viewer.handle_command_bytearray(Uint8Array.from(atob(command), c => c.charCodeAt(0)));
const fit = () => {{
  const more = Math.max(1, {narrowest} * innerHeight / innerWidth), half = {fov} * Math.PI / 360;
  viewer.camera.fov = 360 / Math.PI * Math.atan(more * Math.tan(half));
  viewer.set_dirty();
}};
addEventListener("resize", fit);
fit();
viewer.camera.position.set({eye});
viewer.controls.target.set({target});
viewer.controls.maxPolarAngle = Math.PI / 2;  // from below one sees the table only
viewer.controls.update();
addEventListener("beforeprint", () => {{  // a picture drawn by the graphics card is blank on paper
  const paper = document.getElementById("paper"), seen = viewer.renderer.domElement;
  [paper.width, paper.height] = [seen.width, seen.height];
  viewer.render();
  paper.getContext("2d").drawImage(seen, 0, 0);
}});
if (window !== top) {{  // in another page the wheel scrolls that page, until one clicks here
  viewer.controls.enableZoom = false;
  pane.addEventListener("pointerdown", () => viewer.controls.enableZoom = true);
  pane.addEventListener("mouseleave", () => viewer.controls.enableZoom = false);
}}
</script>
</body>
</html>
"""


class Mesh(g.Geometry):
    """Triangles (F, 3, 3) in m, drawn with round surfaces round and edges sharp."""

    def __init__(self, corners: np.ndarray):
        super().__init__()
        self.corners = corners

    def lower(self, object_data: Any) -> dict[str, Any]:
        arrays = {"position": self.corners, "normal": normals(self.corners)}
        attributes = {
            k: g.pack_numpy_array(a.reshape(-1, 3).T.astype(np.float32)) for k, a in arrays.items()
        }
        return {"uuid": self.uuid, "type": "BufferGeometry", "data": {"attributes": attributes}}


def transform(position: Vector, quaternion: Vector) -> np.ndarray:
    """4x4 matrix of a position in m and a quaternion (x, y, z, w)."""
    T = np.eye(4)
    T[:3, :3] = turn(quaternion)
    T[:3, 3] = position
    return T


def drawing(
    kind: int, size: Sequence[float], file: str, meshes: dict[str, str]
) -> list[tuple[g.Geometry, np.ndarray]]:
    """What draws a visual shape of `getVisualShapeData`: geometries and their 4x4 places in it."""
    at, name = np.eye(4), Path(file).name
    if kind == p.GEOM_BOX:
        return [(g.Box([*size]), at)]  # full lengths
    if kind == p.GEOM_SPHERE:
        return [(g.Sphere(size[0]), at)]
    if kind == p.GEOM_CYLINDER:
        return [(g.Cylinder(size[0], size[1]), Y_TO_Z)]
    if kind == p.GEOM_CAPSULE:
        ends = [
            (g.Sphere(size[1]), transform((0, 0, z), (0, 0, 0, 1)))
            for z in (-size[0] / 2, size[0] / 2)
        ]
        return [(g.Cylinder(size[0], size[1]), Y_TO_Z), *ends]
    if kind == p.GEOM_MESH:
        corners = read_obj(meshes[name]) if name in meshes else read_mesh(file)
        return [(Mesh(corners * size), at)]
    raise ValueError(
        f"the viewer cannot draw a shape of PyBullet's type {kind}; use boxes, balls and meshes."
    )


# JupyterLab shows every picture of an output, whatever a weaker rule says.
STILL = """@media not print { .still { display: none !important } }
@media print { iframe { display: none } }"""


class Recorder:
    """Records the bodies of a PyBullet client for the browser: all of them, or those listed by id.

    Shapes and colours are read now, poses at every `snap`. meshes: name and text of the OBJ files
    that are gone by now. Raises ValueError for a shape it cannot draw.
    """

    def __init__(
        self,
        client: int,
        bodies: Iterable[int] | None = None,
        meshes: dict[str, str] | None = None,
    ):
        self.client, self.eye, self.target = client, EYE, TARGET  # m: where one looks from, and at
        self.world: World | None = (
            None  # of a task's environment, whose scenery is shown for a picture only
        )
        # an array (L, 7) each: position in m and quaternion (x, y, z, w) of every link
        self.frames: list[np.ndarray] = []
        self.shapes = []  # (link's row, geometry, 4x4 place in the link's frame, rgba)
        self.links: list[
            tuple[int, int]
        ] = []  # (body, link) with something to draw; the base is link -1
        if bodies is None:
            bodies = [p.getBodyUniqueId(i, client) for i in range(p.getNumBodies(client))]
        for body in bodies:
            for _, link, kind, size, file, position, quaternion, rgba, *_ in p.getVisualShapeData(
                body, physicsClientId=client
            ):
                if (body, link) not in self.links:
                    self.links.append((body, link))
                row, visual = self.links.index((body, link)), transform(position, quaternion)
                for geometry, at in drawing(kind, size, file.decode(), meshes or {}):
                    self.shapes.append((row, geometry, visual @ at, rgba))

    def snap(self) -> None:
        """Append the current pose of every link as one frame of the animation."""
        poses = [
            np.concatenate(pose)
            for body, of_it in groupby(self.links, key=itemgetter(0))
            for pose in link_frames(body, [link for _, link in of_it], self.client)
        ]
        self.frames.append(np.array(poses))

    def html(self, title: str, fps: float = 25) -> str:
        """A page that needs nothing else: the recorded frames, `fps` a second, over and over.

        Without a `snap` the scene stands as it is now.
        """
        if not self.frames:
            self.snap()
        tape: list[Any] = []
        scene = meshcat.Visualizer(window=SimpleNamespace(send=tape.append))
        scene["/Grid"].set_property("visible", False)  # it would lie in the table's top
        scene["/Axes"].set_property("visible", False)
        scene["/Background"].set_property("top_color", [0.93, 0.94, 0.96])
        scene["/Background"].set_property("bottom_color", [0.80, 0.82, 0.85])
        for i, (row, geometry, at, rgba) in enumerate(self.shapes):
            r, green, b = (round(255 * c) for c in rgba[:3])
            mesh = g.Mesh(
                geometry, g.MeshPhongMaterial(color=r << 16 | green << 8 | b, opacity=rgba[3])
            )
            # Ids of meshcat's own making carry the computer's network address.
            mesh.uuid, geometry.uuid, mesh.material.uuid = (
                f"{part}{i}" for part in ("mesh", "shape", "paint")
            )
            node = scene["/".join(map(str, self.links[row]))][f"shape{i}"]
            node.set_object(mesh)
            node.set_transform(at)
        poses = np.stack(self.frames)  # (T, L, 7)
        animation = Animation()
        times = [*range(len(poses)), len(poses) - 1 + fps]  # a second's rest before it starts over
        for row, link in enumerate(self.links):
            node = scene["/".join(map(str, link))]
            node.set_transform(transform(poses[0, row, :3], poses[0, row, 3:]))
            if np.ptp(poses[:, row], axis=0).any():
                path = [*poses[:, row].tolist(), poses[-1, row].tolist()]
                tracks = {
                    "position": AnimationTrack("position", "vector3", times, [x[:3] for x in path]),
                    "quaternion": AnimationTrack(
                        "quaternion", "quaternion", times, [x[3:] for x in path]
                    ),
                }
                animation.clips[node.path] = AnimationClip(tracks, fps)
        if animation.clips:
            scene.set_animation(animation, repetitions=float("inf"))
        dist = Path(meshcat.__file__).parent / "viewer" / "dist"
        return PAGE.format(
            title=html.escape(title),
            notices=(dist / "main.min.js.LICENSE.txt").read_text(encoding="utf-8"),
            meshcat=(dist / "main.min.js").read_text(encoding="utf-8"),
            commands=[base64.b64encode(pack(c)).decode() for c in tape],
            fov=FOV,
            narrowest=NARROWEST,
            eye=y_up(self.eye),
            target=y_up(self.target),
        )

    def picture(self) -> bytes:
        """The scene as it is now, seen as the page shows it first: a PNG of 640 x 360 pixels."""
        size = 640, 360
        view = p.computeViewMatrix(self.eye, self.target, (0, 0, 1))
        lens = p.computeProjectionMatrixFOV(FOV, size[0] / size[1], 0.1, 5.0)
        if self.world:
            self.world.show_scenery(True)
        options = {"renderer": p.ER_TINY_RENDERER, "physicsClientId": self.client}
        rgba = p.getCameraImage(*size, view, lens, lightDirection=(0.3, -1, 1.6), **options)[2]
        if self.world:
            self.world.show_scenery(False)
        # OpenCV writes blue first
        rgb = np.reshape(np.uint8(rgba), (size[1], size[0], 4))[..., 2::-1]
        return cv2.imencode(".png", rgb)[1].tobytes()

    def _repr_html_(self) -> str:
        """In a notebook a recorder that is a cell's value shows itself, in a frame of its own.

        On paper, and in viewers that strip scripts, a picture stands in for it.
        """
        page, style = html.escape(self.html("scene")), "width: 100%; height: 420px; border: 0"
        scene = f'<iframe title="the scene, to turn" srcdoc="{page}" style="{style}"></iframe>'
        if not p.isConnected(self.client):
            return scene
        png = f"data:image/png;base64,{base64.b64encode(self.picture()).decode()}"
        still = f'<img class="still" alt="the scene, as it is at the end" src="{png}">'
        return f"<style>{STILL}</style>{scene}{still}"

    def save(self, path: Path | str, title: str = "PyBullet scene", **options: float) -> None:
        """Write `html(title, **options)` to a file, whole or not at all."""
        write_atomic(path, self.html(title, **options))


def mirror(env: TaskEnv) -> Recorder:
    """A recorder of a task's environment with its scenery: the camera's view, and the arm."""
    env.world.show_scenery(True)
    recorder = Recorder(env.world.client, meshes=env.arm.spec.meshes)
    recorder.world = env.world
    env.world.show_scenery(False)
    wider = env.CAMERA[1] / TaskEnv.CAMERA[1]
    aside = np.array([env.CAMERA[0][0] - TaskEnv.CAMERA[0][0], 0, 0])
    recorder.eye = np.array(EYE) * (1, wider, wider) + aside
    recorder.target = np.array(TARGET) + aside
    return recorder


def pack(command: Any) -> bytes:
    """A meshcat command as its viewer expects it; four bytes a number: 0.1 micrometre at 1 m."""
    return umsgpack.packb(command.lower(), force_float_precision="single")


def y_up(point: Sequence[float]) -> str:
    """A point in m for the camera, whose y axis points up where ours is z: x, z, -y as
    JavaScript."""
    x, y, z = point
    return f"{float(x)}, {float(z)}, {float(-y)}"
