"""What happens in painted clips of strangers, and what it looks like, for `strangers.py`."""

import cv2
import numpy as np

from tests import strange_rooms as paint
from tests.strange_cameras import MARGIN, ease


def phases(rng, rate, hit):
    """Approach, move and retreat, 0 to 1, in each of T frames, and the seconds of the move."""
    rest, near, wait = rng.uniform(0.1, 0.5), rng.uniform(0.6, 1.2), rng.uniform(0, 0.25)
    move, stay = rng.uniform(0.7, 1.7), rng.uniform(0.25, 0.7)
    if hit:
        wait, move, stay = 0.05, rng.uniform(0.25, 0.4), rng.uniform(1.2, 1.6)
    away = rng.uniform(0.5, 0.9) if rng.random() < 0.4 and not hit else 0.0
    ends = np.cumsum([rest, near, wait, move, stay, away, 0.2])
    t = np.arange(round(ends[-1] * rate)) / rate
    retreat = ease((t - ends[4]) / away) if away else 0 * t
    return ease((t - rest) / near), ease((t - ends[2]) / move), retreat, t - ends[2], move


def painted(rng, task, kind, h, w, rate):
    """Pictures (T, h, w, 3) uint8, and the paths (T, 2) of tip and object in their pixels."""
    near, move, back, since, lasts = phases(rng, rate, task == "slide")
    u = min(h, w) / MARGIN  # pixels, the shorter side of what the camera sees
    middle, d = np.array([w, h]) / 2, rng.choice([-1, 1])  # the side to which it goes
    way = d * u * rng.uniform(0.32, 0.5)
    half = u * rng.uniform((0.045, 0.05), (0.085, 0.1))
    table = middle[1] + u * rng.uniform(0.1, 0.28)
    at = np.array([middle[0] - way / 2 + u * rng.uniform(-0.06, 0.06), table - half[1]])
    share = move.copy()
    touch = -d * (half[0] * (0.4 if task == "drawer" else 1.0) + 0.012 * u)
    tip = np.array([at[0] + touch, at[1] + rng.uniform(-0.2, 0.6) * half[1]]) + np.zeros(
        (len(move), 2)
    )
    thing = at + np.zeros((len(move), 2))
    if task == "slide":  # the hand follows for a moment, and the puck goes on alone
        half = half * (1, 0.5)
        thing[:, 1] = table - half[1]
        tip[:, 1] = table - rng.uniform(0.3, 1.2) * half[1]
        follow = 0.3
        gone = np.clip((since - 0.5 * lasts) / 0.9, 0, 1)
        share = np.maximum(follow * move, follow * 0.5 + (1 - follow * 0.5) * (1 - (1 - gone) ** 2))
        share[since < 0.5 * lasts] = follow * move[since < 0.5 * lasts]
        tip[:, 0] += follow * way * move
    elif task == "reach":
        rise = u * rng.uniform(0.05, 0.2)
        tip = at + [[0, -rise]] + np.stack([way * ease(near), rise * 0.6 * near], 1)
        thing = np.repeat(tip[-1:] + (d * 0.05 * u, 0), len(move), 0)
        share, move, near = 0 * move, 0 * move, 0 * near + 1
    else:
        tip[:, 0] += way * move
    thing = thing + np.stack([way * share, 0 * share], 1)
    tip, thing = _spoilt(rng, task, kind, tip, thing, u, way, move)
    before = u * np.array([-d * rng.uniform(0.15, 0.5), -rng.uniform(0.1, 0.35)])
    after = u * np.array([-d * rng.uniform(0.1, 0.3), -rng.uniform(0.05, 0.25)])
    tip = tip + (1 - near[:, None]) * before + back[:, None] * after
    return _pictures(rng, task, kind, (h, w), (tip, thing, half, u, d, way, table)), tip, thing


def _spoilt(rng, task, kind, tip, thing, u, way, move):
    """Paths with what makes the clip one of its kind."""
    if kind in ("never moves", "still"):
        hover = np.array([0, -rng.uniform(0.0, 0.12) * u])
        thing = np.repeat(thing[:1], len(thing), 0)
        if abs(tip[-1] - tip[0]).max() > 0:  # it goes over the thing, or stops short of it
            tip = tip + np.where(rng.random() < 0.5, 1, 0) * (hover - (0, 0.2 * u))
            tip = tip[:1] + (tip - tip[:1]) * rng.choice([0.0, 0.8])
    elif kind == "pulled":  # from beyond the thing, back towards the arm
        end = thing[-1] - thing[0]
        thing = thing + end - 2 * (thing - thing[:1])
        tip = thing + np.array([np.sign(way) * 0.09 * u, 0])
    elif kind == "lifted":
        bow = 4 * (move * (1 - move))[:, None] * (0, -rng.uniform(0.7, 1.0) * abs(way))
        tip, thing = tip + bow, thing + bow
    elif kind == "steep":  # across becomes up; a hand that reaches comes down, or it would not be
        lean = 0.9 * np.sign(way) * (1 if task == "reach" else -1)  # in the picture at first
        up = np.array([[0.25, 0], [lean, 1]])
        tip, thing = ((p - thing[0]) @ up.T + thing[0] + (0, 0.1 * u) for p in (tip, thing))
    return tip, thing


def _pictures(rng, task, kind, size, told):
    """The painted pictures (T, h, w, 3) uint8 of a story."""
    (h, w), (tip, thing, half, u, d, way, table) = size, told
    room = paint.table(rng, paint.wall(rng, h, w), table)
    person, seed = paint.Person(rng), int(rng.integers(1000))
    colours = [paint.tone(rng, 30, 225, 50) for _ in range(2)]
    name = {"drawer": "front", "slide": "puck"}.get(task) or str(rng.choice(paint.THINGS))
    name = "mug" if task == "coffee" else name
    shoulder = np.array([w / 2 - d * w / MARGIN * rng.uniform(0.62, 0.75),
                         h / 2 + u * rng.uniform(-0.55, 0.1)])  # fmt: skip
    room = _furniture(rng, task, room, (thing, half, d, u, table))
    other = paint.Person(rng) if kind == "two people" else None
    lamp = rng.uniform(0.1, 0.9) * w if rng.random() < 0.12 and kind != "still" else None
    swing, shade = rng.uniform(5, 20), rng.uniform(0.1, 0.45)
    hides = kind == "hidden"
    alone, frames = kind in ("no arm", "still"), []
    for t in range(len(tip)):
        layer, shadow = paint.empty(h, w), paint.empty(h, w)
        foot = paint.ellipse(thing[t] + (0, half[1]), 1.2 * half[0], 0.25 * half[1])
        if task != "reach":
            paint.poly(shadow, foot, (0, 0, 0))
            _thing(task, name, layer, thing[t], half, colours, (d, way, thing[0], seed))
        if not alone:
            limb = paint.empty(h, w)
            at = tip[t] + (0.3 * d * u, 0) * np.array(hides)
            person.draw(limb, at, shoulder + 0.3 * (tip[t] - tip[-1]), u)
            if hides:
                before = thing[t] + (1.5 * d * half[0], 0)
                paint.stick(limb, shoulder, before, 0.1 * u, 2.2 * half.max(), person.cloth)
            dark = cv2.GaussianBlur(np.roll(limb[1], round(0.05 * u), 0), (0, 0), 0.03 * u)
            room_t, used = room.copy(), paint.part(dark)
            room_t[used] *= 1 - shade * dark[used][..., None]
        else:
            room_t, limb = room, None
        soft = cv2.GaussianBlur(shadow[1], (0, 0), 0.02 * u)
        picture, used = room_t.copy(), paint.part(soft)
        picture[used] *= 1 - 0.5 * soft[used][..., None]
        picture = paint.over(picture, layer)
        picture = paint.over(picture, limb) if limb is not None else picture
        if other is not None:
            second = paint.empty(h, w)
            there = (tip[t] - tip.mean(0)) * (-0.9, 0.5) + (w / 2 + d * 0.32 * u, table - 0.12 * u)
            other.draw(second, there, (w - shoulder[0], shoulder[1]), u)
            picture = paint.over(picture, second)
        if lamp is not None:
            hangs = paint.empty(h, w)
            bob = lamp + 0.05 * u * np.sin(swing * t / len(tip)), 0.22 * h
            paint.poly(hangs, paint.ellipse(bob, 0.05 * u, 0.05 * u), (225, 215, 150))
            picture = paint.over(picture, hangs)
        frames.append(np.clip(picture, 0, 255).astype(np.uint8))
    return np.stack(frames)


def _furniture(rng, task, room, told):
    """The room with what stands at the end of the way."""
    thing, half, d, u, table = told
    layer, ink = paint.empty(*room.shape[:2]), paint.tone(rng, 30, 200, 25)
    end = thing[-1]
    if task == "coffee":
        x = end[0] + d * (half[0] + 0.06 * u)
        a, b = sorted((x, x + d * 0.22 * u))
        paint.poly(layer, paint.rectangle(a, table - 0.5 * u, b, table), ink)
        a, b = sorted((end[0] - d * 0.05 * u, x))
        paint.poly(layer, paint.rectangle(a, table - 0.5 * u, b, table - 0.36 * u), ink)
    elif task == "drawer":
        x = end[0] + d * 0.3 * half[0]
        a, b = sorted((x, x + d * 0.4 * u))
        paint.poly(layer, paint.rectangle(a, end[1] - 2.2 * half[1], b, table + 0.01 * u), ink)
    elif task == "reach":
        paint.poly(layer, paint.ellipse(end, 0.04 * u, 0.04 * u), paint.tone(rng, colour=60))
    elif rng.random() < 0.5:
        mark = paint.ellipse((end[0], table), 1.3 * half[0], 0.02 * u)
        paint.poly(layer, mark, paint.tone(rng, colour=60))
    return paint.over(room, layer)


def _thing(task, name, layer, at, half, colours, told):
    d, way, start, seed = told
    if task == "drawer":  # the box behind the front goes into the cabinet
        end = start[0] + way
        a, b = sorted((at[0], end + d * 0.3 * half[0]))
        paint.poly(layer, paint.rectangle(a, at[1] - 0.7 * half[1], b, at[1] + 0.8 * half[1]),
                   0.6 * colours[0])  # fmt: skip
        half = half * (d, 1)
    paint.thing(name, layer, at, half, colours, seed)
