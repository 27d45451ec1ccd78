"""People whose arms reach into a scene: a body of its own for each limb, posed by hand.

Not from the paper. The kit's simulated human is always the same one; these differ in build, skin,
clothes, hand and tool, and the detector of `lbw_minimal/clips/detector.py` learns from them. They
obey no physics: what is told is where the tip is, and where the shoulder.
Lengths in metres; colours (3,) in 0-1.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lbw_minimal.clips.drawn_shapes import HANDS, a_colour, a_skin

if TYPE_CHECKING:
    from pybullet_utils.bullet_client import BulletClient

SIDES = 12  # of a limb's cross section
# How much of an arm a sleeve leaves bare, from the wrist, in lengths of the forearm, and how often.
BARE = (0, 0.4, 1, 1.6, 2)
HOW_BARE = (0.4, 0.15, 0.25, 0.1, 0.1)
TOOLS = 0.15  # of the people hold a stick, a pen, a ruler
STRETCHED = 0.98  # of both bones' length: as far as an arm reaches


class Surface(NamedTuple):
    """A closed surface."""

    points: np.ndarray  # (N, 3)
    normals: np.ndarray  # (N, 3)
    corners: np.ndarray  # (M,) which points are the triangles', three each


def limb(length: float, start: float, end: float, flat: float = 1.0) -> Surface:
    """A round-ended limb along x from 0 to length; radii at start and end.

    flat: how thick it is along z beside y.
    """
    round_, narrow = np.array([1, 0.92, 0.6]), np.array([0.01, 0.4, 0.8])
    x = [*(-start * round_), *np.linspace(0, length, 5), *(length + end * round_[::-1])]
    r = np.array([*(start * narrow), *np.linspace(start, end, 5), *(end * narrow[::-1])])
    turn = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
    ring = np.stack([np.zeros(SIDES), np.cos(turn), flat * np.sin(turn)], 1)
    points = np.concatenate([(at, 0, 0) + wide * ring for at, wide in zip(x, r, strict=True)])
    slope = np.gradient(r, x).repeat(SIDES)
    normals = np.tile(ring * (1, 1, 1 / flat**2), (len(x), 1)) - slope[:, None] * (1, 0, 0)
    a = np.arange((len(x) - 1) * SIDES).reshape(-1, SIDES)
    b = np.roll(a, -1, 1)
    corners = np.stack([a, b, b + SIDES, a, b + SIDES, a + SIDES], 2)  # seen from outside
    return Surface(points, normals / np.linalg.norm(normals, axis=1)[:, None], corners.ravel())


def joined(parts: list[Surface]) -> Surface:
    """Several surfaces as one."""
    first = np.cumsum([0, *(len(part.points) for part in parts[:-1])])
    corners = [part.corners + n for part, n in zip(parts, first, strict=True)]
    points, normals = (np.concatenate([part[i] for part in parts]) for i in (0, 1))
    return Surface(points, normals, np.concatenate(corners))


def hand(kind: str, length: float) -> Surface:
    """One of the drawn `HANDS` in three dimensions: along x from the wrist, -length, to the tip."""
    sticks = []
    for u, v, u_end, v_end, r, r_end in HANDS[kind]:
        a, b = length * np.array([u, v, 0]), length * np.array([u_end, v_end, 0])
        stick = limb(float(np.linalg.norm(b - a)), length * r, length * r_end, 0.75)
        x = (b - a) / np.linalg.norm(b - a)
        turned = np.stack([x, (-x[1], x[0], 0), (0, 0, 1)])
        sticks.append(Surface(stick.points @ turned + a, stick.normals @ turned, stick.corners))
    return joined(sticks)


def facing(ahead: np.ndarray, roll: float = 0.0) -> tuple[float, ...]:
    """The rotation (x, y, z, w) that turns x to `ahead` (3,), after `roll` rad about x."""
    x, y, z = ahead / np.linalg.norm(ahead)
    half = np.sqrt((1 + x) / 2)
    # About y and z; straight back there are many turns, of which this is one.
    b, c, w = (-z / (2 * half), y / (2 * half), half) if half > 1e-6 else (0, 1, 0)
    sine, cosine = np.sin(roll / 2), np.cos(roll / 2)
    q = np.array([w * sine, b * cosine + c * sine, c * cosine - b * sine, w * cosine])
    return tuple(q / np.linalg.norm(q))


class Person:
    """An arm, a hand and perhaps a tool of somebody; ground: a colour that a sleeve may have."""

    def __init__(self, client: BulletClient, rng: np.random.Generator, ground: np.ndarray):
        self.p, build = client, rng.uniform(0.8, 1.3)
        skin = a_skin(rng) / 255
        cloth = a_colour(rng, ground * 255 if rng.random() < 0.15 else None) / 255
        bare = rng.choice(BARE, p=HOW_BARE)
        self.upper, self.fore, self.hand = rng.uniform((0.24, 0.22, 0.12), (0.36, 0.34, 0.20))
        self.swivel, self.down = rng.normal(0, 0.7), rng.uniform(0, 0.9)
        self.roll = rng.uniform(-np.pi, np.pi)
        thick = build * rng.uniform((0.045, 0.036, 0.022), (0.060, 0.048, 0.032))
        loose = rng.uniform(1, 1.3)  # of a sleeve
        kind = rng.choice(list(HANDS))
        glove = rng.random() < 0.1
        self.limbs = [  # from shoulder to elbow, elbow to wrist, wrist to tip
            self._body(limb(self.upper, *(thick[:2] * loose)), skin if bare == 2 else cloth),
            self._body(limb(self.fore, *(thick[1:] * (1 if bare else loose))),
                       skin if bare else cloth),
            self._body(hand(kind, self.hand), a_colour(rng) / 255 if glove else skin),
        ]  # fmt: skip
        if 0 < bare < 1:
            cuff = limb(self.fore * (1 - bare), *(thick[1:] * loose * (1.05, 1.2)))
            self.limbs.append(self._body(cuff, cloth))
        self.tool, self.held = 0.0, 0.1  # m: how much of a tool sticks out, and how much is held
        if rng.random() < TOOLS:
            self.tool, r = rng.uniform(0.05, 0.2), np.exp(rng.uniform(np.log(0.003), np.log(0.014)))
            stick = limb(self.tool + self.held, r, r * rng.uniform(0.5, 1.5), rng.choice([1, 0.3]))
            self.stick = self._body(stick, a_colour(rng) / 255)

    @property
    def bodies(self) -> list[int]:
        """PyBullet's numbers of all that is drawn of the person."""
        return [*self.limbs, *([self.stick] if self.tool else [])]

    def _body(self, surface, colour):
        look = self.p.createVisualShape(
            self.p.GEOM_MESH, vertices=_lent("points", surface.points),
            normals=_lent("normals", surface.normals), indices=_lent("corners", surface.corners),
            rgbaColor=(*colour, 1), specularColor=(0, 0, 0),
        )  # fmt: skip
        return self.p.createMultiBody(0, -1, look)

    def put(self, tip: np.ndarray, shoulder: np.ndarray) -> None:
        """Put the tip, of the tool if there is one, and the shoulder there, (3,) each.

        A shoulder that is too far away comes nearer.
        """
        to = (tip - shoulder) / np.linalg.norm(tip - shoulder)
        ahead = (1 - self.down) * to + (0, 0, -self.down)
        ahead /= np.linalg.norm(ahead)
        end = tip
        if self.tool:
            along = ahead + 0.5 * (ahead - to)
            along /= np.linalg.norm(along)
            end = tip - self.tool * along
            self._put(self.stick, end - self.held * along, along)
        wrist = end - self.hand * ahead
        reach = np.linalg.norm(wrist - shoulder)
        out = (wrist - shoulder) / reach
        far = np.clip(reach, abs(self.upper - self.fore) + 0.03,
                      STRETCHED * (self.upper + self.fore))  # fmt: skip
        shoulder = wrist - far * out
        # Two bones and the way between their ends are a triangle, which may turn about that way.
        along = (far**2 + self.upper**2 - self.fore**2) / (2 * far)
        aside = np.cross(out, (0, 0, 1.0))
        aside /= np.linalg.norm(aside) + 1e-9
        bent = np.sin(self.swivel) * aside - np.cos(self.swivel) * np.cross(aside, out)
        elbow = shoulder + along * out + np.sqrt(max(0, self.upper**2 - along**2)) * bent
        upper, fore, palm, *cuff = self.limbs
        self._put(upper, shoulder, elbow - shoulder)
        self._put(palm, end, ahead, self.roll)
        for body in (fore, *cuff):
            self._put(body, elbow, wrist - elbow)

    def _put(self, body, at, ahead, roll=0.0):
        self.p.resetBasePositionAndOrientation(body, at, facing(ahead, roll))


def _lent(name, numbers):
    """An array as a list that is the same object each time, and so are its rows: PyBullet never
    lets go of those that a mesh is made of, which is 0.3 MB a person."""
    lent, rows = _lists(name)
    lent[:] = numbers.tolist()
    if numbers.ndim > 1:
        rows += [[] for _ in range(len(lent) - len(rows))]
        for row, values in zip(rows, lent, strict=False):
            row[:] = values
        lent[:] = rows[: len(lent)]
    return lent


@cache
def _lists(name):
    return [], []
