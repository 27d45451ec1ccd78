"""A textured square before a textured wall, moved by fractions of a pixel."""

import cv2
import numpy as np

SIDE, HERE = 10, np.array([30.0, 40.0])  # a square, and its upper left corner


def texture(seed=0):
    rng = np.random.default_rng(seed)
    return cv2.GaussianBlur(rng.uniform(60, 160, (84, 84, 3)), (0, 0), 1.5)


def scene(at, wall, thing=None):
    """A square of another texture at `at`, to a fraction of a pixel, before a wall."""
    thing = texture(9)[:SIDE, :SIDE] * (1.4, 0.3, 0.3) if thing is None else thing
    shift = np.array([[1, 0, at[0]], [0, 1, at[1]]], float)
    mask = cv2.warpAffine(np.ones((SIDE, SIDE)), shift, (84, 84))[..., None]
    moved = cv2.warpAffine(thing, shift, (84, 84), borderMode=cv2.BORDER_REPLICATE)
    return (wall * (1 - mask) + moved * mask).round().clip(0, 255).astype(np.uint8)


def ways(steps=20, rest=8, pace=(0.7, -0.25)):
    """A square that rests and then moves by fractions of a pixel: frames, displacement (T, 2)."""
    d = np.clip(np.arange(steps) - rest, 0, None)[:, None] * np.array(pace)
    return np.stack([scene(HERE + x, texture()) for x in d]), d
