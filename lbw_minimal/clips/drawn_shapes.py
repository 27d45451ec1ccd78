"""What drawings are made of: colours, surfaces, shapes, things, and a person's arm.

A shape is drawn on a layer, (84, 84, 4) uint8: colour times opacity, and opacity. Layers are laid
over a picture, (84, 84, 3) float32 in 0-255. Places are in pixels from the left and the upper edge.
"""

from __future__ import annotations

import cv2
import numpy as np

SIZE = 84  # pixels, both sides of a picture
BITS = 4  # behind the binary point of OpenCV's coordinates: it draws to a sixteenth of a pixel
ROUND = np.array([(np.cos(a), np.sin(a)) for a in np.linspace(0, 2 * np.pi, 20)])
SQUARE = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])

# From light to dark; a person's skin is between two neighbours.
SKINS = np.array(
    [(255, 222, 200), (238, 192, 162), (206, 150, 116), (152, 97, 68), (88, 56, 44)], float
)
# Hands from the wrist at u = -1 to the tip at u = 0, v across, in lengths of the hand: rounded
# sticks (u, v, u, v, radius, radius).
HANDS = {
    "fist": ((-0.9, 0, -0.4, 0.04, 0.24, 0.36), (-0.62, 0.24, -0.24, 0.26, 0.12, 0.10)),
    "pointing": (
        (-1.0, 0, -0.62, 0, 0.22, 0.26), (-0.62, 0.14, -0.06, 0, 0.09, 0.06),
        (-0.85, -0.18, -0.5, -0.26, 0.09, 0.07),
    ),
    "flat": (
        (-1.0, 0, -0.62, 0, 0.20, 0.26), (-0.6, 0.21, -0.16, 0.27, 0.07, 0.05),
        (-0.6, 0.07, -0.05, 0.08, 0.07, 0.05), (-0.6, -0.07, -0.07, -0.08, 0.07, 0.05),
        (-0.6, -0.2, -0.2, -0.26, 0.07, 0.05), (-0.9, -0.22, -0.5, -0.42, 0.09, 0.06),
    ),
    "pinch": (
        (-1.0, 0.04, -0.66, 0.06, 0.22, 0.26), (-0.6, 0.18, -0.06, 0.03, 0.09, 0.05),
        (-0.75, -0.16, -0.06, -0.03, 0.09, 0.06), (-0.6, 0.24, -0.36, 0.26, 0.10, 0.08),
    ),
    "fingers down": (
        (-1.0, 0, -0.62, 0, 0.20, 0.20), (-0.64, 0.04, -0.08, 0.03, 0.19, 0.07),
        (-0.7, 0.2, -0.36, 0.14, 0.09, 0.06),
    ),
}  # fmt: skip
THINGS = ("box", "can", "flat", "mug", "ball")


# Colours and surfaces


def a_colour(rng: np.random.Generator, near: np.ndarray | None = None) -> np.ndarray:
    """A colour (3,) in 0-255, more often greyish than not; or one hard to tell from `near`."""
    if near is not None:
        return np.clip(near + rng.normal(0, 16, 3), 0, 255)
    tint = rng.normal(0, rng.choice([8, 25, 70], p=[0.4, 0.4, 0.2]), 3)
    return np.clip(rng.uniform(15, 245) + tint - tint.mean(), 0, 255)


def a_skin(rng: np.random.Generator) -> np.ndarray:
    """A colour of skin (3,) in 0-255."""
    i, t = rng.integers(len(SKINS) - 1), rng.random()
    return np.clip((1 - t) * SKINS[i] + t * SKINS[i + 1] + rng.normal(0, 8, 3), 0, 255)


def a_surface(rng: np.random.Generator, strength: float) -> np.ndarray:
    """Stains, grain, and sometimes stripes, as a factor (84, 84, 1) about 1."""
    pattern = np.zeros((SIZE, SIZE), np.float32)
    for cells in (3, 12, 50):
        grid = rng.normal(0, 1, (cells, cells if rng.random() < 0.6 else 3)).astype(np.float32)
        pattern += rng.random() * cv2.resize(grid, (SIZE, SIZE), interpolation=cv2.INTER_CUBIC)
    if rng.random() < 0.3:  # boards, tiles, blinds, cloth
        y, x = np.mgrid[:SIZE, :SIZE]
        a, step = rng.uniform(0, np.pi), rng.uniform(1.5, 15)
        pattern += np.sign(np.sin((x * np.cos(a) + y * np.sin(a)) * 2 * np.pi / step))
    return np.maximum(0, 1 + strength * pattern[..., None]).astype(np.float32)


# Layers and shapes


def empty() -> np.ndarray:
    """A layer with nothing on it."""
    return np.zeros((SIZE, SIZE, 4), np.uint8)


def over(picture: np.ndarray, layer: np.ndarray) -> np.ndarray:
    """The picture (84, 84, 3) with the layer in front of it."""
    return picture * (1 - layer[..., 3:] / np.float32(255)) + layer[..., :3]


def smeared(layer: np.ndarray, way: np.ndarray) -> np.ndarray:
    """The layer as a shutter leaves it that is open while what is on it goes so far, (2,)."""
    n = int(np.abs(way).max()) + 1
    if n == 1:
        return layer
    kernel = np.zeros((2 * n + 1, 2 * n + 1), np.float32)
    for along in np.linspace(-0.5, 0.5, 2 * n + 1):
        x, y = np.round(n + along * way).astype(int)
        kernel[y, x] += 1 / (2 * n + 1)
    return cv2.filter2D(layer, -1, kernel, borderType=cv2.BORDER_REPLICATE)


def polygon(layer: np.ndarray, points: np.ndarray, colour: np.ndarray, opacity: int = 255) -> None:
    """Draw a convex polygon (N, 2); opacity 0 cuts a hole."""
    # OpenCV counts from the middle of the first pixel, we from its edge.
    at = np.round((points - 0.5) * 2**BITS).astype(np.int32)
    cv2.fillConvexPoly(layer, at, (*colour, opacity), cv2.LINE_AA, BITS)


def stick(
    layer: np.ndarray, a: np.ndarray, b: np.ndarray, ra: float, rb: float, colour: np.ndarray
) -> None:
    """Draw a stick from a to b, (2,), rounded with radius ra at a and rb at b."""
    around = np.concatenate([a + ra * ROUND, b + rb * ROUND]).astype(np.float32)
    polygon(layer, cv2.convexHull(around)[:, 0], colour)


def thing(
    layer: np.ndarray,
    kind: str,
    at: np.ndarray,
    half: np.ndarray,
    colours: tuple[np.ndarray, np.ndarray],
    turn: float = 0.0,
) -> None:
    """Draw one of THINGS or a "front", its middle at `at`, (2,).

    half: half its width and height (2,); colours: of the body and of what is on it; turn: in rad.
    """
    main, second = colours
    c, s = np.cos(turn), np.sin(turn)
    frame = half[:, None] * np.array([[c, s], [-s, c]])

    def part(points, colour, opacity=255):
        polygon(layer, at + points @ frame, colour, opacity)

    if kind == "mug":
        part(ROUND * 0.6 + (1.1, 0), main * 0.8)
        part(ROUND * 0.35 + (1.1, 0), main * 0, 0)
    if kind == "ball":
        part(ROUND, main * 0.85)
        part(ROUND * 0.5 - 0.25, main)
    elif kind in ("can", "mug"):
        part(ROUND * (1, 0.25) + (0, 0.75), main * 0.85)
        part(SQUARE * (1, 0.75), main * 0.85)
        part(SQUARE * (0.4, 0.75), main)
        part(SQUARE * (1, 0.3), second)
        part(ROUND * (1, 0.25) - (0, 0.75), main * 0.7)
    elif kind == "box":
        part(SQUARE * (1, 0.7) + (0, 0.3), main * 0.85)
        part(np.array([(-1, -0.4), (1, -0.4), (0.8, -1), (-0.8, -1)]), main)
        part(SQUARE * (0.5, 0.25) + (0, 0.3), second)
    else:
        part(SQUARE, main)
        part(SQUARE * (0.5, 0.35), second)


# The person


def turned(v: np.ndarray, angle: float) -> np.ndarray:
    """The vector v (2,), turned clockwise in the picture by so many rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1]])


class Person:
    """A person's arm, which `draw` draws wherever its tip and its shoulder are.

    reach: the longest distance between the two, in pixels.
    """

    def __init__(self, rng: np.random.Generator, reach: float):
        self.hand, self.length = HANDS[rng.choice(list(HANDS))], rng.uniform(6, 21)
        self.flip = rng.choice([-1, 1])  # which side the thumb is on
        self.down = rng.random() < 0.45  # the hand points down, else along the arm
        # Of a hand's length, what a camera sees that looks down on it.
        self.seen = rng.uniform(0.5, 1) if rng.random() < 0.3 else 1.0
        self.bend, self.sway = rng.normal(0, 0.45), rng.normal(0, 0.15)  # rad
        self.skin, self.cloth = a_skin(rng), a_colour(rng)
        self.glove = a_colour(rng) if rng.random() < 0.12 else self.skin
        self.wrist = self.length * rng.uniform(0.15, 0.27)  # radii
        self.elbow = self.wrist * rng.uniform(1.1, 1.9)
        # How far down the forearm the sleeve goes; below 0 there is none.
        self.sleeve = rng.choice([-1.0, 0.0, rng.uniform(0, 1), 1.0])
        self.loose = rng.uniform(1.05, 1.6)  # the sleeve's radius over the arm's
        self.knit = a_surface(rng, rng.uniform(0, 0.15) if rng.random() < 0.7 else 0.35)
        self.stripes = rng.integers(3, 10) if rng.random() < 0.25 else 0  # across each half
        self.second = a_colour(rng)
        self.watch = a_colour(rng) if rng.random() < 0.15 else None
        self.elbow_side = rng.choice([-1, 1], p=[0.3, 0.7])  # 1: up, if the arm goes right
        self.bones = (reach + self.length) * rng.uniform(0.43, 0.86, 2)
        self.torso = rng.uniform((6, 15), (25, 50)) if rng.random() < 0.35 else None
        self.light = rng.normal(0, 0.25, 2)
        # A tool in the hand: then its end is the tip. Rulers and spoons are longer than hands.
        long = rng.random() < 0.25
        self.tool = rng.uniform(*((16, 32) if long else (3, 16))) if rng.random() < 0.3 else 0.0
        self.tool_radius, self.tool_turn = rng.uniform(0.5, 3.5), rng.normal(0, 0.5)
        self.tool_colour = a_colour(rng)

    def draw(self, tip: np.ndarray, shoulder: np.ndarray, time: float) -> np.ndarray:
        """The arm as a layer; tip and shoulder (2,), time in 0..1."""
        layer = empty()
        along = (tip - shoulder) / np.linalg.norm(tip - shoulder)
        along = np.array([0.0, 1.0]) if self.down else along
        along = turned(along, self.bend + self.sway * np.sin(3 * time))
        tool = turned(along, self.tool_turn)
        end = tip - self.tool * tool
        deep = self.seen * self.length
        wrist = end - deep * along
        self._arm(layer, shoulder, self._elbow(shoulder, wrist), wrist)
        move = np.round(wrist).astype(int)
        knit = np.roll(self.knit, (move[1], move[0]), (0, 1))
        layer[..., :3] = np.minimum(layer[..., :3] * knit, layer[..., 3:])
        if self.tool:
            r, foot = self.tool_radius, tip - self.tool_radius * tool
            stick(layer, end - 0.4 * deep * along, foot, r, r, self.tool_colour)
        across = np.array([-along[1], along[0]]) * self.flip
        for i, (u_a, v_a, u_b, v_b, r_a, r_b) in enumerate(self.hand):
            a = end + deep * u_a * along + self.length * v_a * across
            b = end + deep * u_b * along + self.length * v_b * across
            shade = self.glove * (1 - 0.05 * (i % 2))  # or fingers would melt into one
            self._limb(layer, a, b, self.length * r_a, self.length * r_b, shade)
        return layer

    def _arm(self, layer, shoulder, elbow, wrist):
        if self.torso is not None:
            (wide, tall), at = self.torso, shoulder + (-0.6, 0.8) * self.torso
            stick(layer, at, at + (0, tall), wide, wide, self.cloth)
        thick = 1.2 * self.elbow
        self._limb(layer, shoulder, elbow, thick, self.elbow, self.skin)
        self._limb(layer, elbow, wrist, self.elbow, self.wrist, self.skin)
        if self.watch is not None:
            at = wrist + 0.12 * (elbow - wrist)
            stick(layer, at, at, 1.1 * self.wrist, 1.1 * self.wrist, self.watch)
        if self.sleeve >= 0:
            cuff = elbow + self.sleeve * (wrist - elbow)
            radius = self.elbow + self.sleeve * (self.wrist - self.elbow)
            at_elbow = self.loose * self.elbow
            self._limb(layer, shoulder, elbow, 1.1 * at_elbow, at_elbow, self.cloth)
            self._limb(layer, elbow, cuff, at_elbow, self.loose * radius, self.cloth)
            self._striped(layer, shoulder, elbow, at_elbow, at_elbow)
            self._striped(layer, elbow, cuff, at_elbow, self.loose * radius)

    def _striped(self, layer, a, b, ra, rb):
        """Stripes across a sleeve from a to b, with its radius at both."""
        ahead = (b - a) / (np.linalg.norm(b - a) + 1e-6)
        aside = 0.9 * np.array([-ahead[1], ahead[0]])
        for t in (np.arange(self.stripes) + 0.5) / max(self.stripes, 1):
            middle, r = a + t * (b - a), ra + t * (rb - ra)
            stick(layer, middle - r * aside, middle + r * aside, 0.2 * r, 0.2 * r, self.second)

    def _limb(self, layer, a, b, ra, rb, colour):
        """A stick with a lit side."""
        stick(layer, a, b, ra, rb, colour * 0.88)
        stick(layer, a + self.light * ra, b + self.light * rb, 0.6 * ra, 0.6 * rb, colour)

    def _elbow(self, a, b):
        """Where the two bones from shoulder a to wrist b meet."""
        (one, two), d = self.bones, np.linalg.norm(b - a) + 1e-6
        x = (one**2 - two**2 + d**2) / (2 * d)
        ahead = (b - a) / d
        aside = np.array([ahead[1], -ahead[0]]) * self.elbow_side
        return a + x * ahead + aside * np.sqrt(max(one**2 - x**2, 0))
