"""Rooms, tables, arms and things for `strangers.py`: another hand than the kit's drawings.

Everything is painted at the size of the clip, with surfaces, shading and shadows, and shares no
line with what the detector learns from. Pictures are (H, W, 3) float32 in 0-255; a layer is such a
picture with its opacity (H, W) float32 in 0-1.
"""

import cv2
import numpy as np

BITS = 3  # behind the binary point of OpenCV's coordinates


def fbm(rng, h, w, cells=(3, 9, 27, 81), stretch=1.0):
    """Cloudy noise (h, w) of mean 0 and deviation 1; stretch: times as long as high."""
    out = np.zeros((h, w), np.float32)
    for octave, n in enumerate(cells):
        grid = rng.normal(0, 1, (max(2, n * h // w), max(2, round(n / stretch))))
        large = cv2.resize(grid.astype(np.float32), (w, h), interpolation=cv2.INTER_CUBIC)
        out += large / 1.6**octave
    return (out - out.mean()) / out.std()


def tone(rng, low=40, high=215, colour=30):
    """A colour (3,)."""
    return np.clip(rng.uniform(low, high) + rng.normal(0, colour, 3), 5, 250)


def poly(layer, points, colour, shade=None):
    """Fill a polygon (N, 2) on a layer; shade: an (H, W) factor of its brightness."""
    (h, w), (x0, y0) = layer[1].shape, np.floor(points.min(0)).astype(int) - 1
    x1, y1 = np.ceil(points.max(0)).astype(int) + 2
    x0, y0, x1, y1 = max(0, x0), max(0, y0), min(w, x1), min(h, y1)
    if x0 >= x1 or y0 >= y1:
        return
    mask = np.zeros((y1 - y0, x1 - x0), np.uint8)
    at = np.round((points - (x0, y0)) * 2**BITS).astype(np.int32)
    cv2.fillPoly(mask, [at], 255, cv2.LINE_AA, BITS)
    share = mask.astype(np.float32)[..., None] / 255
    ink = np.asarray(colour, np.float32)
    if shade is not None:
        ink = ink * shade[y0:y1, x0:x1, None]
    picture, alpha = layer[0][y0:y1, x0:x1], layer[1][y0:y1, x0:x1]
    picture *= 1 - share
    picture += share * ink
    alpha *= 1 - share[..., 0]
    alpha += share[..., 0]


def ellipse(centre, rx, ry, n=36):
    """Points (n, 2) of an ellipse."""
    a = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return np.asarray(centre) + np.stack([rx * np.cos(a), ry * np.sin(a)], 1)


def rectangle(x0, y0, x1, y1):
    """Its corners (4, 2)."""
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], float)


def empty(h, w):
    """A layer with nothing on it."""
    return np.zeros((h, w, 3), np.float32), np.zeros((h, w), np.float32)


def over(picture, layer):
    """The picture with the layer in front."""
    out, used = picture.copy(), part(layer[1])
    out[used] = out[used] * (1 - layer[1][used][..., None]) + layer[0][used]
    return out


def part(opacity):
    """The rows and columns of a layer between which all is that is on it."""
    y, x = np.flatnonzero(opacity.any(1)), np.flatnonzero(opacity.any(0))
    return np.s_[y[0] : y[-1] + 1, x[0] : x[-1] + 1] if len(y) else np.s_[:0, :0]


# The room


def wall(rng, h, w):
    """A wall and what hangs and stands before it."""
    kind = rng.choice(["bare", "paper", "shelf", "tiles", "bricks", "blinds", "outdoors"])
    y, x = np.mgrid[:h, :w].astype(np.float32)
    colour = tone(rng, 70, 225, 18)
    light = 1 + rng.uniform(-0.2, 0.2) * (x / w - 0.5) + rng.uniform(-0.25, 0.1) * (y / h - 0.5)
    grain = 1 + rng.uniform(0.004, 0.02) * fbm(rng, h, w, (30, 120))
    picture = np.ones((h, w, 3), np.float32) * colour.astype(np.float32)
    step = w / rng.integers(8, 22)
    if kind == "paper":
        pattern = np.sin(2 * np.pi * x / step) * (
            np.sin(2 * np.pi * y / step) if rng.random() < 0.5 else 1
        )
        picture *= 1 + 0.09 * np.sign(pattern)[..., None]
    elif kind in ("tiles", "bricks"):
        row = (y // (step * 0.6)).astype(int)
        shift = step / 2 * (row % 2) * (kind == "bricks")
        joint = ((x + shift) % step < 0.06 * step) | (y % (step * 0.6) < 0.06 * step)
        picture *= np.where(joint, 0.75, 1)[..., None]
        tint = rng.normal(1, 0.05, (200, 200))[row % 200, ((x + shift) // step).astype(int) % 200]
        picture *= tint[..., None].astype(np.float32)
    elif kind == "blinds":
        picture *= (0.85 + 0.15 * np.sin(2 * np.pi * y / (0.45 * step)))[..., None]
    elif kind == "outdoors":
        leaves = np.clip(fbm(rng, h, w, (5, 15, 45, 135)), -2, 2)[..., None]
        picture = np.array([96, 118, 70], np.float32) * (1 + 0.3 * leaves)
    layer = empty(h, w)
    if kind == "shelf":
        _shelf(rng, layer, h, w)
    for _ in range(rng.integers(0, 4) if kind != "bare" else rng.integers(0, 2)):
        _hang(rng, layer, h, w)
    return over(picture, layer) * (light * grain)[..., None]


def _shelf(rng, layer, h, w):
    y = 0.02 * h
    while y < 0.62 * h:
        tall, x = rng.uniform(0.12, 0.2) * h, rng.uniform(0, 0.1) * w
        while x < w:
            wide, low = rng.uniform(0.012, 0.04) * w, rng.uniform(0, 0.35) * tall
            book = rectangle(x, y + low, x + wide, y + tall)
            poly(layer, book, tone(rng, colour=45))
            poly(layer, rectangle(x, y + low + 3, x + wide, y + low + 6), tone(rng))
            x += wide * (1 if rng.random() < 0.9 else 3)
        poly(layer, rectangle(0, y + tall, w, y + tall + 0.015 * h), (92, 66, 44))
        y += tall + 0.03 * h


def _hang(rng, layer, h, w):
    at, half = rng.uniform((0, 0), (w, 0.45 * h)), rng.uniform(0.04, 0.13, 2) * w
    frame = rectangle(*(at - half), *(at + half))
    poly(layer, frame, tone(rng, 20, 120, 10))
    inner = rectangle(*(at - 0.85 * half), *(at + 0.85 * half))
    poly(layer, inner, tone(rng, 90, 230), 1 + 0.25 * fbm(rng, h, w, (20, 60)))
    if rng.random() < 0.5:
        poly(layer, ellipse(at, *(0.4 * half)), tone(rng, colour=50))


def table(rng, picture, top):
    """Lay a table from the height `top` downwards, with things on it that nobody touches."""
    h, w = picture.shape[:2]
    layer = empty(h, w)
    wood, tilt = tone(rng, 60, 200, 22), rng.uniform(-0.012, 0.012) * w
    grain = 1 + rng.uniform(0.01, 0.07) * fbm(rng, h, w, (6, 40, 160), rng.choice([1, 8]))
    far = top - rng.uniform(0.02, 0.14) * h  # the camera looks down on it a little
    corners = np.array([(-9, far - tilt), (w + 9, far + tilt), (w + 9, h + 9), (-9, h + 9)])
    poly(layer, corners, wood, grain)
    if rng.random() < 0.4:
        edge = top + rng.uniform(0.14, 0.2) * h
        poly(layer, rectangle(-9, edge, w + 9, h + 9), 0.55 * wood, grain)
    picture = over(picture, layer)
    for _ in range(rng.integers(0, 3)):
        stands = empty(h, w)
        at = np.array([rng.uniform(0, w), far + rng.uniform(0, 0.02) * h])
        thing(rng.choice(THINGS), stands, at - (0, 0.04 * h), rng.uniform(0.03, 0.06, 2) * w,
              [tone(rng), tone(rng)], 0)  # fmt: skip
        picture = over(picture, stands)
    return picture


# Things

THINGS = ("mug", "can", "carton", "car", "fruit", "book")


def thing(kind, layer, at, half, colours, seed):
    """Draw a thing about `at` (2,), half (2,) as wide and high, in two colours (2, 3)."""
    (x, y), (a, b) = at, half
    main, second = colours
    h, w = layer[1].shape
    across = (np.arange(w, dtype=np.float32) - x) / a
    round_ = np.broadcast_to(1.12 - 0.4 * (across + 0.25) ** 2, (h, w)).clip(0.4, 1.2)
    if kind == "mug":
        poly(layer, ellipse((x + a, y), 0.6 * a, 0.6 * b), 0.8 * main)
        poly(layer, ellipse((x + a, y), 0.35 * a, 0.35 * b), 0.5 * main)
        poly(layer, rectangle(x - a, y - b, x + a, y + b), main, round_)
        poly(layer, ellipse((x, y - b), a, 0.18 * b), 0.6 * main)
        poly(layer, ellipse((x - 0.1 * a, y + 0.1 * b), 0.4 * a, 0.4 * b), second, round_)
    elif kind == "can":
        poly(layer, rectangle(x - a, y - b, x + a, y + b), main, round_)
        poly(layer, rectangle(x - a, y - 0.5 * b, x + a, y + 0.3 * b), second, round_)
        poly(layer, ellipse((x, y - b), a, 0.2 * b), (190, 190, 195))
    elif kind == "carton":
        poly(layer, rectangle(x - a, y - b, x + a, y + b), main)
        poly(layer, np.array([(x - a, y - b), (x - 0.7 * a, y - 1.25 * b), (x + a, y - 1.25 * b),
                              (x + a, y - b)]), 1.15 * main)  # fmt: skip
        for k in range(3):
            poly(layer, rectangle(x - 0.7 * a, y - 0.5 * b + 0.4 * k * b, x + (0.5 - 0.3 * k) * a,
                                  y - 0.35 * b + 0.4 * k * b), second)  # fmt: skip
    elif kind == "car":
        poly(layer, rectangle(x - a, y - 0.1 * b, x + a, y + 0.7 * b), main)
        poly(layer, np.array([(x - 0.6 * a, y - 0.1 * b), (x - 0.35 * a, y - b),
                              (x + 0.4 * a, y - b), (x + 0.7 * a, y - 0.1 * b)]),
             second)  # fmt: skip
        for side in (-0.55, 0.55):
            poly(layer, ellipse((x + side * a, y + 0.65 * b), 0.25 * a, 0.35 * b), (30, 30, 32))
    elif kind == "fruit":
        poly(layer, ellipse(at, a, b), main, round_)
        poly(
            layer,
            ellipse((x - 0.3 * a, y - 0.35 * b), 0.2 * a, 0.15 * b),
            np.minimum(1.4 * main, 250),
        )
    elif kind == "puck":
        poly(layer, rectangle(x - a, y - 0.4 * b, x + a, y + 0.6 * b), main, round_)
        poly(layer, ellipse((x, y + 0.6 * b), a, 0.4 * b), main, round_)
        poly(layer, ellipse((x, y - 0.4 * b), a, 0.4 * b), second)
    elif kind == "front":  # of a drawer that slides in from the side
        poly(layer, rectangle(x - 0.35 * a, y - b, x + 0.35 * a, y + b), main)
        poly(layer, rectangle(x - 0.75 * a, y - 0.25 * b, x - 0.35 * a, y + 0.05 * b), second)
    else:  # a book that stands
        poly(layer, rectangle(x - 0.6 * a, y - 1.2 * b, x + 0.6 * a, y + b), main)
        poly(layer, rectangle(x - 0.6 * a, y - 0.9 * b, x + 0.6 * a, y - 0.6 * b), second)


# The arm

SKINS = np.array([(250, 214, 190), (226, 178, 146), (186, 132, 98), (126, 84, 60), (74, 50, 40)])


class Person:
    """An arm of two segments, a hand or a tool; lengths in units of the picture's height."""

    def __init__(self, rng):
        self.skin = np.clip(SKINS[rng.integers(5)] + rng.normal(0, 8, 3), 0, 255)
        self.cloth = tone(rng, 25, 210, 40)
        self.second = tone(rng, 25, 210, 40)
        self.sleeve = rng.choice([0.0, 0.5, 0.95], p=[0.25, 0.25, 0.5])  # how far down the forearm
        self.weave = rng.choice(["plain", "rings", "folds"])
        self.glove = rng.random() < 0.1
        self.hold = rng.choice(["flat", "fist", "point", "tool"], p=[0.35, 0.3, 0.2, 0.15])
        self.lengths = rng.uniform(0.42, 0.55), rng.uniform(0.36, 0.46)
        self.thick = rng.uniform(0.05, 0.075)  # half the upper arm's width
        self.hand = rng.uniform(0.12, 0.16)
        self.tool = rng.uniform(0.10, 0.22) if self.hold == "tool" else 0.0
        self.bend = rng.choice([-1, 1], p=[0.75, 0.25])  # elbow below or above
        self.tilt = rng.uniform(-0.1, 0.9)  # rad, how steeply the hand points down
        self.watch = rng.random() < 0.25
        self.folds = rng.normal(0, 0.05, 40)

    def draw(self, layer, tip, shoulder, size):
        """The arm from `shoulder` to `tip` (2,), in a picture whose unit is `size` pixels."""
        side = np.sign(tip[0] - shoulder[0]) or 1.0
        point = np.array([side * np.cos(self.tilt), np.sin(self.tilt)])
        wrist = tip - (self.hand + self.tool) * size * point
        elbow = self._elbow(wrist, shoulder, size, side)
        t = self.thick * size
        self._limb(layer, shoulder, elbow, t, 0.8 * t, 1.0)
        self._limb(layer, elbow, wrist, 0.8 * t, 0.5 * t, self.sleeve)
        self._hand(layer, tip - self.tool * size * point, wrist, point, size)
        if self.tool:
            a, b = tip - (self.tool + 0.3 * self.hand) * size * point, tip
            stick(layer, a, b, 0.014 * size, 0.010 * size, self.second)

    def _elbow(self, wrist, shoulder, size, side):
        a, b = (length * size for length in self.lengths)
        d = wrist - shoulder
        far = np.linalg.norm(d)
        stretch = max(1.0, 1.001 * far / (a + b))
        a, b = a * stretch, b * stretch
        along = (a * a - b * b + far * far) / (2 * far)
        up = np.sqrt(max(0.0, a * a - along * along))
        across = np.array([-d[1], d[0]]) / far * side * self.bend
        return shoulder + along * d / far + up * across

    def _limb(self, layer, a, b, ra, rb, sleeve):
        if sleeve < 1:
            stick(layer, a, b, ra * 0.85, rb, self.cloth if self.glove else self.skin)
            if self.watch:
                m = a + 0.88 * (b - a)
                stick(layer, m, m + 0.05 * (b - a), rb * 1.15, rb * 1.15, (25, 25, 30))
        if sleeve <= 0:
            return
        end, r = a + sleeve * (b - a), ra + sleeve * (rb - ra)
        stick(layer, a, end, ra, r * 1.1, self.cloth)
        n = 12
        for k in range(n) if self.weave != "plain" else ():
            here, wide = a + (k + 0.5) / n * (end - a), (ra + (k + 0.5) / n * (r - ra)) * 0.98
            ink = self.second if self.weave == "rings" else self.cloth * (1 + 4 * self.folds[k])
            if self.weave == "rings" and k % 2:
                continue
            across = np.array([-(end - a)[1], (end - a)[0]]) / np.linalg.norm(end - a)
            lean = (end - a) / n * (self.folds[k] * 6 if self.weave == "folds" else 0)
            stick(layer, here - wide * across + lean, here + wide * across - lean, 0.2 * wide,
                  0.2 * wide, np.clip(ink, 0, 255))  # fmt: skip

    def _hand(self, layer, tip, wrist, point, size):
        skin = self.cloth * 0.6 if self.glove else self.skin
        hand, across = self.hand * size, np.array([-point[1], point[0]])
        if self.hold in ("fist", "tool"):
            mid = wrist + 0.6 * hand * point
            stick(layer, wrist, mid, 0.27 * hand, 0.36 * hand, skin)
            for k in (-0.24, -0.08, 0.08, 0.24):
                knuckle = mid + k * hand * across
                stick(
                    layer,
                    knuckle,
                    knuckle + 0.3 * hand * point,
                    0.1 * hand,
                    0.1 * hand,
                    0.95 * skin,
                )
            return
        mid = wrist + 0.45 * hand * point
        stick(layer, wrist, mid, 0.25 * hand, 0.3 * hand, skin)
        for k, r in ((-0.2, 0.5), (-0.07, 0.53), (0.07, 0.5), (0.2, 0.42)):
            reach = 0.53 * hand if self.hold == "flat" or k == -0.07 else 0.2 * hand
            base = mid + k * hand * across
            there = base + reach * (r / 0.53) * point - 0.5 * k * hand * across
            stick(layer, base, there, 0.075 * hand, 0.055 * hand, skin * (1 - 0.06 * (k > 0)))
        thumb = wrist + 0.2 * hand * point - 0.25 * hand * across
        stick(
            layer,
            thumb,
            thumb + hand * (0.35 * point - 0.1 * across),
            0.08 * hand,
            0.06 * hand,
            0.9 * skin,
        )


def stick(layer, a, b, ra, rb, colour):
    """A round stick from a to b with radius ra at a and rb at b, lit from above."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    for k, light in ((1.0, 0.66), (0.86, 0.8), (0.66, 0.93), (0.4, 1.03)):
        lift = np.array([0, -(1 - k) * 0.45])
        ends = np.concatenate([ellipse(a + lift * ra, k * ra, k * ra, 14),
                               ellipse(b + lift * rb, k * rb, k * rb, 14)])  # fmt: skip
        hull = cv2.convexHull(ends.astype(np.float32))[:, 0]
        poly(layer, hull, np.clip(np.asarray(colour) * light, 0, 255))
