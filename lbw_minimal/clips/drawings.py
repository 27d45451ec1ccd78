"""Drawings of an arm that moves a thing, in front of anything, for the detector to learn from.

Not from the paper. No two clips share their room, light, person, hand, tool, thing or way, so all
that a detector can rely on is what they have in common: an arm reaches into the picture, its tip
touches something, and that moves. Nothing is copied from a real video, and nothing has to look
real: breadth is what counts.
In: a NumPy generator. Out: clips of 84x84 frames, and the true places of tip and object.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np

from lbw_minimal.clips import drawn_camera
from lbw_minimal.clips import drawn_shapes as draw
from lbw_minimal.clips.drawn_shapes import ROUND, SIZE, THINGS, a_colour, a_surface

FRAMES = 12  # of a clip: enough for a median that does without most of the arm
HIDDEN = 0.2  # a thing of which less than this share is seen is nowhere
# Stories and how often they are told. In the last three something is missing, and the detector has
# to say so. In "alone" a thing moves that nobody touches.
STORIES = {
    "push": 0.32, "carry": 0.16, "hit": 0.12, "drawer": 0.13,
    "reach": 0.19, "alone": 0.04, "nothing": 0.04,
}  # fmt: skip
# s at most: rest, approach, rest, move, rest, retreat, rest
PHASES = np.array([0.25, 0.8, 0.25, 1.4, 0.4, 0.7, 0.3])
# Some rests are long: the camera runs before anything happens and after all is over, and a hand
# waits for a word or stays where it has pushed. At this chance for each rest, four clips in ten
# have a long one.
LONG, LONG_REST = 0.18, (1, 8)  # s
Draw = Callable[[int], np.ndarray]  # a frame's number -> a layer


class Clip(NamedTuple):
    """A drawn clip; places in pixels from the left and the upper edge, nan where none is seen."""

    frames: np.ndarray  # (T, 84, 84, 3) uint8
    tip: np.ndarray  # (T, 2) float32
    object: np.ndarray  # (T, 2) float32
    # How much of each cell, 2 x 2 pixels, is arm and how much is object, in 0-255.
    masks: np.ndarray  # (T, 42, 42, 2) uint8


class Story(NamedTuple):
    """What happens, before a camera sees it; places in pixels."""

    kind: str
    tip: np.ndarray  # (T, 2)
    shoulder: np.ndarray  # (T, 2)
    object: np.ndarray  # (T, 2)
    half: np.ndarray  # (2,), half the object's width and height
    closed: np.ndarray  # (2,), where a drawer's front is when it is closed


# What happens


def _ease(t):
    t = np.clip(t, 0, 1)
    return t**3 * (10 - 15 * t + 6 * t**2)  # minimum jerk, as a hand moves


def _story(rng, kind, T):
    """Arms come from the left, from above and from below; the camera mirrors half of the clips.

    From the left they come as high as the table, too, and may then lie before what they move.
    """
    half = np.exp(rng.uniform(np.log(1.3), np.log(7.5)) + rng.normal(0, 0.25, 2))
    if kind == "drawer":
        half = rng.uniform((1, 2), (8, 12))
    angle = rng.normal(0, 0.2) if rng.random() < 0.75 else rng.uniform(-np.pi, np.pi)
    ahead = draw.turned(np.array([rng.choice([1, -1], p=[0.75, 0.25]), 0]), angle)
    way = ahead * rng.uniform(7, 45)
    low, high = np.maximum(10, 10 - way), np.minimum(SIZE - 6, SIZE - 6 - way)
    start = rng.uniform(np.minimum(low, high), np.maximum(low, high))
    if rng.random() < 0.7:  # a table is in the lower half of the picture
        start[1] = max(start[1], rng.uniform(40, 74))
    if kind in ("push", "hit"):
        beside = -ahead * (half @ np.abs(ahead)) + (0, half[1] * rng.uniform(-0.8, 0.5))
    else:
        beside = half * rng.uniform(-1.1, 1.1, 2)
    low, high = (((-45, -35), (5, 75)), ((-10, -70), (SIZE, -8)), ((-20, 92), (104, 150)))[
        rng.choice(3, p=[0.55, 0.33, 0.12])
    ]
    shoulder = rng.uniform(low, high)
    arm = start + beside - shoulder
    comes = rng.random() < 0.3  # from outside the picture
    before = -arm * rng.uniform(0.6, 1.0) if comes else rng.normal((-8, -16), 9)
    after = -arm * rng.uniform(0.1, 0.9) if rng.random() < 0.5 else rng.normal((-5, -12), 8)
    time = np.linspace(0, 1, T)[:, None]
    begin, approach, move, retreat = phases(rng, time)
    slid = move
    if kind == "hit":
        slid = sliding(rng, begin, time)
        move = move * min(1.0, 4 / np.linalg.norm(way))
    bow = rng.uniform(0, 100) * (kind == "carry" and rng.random() < 0.3)  # lifted, put down again
    object_ = start + way * slid - np.array([0, bow]) * slid * (1 - slid)
    held = object_ + beside if kind == "carry" else start + beside + way * move
    tip = held + before * (1 - approach) + after * retreat
    lean = 1.0 if comes else rng.uniform(0, 0.4)
    shoulder = shoulder + lean * (tip - start - beside)
    return Story(kind, tip, shoulder, object_, half, start + way * (way[0] > 0))


def phases(rng: np.random.Generator, time: np.ndarray) -> tuple[np.ndarray, ...]:
    """When the move begins, and how far approach, move and retreat are at each time, all 0 to 1."""
    seconds = PHASES * rng.uniform(0, 1, 7) + (0, 0.1, 0, 0.3, 0, 0.1, 0)
    rests = [0, 2, 4, 6]
    if rng.random() < 0.25:
        seconds[:2] = 1e-3  # the clip begins with the touch
        rests.remove(0)
    if rng.random() < 0.6:
        seconds[5:] = 1e-3  # and ends with it
        rests.remove(6)
    for i in rests:
        if rng.random() < LONG:
            seconds[i] = np.exp(rng.uniform(*np.log(LONG_REST)))
    ends = np.cumsum(seconds) / seconds.sum()
    begins = ends - seconds / seconds.sum()
    steps = (_ease((time - begins[i]) / (ends[i] - begins[i])) for i in (1, 3, 5))
    return begins[3], *steps


def sliding(rng: np.random.Generator, begin: np.ndarray, time: np.ndarray) -> np.ndarray:
    """How far what is hit at `begin` has slid at each time, all 0 to 1: slower and slower, and then
    it rests."""
    slides = (1 - begin) * rng.uniform(0.1, 1)
    return 1 - (1 - np.clip((time - begin) / slides, 0, 1)) ** 2


# What there is to be seen


def a_room(rng: np.random.Generator, story: Story) -> tuple[np.ndarray, np.ndarray]:
    """What stands still, (84, 84, 3) float32, and its colour (3,) where the object begins."""
    layer = draw.empty() + np.array([*a_colour(rng), 255]).astype(np.uint8)
    _clutter(rng, layer, rng.integers(0, rng.choice([7, 25], p=[0.8, 0.2])), (0, 0), (SIZE, 50))
    picture = layer[..., :3] * a_surface(rng, _strength(rng))
    if rng.random() < 0.85:
        foot = story.object[:, 1].min() + story.half[1]
        top = foot - rng.uniform(0, 12) if rng.random() < 0.75 else rng.uniform(-30, foot - 10)
        left, right = rng.uniform(-50, 15), rng.uniform(SIZE - 15, SIZE + 50)
        bottom, wide, tilt = top + rng.uniform(12, 90), rng.uniform(0, 25), rng.normal(0, 3)
        corners = [(left, top - tilt), (right, top + tilt), (right + wide, bottom),
                   (left - wide, bottom)]  # fmt: skip
        layer = draw.empty() + np.array([*a_colour(rng), 255]).astype(np.uint8)
        _clutter(rng, layer, rng.integers(0, 4), (0, np.clip(top, 0, SIZE)), (SIZE, SIZE))
        wood = layer[..., :3] * a_surface(rng, _strength(rng))
        table = draw.empty()
        draw.polygon(table, np.array(corners), np.zeros(3))
        share = table[..., 3:] / np.float32(255)
        picture = picture * (1 - share) + wood * share
    x, y = np.clip(story.object[0], 0, SIZE - 1).astype(int)
    return picture, picture[y, x]


def _strength(rng):
    """Of a surface's pattern: most are plain; tiles, bricks, wallpaper, hedges, rugs are not."""
    return rng.uniform(0, 0.07) if rng.random() < 0.7 else rng.uniform(0.07, 0.3)


def _clutter(rng, layer, count, low, high):
    """Things that stand about, some of them much like the one that will move, and long edges."""
    for _ in range(count):
        at, colour, chance = rng.uniform(low, high), a_colour(rng), rng.random()
        if chance < 0.4:
            half, colours = rng.uniform(1.5, 9, 2), (colour, a_colour(rng))
            draw.thing(layer, rng.choice(THINGS), at, half, colours, rng.normal(0, 0.3))
        elif chance < 0.7:
            draw.thing(layer, "front", at, rng.uniform((3, 3), (35, 25)), (colour, colour))
        else:
            r = rng.uniform(0.4, 2)
            draw.stick(layer, at, at + rng.normal(0, 40, 2), r, r, colour)


def _object(rng, story, ground) -> Draw:
    """The object; in a third of the clips it is hard to tell from the ground behind it."""
    colour = a_colour(rng, ground if rng.random() < 0.35 else None)
    colours = (colour, colour if rng.random() < 0.5 else a_colour(rng, colour))
    kind = rng.choice(THINGS)
    if story.kind == "drawer":
        kind = rng.choice(["front", "door"], p=[0.7, 0.3])
    reach, thick = rng.uniform(0, 6) * (rng.random() < 0.6), rng.uniform(0.5, 2)  # of a handle
    turn, spin = rng.normal(0, 0.15), rng.normal(0, 0.03) * (kind == "flat")
    tall, hinge = story.half * (0, 1), story.closed + rng.uniform((4, -4), (25, 4))

    def drawn(t):
        layer, at = draw.empty(), story.object[t]
        if kind == "door":  # seen from the side, it gets narrower as it closes
            draw.polygon(
                layer, np.stack([hinge - tall, at - tall, at + tall, hinge + tall]), colour
            )
            draw.thing(layer, "front", at, story.half * (0.3, 0.5), colours[::-1])
        elif kind == "front":
            h = 0.8 * tall
            closed = story.closed
            draw.polygon(layer, np.stack([at - h, closed - h, closed + h, at + h]), colour * 0.6)
            if reach:
                knob = at - (story.half[0] + reach, 0)
                draw.stick(layer, at, knob, thick, thick, colours[1])
            draw.thing(layer, "front", at, story.half, colours)
        else:
            draw.thing(layer, kind, at, story.half, colours, turn + spin * t)
        return layer

    return drawn


def _cabinet(rng, story, ground):
    """What a drawer slides into."""
    layer, wide, tall = draw.empty(), rng.uniform(4, 30), rng.uniform(1.05, 3)
    half = np.array([wide, story.half[1] * tall])
    colour = a_colour(rng, ground if rng.random() < 0.3 else None)
    at = story.closed + half * (1, rng.uniform(-0.4, 0.4))
    draw.thing(layer, "front", at, half, (colour, colour * 0.95))
    return layer


def a_mark(rng: np.random.Generator, story: Story) -> np.ndarray:
    """A layer with the spot where the object has to get to."""
    layer, r = draw.empty(), rng.uniform(2, 7)
    at = story.object[-1] + rng.normal(0, 2, 2) + (0, story.half[1])
    draw.polygon(layer, at + ROUND * (r, r * rng.uniform(0.2, 1)), a_colour(rng))
    return layer


def a_bystander(rng: np.random.Generator, T: int) -> Draw:
    """Something that moves and has nothing to do with the arm, or somebody: a person behind."""
    at, swing, pace = rng.uniform(0, SIZE, 2), rng.normal(0, 20, 2), rng.uniform(2, 12)
    if rng.random() < 0.4:
        somebody = draw.Person(rng, 60)
        shoulder, swing = at + rng.normal(0, 30, 2), swing / 2

        def stands(t):
            return somebody.draw(at + swing * np.sin(pace * t / T), shoulder, t / T)

        return stands
    kind, half, colours = rng.choice(THINGS), rng.uniform(1.5, 6, 2), (a_colour(rng), a_colour(rng))

    def drawn(t):
        layer = draw.empty()
        draw.thing(layer, kind, at + swing * np.sin(pace * t / T), half, colours)
        return layer

    return drawn


# The clip


def draw_clip(rng: np.random.Generator, T: int = FRAMES, kind: str | None = None) -> Clip:
    """A clip of T frames; `kind`, one of STORIES, is drawn by chance if it is None."""
    kind = kind or str(rng.choice(list(STORIES), p=list(STORIES.values())))
    moves, has_arm = kind not in ("reach", "nothing"), kind not in ("alone", "nothing")
    story = _story(rng, kind, T)
    if not moves:
        # What is reached for stands where the hand gets to as often as where it comes by.
        still = story.object[-1:] if rng.random() < 0.5 else story.object[:1]
        story = story._replace(object=still.repeat(T, 0))
    room, ground = a_room(rng, story)
    if rng.random() < 0.35:
        room = draw.over(room, a_mark(rng, story))
    if kind == "drawer":
        room = draw.over(room, _cabinet(rng, story, ground))
    object_ = _object(rng, story, ground) if moves or rng.random() < 0.5 else None
    bystander = a_bystander(rng, T) if rng.random() < 0.12 else None
    reach = np.linalg.norm(story.tip - story.shoulder, axis=1).max()
    person = draw.Person(rng, reach) if has_arm else None
    if person and rng.random() < 0.15:  # a sleeve that is hard to tell from the room
        person.cloth = a_colour(rng, ground)
    exposure = rng.uniform(0, 0.25) * (rng.random() < 0.4)  # of the time from frame to frame
    in_front, shade = rng.random() < 0.5, rng.uniform(0, 0.5) * (rng.random() < 0.6)
    fall, soft = rng.normal((0, 8), 12), rng.uniform(0.5, 5)
    pictures, masks, whole = [], [], []
    for t in range(T):
        picture = draw.over(room, bystander(t)) if bystander else room
        limb = person.draw(story.tip[t], story.shoulder[t], t / T) if person else draw.empty()
        thing = object_(t) if object_ else draw.empty()
        if exposure and 0 < t < T - 1:
            limb, thing = (
                draw.smeared(layer, exposure * (path[t + 1] - path[t - 1]) / 2)
                for layer, path in ((limb, story.tip), (thing, story.object))
            )
        picture = picture * _lit(np.maximum(limb, thing), shade, fall, soft)
        for layer in (limb, thing) if in_front else (thing, limb):
            picture = draw.over(picture, layer)
        pictures.append(picture)
        unhidden = thing[..., 3] * (in_front | (limb[..., 3] < 128)) * moves
        masks.append(np.stack([limb[..., 3], unhidden], 2))
        whole.append(thing[..., 3].sum(dtype=int))
    seen = np.stack(masks)[..., 1].sum((1, 2), dtype=int)
    # Of what this frame could show, since a drawer gets shorter as it closes.
    shown = seen > HIDDEN * np.array(whole)
    places = np.stack([np.where(has_arm, story.tip, np.nan),
                       np.where(shown[:, None], story.object, np.nan)])  # fmt: skip
    return Clip(*drawn_camera.filmed(rng, pictures, masks, places))


def _lit(layer, shade, fall, soft):
    """The light (84, 84, 1) that a layer leaves behind it, at most 1."""
    if not shade:
        return 1
    move = np.array([[1, 0, fall[0]], [0, 1, fall[1]]], np.float32)
    dark = cv2.GaussianBlur(cv2.warpAffine(layer[..., 3], move, (SIZE, SIZE)), (0, 0), soft)
    return 1 - np.float32(shade / 255) * dark[..., None]
