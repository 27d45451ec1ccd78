"""A page to film oneself with: the camera's picture under the outline of the task's scene.

Out: one HTML file that opens without a server on a laptop or a phone. It asks for the camera, draws
over its picture where arm and object are in the kit's own videos, counts down, records, plays back
and saves. It loads nothing, and no frame leaves the machine.
"""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np

import tasks
from tasks.commands import Parser, make_folder
from tasks.commands.stage_page import ANY_TASK, ORANGE, PAGE, WHAT_TO_DO
from tasks.world import TaskEnv
from tasks.world.scene import SIZE

FINE = 4  # times as many pixels for an outline as for a frame
Outline = list[list[tuple[float, float]]]  # polygons, in pixels of a frame


def parser() -> Parser:
    """The arguments of `stage`."""
    p = Parser("stage", "Write a page to film oneself with, lined up with a task's scene.")
    p.add_task()
    p.add_argument("--out", type=Path, default=Path("runs/stage"), metavar="DIR", help="its folder")
    return p


def main(argv: list[str]) -> None:
    """Write the page. Raises InputError for a mistake in the arguments."""
    args = parser().read(argv)
    make_folder(args.out)
    path = args.out / f"{args.task}.html"
    path.write_text(page(args.task), encoding="utf-8")
    print(f"stage: {path}")


def page(task: str) -> str:
    """The page of a task as HTML."""
    env = tasks.bare(task, embodiment="human", observation="state")
    env.reset(seed=0)
    drawn, touched = outlines(env), env.scene().contact is not None
    target, start = (env.world.pixel(x) for x in (env.target_position(), env.object_position()))
    if touched:
        x, y = target - start
        drawn["goal"] = [[(a + x, b + y) for a, b in polygon] for polygon in drawn["object"]]
    env.close()
    paths = (f'<path class="{name}" d="{_path(polygons)}"/>' for name, polygons in drawn.items())
    return (
        PAGE.replace("{task}", task)
        .replace("{what}", WHAT_TO_DO.get(task, ANY_TASK[touched]))
        .replace("{orange}", ORANGE["goal" in drawn])
        .replace("{size}", str(SIZE))
        .replace("{outlines}", "\n".join(paths))
        .replace("{name}", json.dumps(f"{task}-clip"))
    )


def outlines(env: TaskEnv) -> dict[str, Outline]:
    """Where "scene", "arm" and "object" are in the camera's picture now."""
    world = env.world
    world.show_scenery(True)
    size = FINE * SIZE
    *_, seen = world.p.getCameraImage(
        size, size, world.view, world.projection, renderer=world.p.ER_TINY_RENDERER
    )
    world.show_scenery(False)
    seen = np.asarray(seen).reshape(size, size)
    # What the task is about is seen where it says to be; in reach that is the arm: take the ball.
    place = env.object_position()
    if np.allclose(place, env.arm.tip_pose()[0]):
        place = env.target_position()
    x, y = np.round(FINE * world.pixel(place)).astype(int)
    # of the scenery what is only painted, as coffee's wall, is no help
    solid = [body for body in world.scenery if world.p.getCollisionShapeData(body, -1)]
    named = {"scene": solid, "arm": [env.arm.body], "object": [seen[y, x]]}
    return {name: _contours(np.isin(seen, bodies)) for name, bodies in named.items()}


def _contours(mask: np.ndarray) -> Outline:
    """The edges of a mask's pieces as polygons in pixels of a frame, specks left out."""
    found, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    large = [c for c in found if cv2.contourArea(c) > FINE**2]
    smooth = [cv2.approxPolyDP(c, 0.25 * FINE, True)[:, 0] for c in large]
    return [[(float(x) / FINE, float(y) / FINE) for x, y in c] for c in smooth]


def _path(polygons: Outline) -> str:
    """Polygons in SVG's words."""
    return " ".join(
        "M" + "L".join(f"{x:g} {y:g}" for x, y in polygon) + "Z" for polygon in polygons
    )
