"""Rendered clips of people who move things: what the detector learns from beside drawings.

Not from the paper. A drawing (`lbw_minimal/clips/drawings.py`) is flat; here arm, thing, table and
what stands about have a place in space, their own light, and hide each other as such things do. The
stories are those of the drawings, and so are the rooms behind and the camera's faults.
In: a NumPy generator. Out: clips of 84x84 frames, and the true places of tip and object. Lengths in
metres: x goes right in the picture, y away from the camera, z up.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import cv2
import numpy as np

from lbw_minimal.clips import drawings, drawn_camera
from lbw_minimal.clips import drawn_shapes as draw
from lbw_minimal.clips.drawings import FRAMES, STORIES, Clip
from lbw_minimal.clips.drawn_shapes import SIZE, a_colour
from tasks.world.people import Person
from tasks.world.scene import SUPERSAMPLE, numbers, silent_client

BIG = SUPERSAMPLE * SIZE  # pixels
HIDDEN = 0.3  # of what a clip shows of a thing at most: where less is seen, it is nowhere
UNSEEN = 0.12  # of the stories with an arm: it is between the camera and the thing
# Where shoulders are, from the place that the hand goes to, and how often: to the left, on the
# camera's side, beyond, above.
SHOULDERS = (
    ((-0.75, -0.25, 0.05), (-0.35, 0.25, 0.50)), ((-0.35, -0.60, 0.10), (0.10, -0.35, 0.50)),
    ((-0.40, 0.30, 0.20), (0.20, 0.60, 0.60)), ((-0.45, -0.10, 0.45), (0.20, 0.20, 0.75)),
)  # fmt: skip
FROM = (0.6, 0.13, 0.11, 0.16)
THINGS = {"box": 0.32, "can": 0.22, "ball": 0.1, "mug": 0.14, "two boxes": 0.12, "bottle": 0.1}


class Story(NamedTuple):
    """What happens, before a camera sees it."""

    tip: np.ndarray  # (T, 3) m
    shoulder: np.ndarray  # (T, 3) m
    object: np.ndarray  # (T, 3) m
    half: np.ndarray  # (3,) m, half the object's sizes


class Camera(NamedTuple):
    """PyBullet's view and projection."""

    view: tuple[float, ...]
    projection: tuple[float, ...]

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Where points (T, 3) in m are in the picture, (T, 2)."""
        view, projection = (np.reshape(matrix, (4, 4)) for matrix in self)
        seen = np.column_stack([points, np.ones(len(points))]) @ view @ projection
        return (seen[:, :2] / seen[:, 3:] * (1, -1) + 1) / 2 * SIZE


# What happens


def _story(rng, kind, T):
    """Mostly to the right and back; the camera mirrors half of the clips."""
    half = np.exp(rng.uniform(np.log(0.012), np.log(0.06)) + rng.normal(0, 0.25, 3))
    angle, side = rng.normal(0, 0.25), rng.choice([1, -1], p=[0.75, 0.25])
    if kind == "drawer":
        half, angle = rng.uniform((0.005, 0.05, 0.025), (0.015, 0.14, 0.07)), 0
    ahead = side * np.array([np.cos(angle), np.sin(angle), 0])
    way = ahead * rng.uniform(0.06, 0.3)
    start = (*(rng.normal(0, 0.05, 2) - way[:2] / 2), half[2])
    if kind == "drawer":
        start += np.array([0, -start[1], rng.uniform(0, 0.08)])
    beside = _beside(rng, kind, half, ahead)
    low, high = SHOULDERS[rng.choice(4, p=FROM)]
    if kind != "reach" and rng.random() < UNSEEN:
        beside = np.array([0, -half[1] - rng.uniform(0.005, 0.05), rng.uniform(0, 0.5) * half[2]])
        low, high = SHOULDERS[1]
    arm = beside - rng.uniform(low, high)
    comes = rng.random() < 0.35  # from outside the picture
    before = -arm * rng.uniform(0.6, 1) if comes else rng.normal((-0.1, 0, 0.12), 0.06)
    after = (
        -arm * rng.uniform(0.1, 0.9) if rng.random() < 0.5 else rng.normal((-0.05, 0, 0.1), 0.06)
    )
    time = np.linspace(0, 1, T)[:, None]
    begin, approach, move, retreat = drawings.phases(rng, time)
    slid = move
    if kind == "hit":
        slid = drawings.sliding(rng, begin, time)
        move = move * min(1.0, 0.04 / np.linalg.norm(way))
    bow = rng.uniform(0, 0.8) * (kind == "carry" and rng.random() < 0.5)
    path = start + way * slid + (0, 0, bow) * slid * (1 - slid)
    if kind in ("reach", "nothing"):
        path = path[-1:].repeat(T, 0) if rng.random() < 0.5 else path[:1].repeat(T, 0)
    tip = (path if kind == "carry" else start + way * move) + beside
    tip = np.maximum(tip + before * (1 - approach) + after * retreat, (-9, -9, 0.004))
    lean = 1.0 if comes else rng.uniform(0, 0.4)
    shoulder = start + beside - arm + lean * (tip - start - beside)
    return Story(tip, shoulder, path, half)


def _beside(rng, kind, half, ahead):
    """Where the tip is while it moves the thing, from the thing's middle, (3,) m."""
    if kind in ("push", "hit"):
        return -ahead * (half @ np.abs(ahead)) + (0, 0, half[2] * rng.uniform(-0.8, 0.8))
    if kind == "drawer":  # on its front or on the handle, or behind its edge
        aside, up = rng.uniform((-0.3, -0.3), (0.3, 0.9)) * half[1:]
        return np.array([-half[0] - 0.02, aside, up] if rng.random() < 0.8 else [0.01, 0, half[2]])
    if kind == "reach":
        up = rng.uniform(-0.9, 1) * half[2] + rng.uniform(0, 0.2)
        return np.array([*rng.normal(0, 0.03, 2), up])
    return half * rng.uniform(-1, 1, 3) + (0, 0, half[2])


def _camera(p, rng, story):
    """From the side and from above, near or far; one in ten from anywhere in front."""
    middle = (story.object[0] + story.object[-1]) / 2
    at = middle + (*rng.normal(0, 0.05, 2), rng.uniform(0, 0.15))
    pitch, yaw = -np.exp(rng.uniform(np.log(4), np.log(45))), rng.normal(0, 14)
    if rng.random() < 0.1:
        yaw = rng.uniform(-60, 60)
    lens, wide = rng.uniform(22, 55), np.exp(rng.uniform(np.log(0.4), np.log(1.1)))
    far = wide / 2 / np.tan(np.radians(lens / 2))
    return Camera(
        p.computeViewMatrixFromYawPitchRoll(at.tolist(), far, yaw, pitch, 0, 2),
        p.computeProjectionMatrixFOV(lens, 1, 0.1, far + 8),
    )


# What there is to be seen


def _add(p, kind, colour, at=(0, 0, 0), turned=0.0, **size):
    """A body of one shape; returns its number, its place and its turn, rad about z."""
    look = p.createVisualShape(kind, rgbaColor=(*colour, 1), specularColor=(0, 0, 0), **size)
    return p.createMultiBody(0, -1, look), np.array(at, float), (0, 0, turned)


def _thing(p, rng, half, ground):
    """A thing of these half sizes about its middle, of up to three bodies, see `_add`."""
    colour = a_colour(rng, ground * 255 if rng.random() < 0.3 else None) / 255
    other = a_colour(rng) / 255 if rng.random() < 0.5 else colour
    r, tall = (half[0] + half[1]) / 2, half[2]
    kind = rng.choice(list(THINGS), p=list(THINGS.values()))
    if kind == "ball":
        return [_add(p, p.GEOM_SPHERE, colour, radius=min(r, tall))]
    if kind == "box":
        return [_add(p, p.GEOM_BOX, colour, halfExtents=half.tolist())]
    if kind == "two boxes":
        size = [*half[:2], tall / 2]
        return [_add(p, p.GEOM_BOX, c, (0, 0, z), halfExtents=size)
                for c, z in ((colour, -tall / 2), (other, tall / 2))]  # fmt: skip
    if kind == "bottle":
        return [_add(p, p.GEOM_CYLINDER, colour, (0, 0, -tall / 4), radius=r, length=1.5 * tall),
                _add(p, p.GEOM_CYLINDER, other, (0, 0, 0.75 * tall), radius=0.45 * r,
                     length=tall / 2)]  # fmt: skip
    parts = [_add(p, p.GEOM_CYLINDER, colour, radius=r, length=2 * tall)]
    if kind == "mug":
        a, grip = rng.uniform(0, 2 * np.pi), [0.4 * r, 0.12 * r, 0.6 * tall]
        aside = 1.35 * r * np.array([np.cos(a), np.sin(a), 0])
        parts.append(_add(p, p.GEOM_BOX, colour, aside, a, halfExtents=grip))
        inside = {"radius": 0.85 * r, "length": 0.004}
        parts.append(_add(p, p.GEOM_CYLINDER, other, (0, 0, tall), **inside))
    return parts


def _drawer(p, rng, story, ground):
    """A front, the box behind it and mostly a handle, see `_add`; and what it slides into."""
    thick, wide, tall = story.half
    colour = a_colour(rng, ground * 255 if rng.random() < 0.3 else None) / 255
    other = colour * rng.uniform(0.5, 1) if rng.random() < 0.5 else a_colour(rng) / 255
    deep = np.ptp(story.object[:, 0]) / 2 + rng.uniform(0.01, 0.06)
    parts = [
        _add(p, p.GEOM_BOX, colour, halfExtents=[thick, wide, tall]),
        _add(p, p.GEOM_BOX, 0.8 * colour, (deep, 0, 0),
             halfExtents=[deep, 0.93 * wide, 0.8 * tall]),
    ]  # fmt: skip
    if rng.random() < 0.7:
        out = rng.uniform(0.005, 0.015)
        grip = [out, rng.choice([0.008, wide / 2]), 0.006]
        at = -thick - out, 0, rng.uniform(-0.3, 0.5) * tall
        parts.append(_add(p, p.GEOM_BOX, other, at, halfExtents=grip))
    size = rng.uniform((0.06, 1.03 * wide, 1.05 * tall), (0.25, 1.4 * wide, 2.2 * tall))
    x, up = story.object[:, 0].max() + thick + size[0], story.object[0, 2] - tall
    at = x, 0, max(size[2], up + size[2] * rng.uniform(0.6, 1))
    cabinet, *_ = _add(p, p.GEOM_BOX, other, halfExtents=size.tolist())
    p.resetBasePositionAndOrientation(cabinet, at, (0, 0, 0, 1))
    return parts


def _surroundings(p, rng, ground):
    """A table in seven of ten clips, and things that stand about behind; returns the ground's
    colour."""
    if rng.random() < 0.7:
        ground = a_colour(rng) / 255
        size = [*rng.uniform((0.4, 0.2), (2, 0.8)), 0.02]
        table, *_ = _add(p, p.GEOM_BOX, ground, halfExtents=size)
        at = rng.normal(0, 0.2), rng.uniform(-0.1, 0.3), -0.02
        p.resetBasePositionAndOrientation(table, at, (0, 0, 0, 1))
    for _ in range(rng.integers(0, rng.choice([1, 5]))):
        half = rng.uniform(0.01, 0.08, 3)
        at = np.array([rng.uniform(-0.4, 0.5), rng.uniform(0.08, 0.4), half[2]])
        _put(p, _thing(p, rng, half, ground), at)
    return ground


def _put(p, parts, at):
    for body, off, turned in parts:
        p.resetBasePositionAndOrientation(body, at + off, p.getQuaternionFromEuler(turned))


# The clip


@functools.cache
def _client():
    """One for all clips of a process."""
    return silent_client()


def render_clip(rng: np.random.Generator, T: int = FRAMES, kind: str | None = None) -> Clip:
    """A clip of T frames; `kind`, one of STORIES, is drawn by chance if it is None."""
    kind = kind or str(rng.choice(list(STORIES), p=list(STORIES.values())))
    moves, has_arm = kind not in ("reach", "nothing"), kind not in ("alone", "nothing")
    p = _client()
    p.resetSimulation()
    story = _story(rng, kind, T)
    camera = _camera(p, rng, story)
    tip, path = camera.pixels(story.tip), camera.pixels(story.object)
    flat = drawings.Story(kind, tip, tip, path, np.full(2, 4.0), path[-1])  # for the room alone
    room, ground = drawings.a_room(rng, flat)
    if rng.random() < 0.3:
        room = draw.over(room, drawings.a_mark(rng, flat))
    bystander = drawings.a_bystander(rng, T) if rng.random() < 0.1 else None
    ground = _surroundings(p, rng, ground / 255)
    person = Person(p, rng, ground) if has_arm else None
    thing: list = []
    if kind == "drawer":
        thing = _drawer(p, rng, story, ground)
    elif moves or rng.random() < 0.5:
        thing = _thing(p, rng, story.half, ground)
    shoot = _Shots(rng, camera, person.bodies if person else [], [body for body, *_ in thing])
    pictures, masks = [], []
    for t in range(T):
        _put(p, thing, story.object[t])
        if person:
            person.put(story.tip[t], story.shoulder[t])
        picture, mask = shoot(p, draw.over(room, bystander(t)) if bystander else room)
        pictures.append(picture)
        masks.append(mask * np.array([1, moves], np.uint8))
    seen = np.stack(masks)[..., 1].sum((1, 2), dtype=int)
    shown = (seen > HIDDEN * seen.max()) & moves
    places = np.stack([np.where(has_arm, tip, np.nan), np.where(shown[:, None], path, np.nan)])
    return Clip(*drawn_camera.filmed(rng, pictures, masks, places))


class _Shots:
    """What a camera sees in a light of its own, in front of a picture."""

    def __init__(self, rng, camera, arms, things):
        self.camera, self.arms, self.things = camera, arms, things
        ambient = rng.uniform(0.35, 0.75)
        self.light = {
            "lightDirection": rng.uniform((-1.5, -1.5, 0.3), (1.5, 0.5, 2)).tolist(),
            "shadow": int(rng.random() < 0.5),
            "lightAmbientCoeff": ambient, "lightDiffuseCoeff": 0.98 - ambient,
            "lightSpecularCoeff": 0.0,
        }  # fmt: skip
        self.grain = draw.a_surface(rng, rng.uniform(0, 0.06))

    def __call__(self, p, behind):
        """A picture (84, 84, 3) float32, and how much of it is arm and thing, (84, 84, 2) uint8."""
        _, _, rgba, _, bodies = p.getCameraImage(
            BIG, BIG, *self.camera, renderer=p.ER_TINY_RENDERER, **self.light
        )
        bodies = np.reshape(np.asarray(bodies, np.int32), (BIG, BIG))
        seen = (bodies >= 0)[..., None]
        rgb = numbers(rgba, np.uint8).reshape(BIG, BIG, 4)[..., :3]
        front = _halved(np.where(seen, rgb, 0).astype(np.float32)) * self.grain
        share = _halved(seen.astype(np.float32))[..., None]
        masks = [_halved(255 * np.isin(bodies, some).astype(np.uint8))
                 for some in (self.arms, self.things)]  # fmt: skip
        return behind * (1 - share) + front, np.stack(masks, 2)


def _halved(picture):
    return cv2.resize(picture, (SIZE, SIZE), interpolation=cv2.INTER_AREA)
