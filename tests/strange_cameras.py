"""How a camera that is a stranger's moves, and what it makes of light, for `strangers.py`."""

import cv2
import numpy as np

MARGIN = 1.5  # times the picture: what a camera that is carried about may see


def ease(t):
    """Minimum jerk, 0 to 1."""
    t = np.clip(t, 0, 1)
    return t**3 * (10 - 15 * t + 6 * t * t)


def camera(rng, T, size, canvas, moves, rate):
    """Views (T, 2, 3): where in the canvas each pixel of a frame lies."""
    (h, w), (H, W) = size, canvas
    turn, zoom = rng.normal(0, 3), np.exp(rng.uniform(-0.06, 0.06))
    t = np.linspace(0, 1, T)
    s = np.arange(T)[:, None] / rate
    shift, scale, roll = np.zeros((T, 2)), np.full(T, zoom), np.full(T, turn)
    wobble = sum(
        rng.normal(0, 1 / f, 2) * np.sin(2 * np.pi * f * s + rng.uniform(0, 6.28, 2))
        for f in (0.4, 0.9, 1.7, 3.1)
    )
    if moves == "shaken":
        shift = wobble * 0.006 * w
        roll = roll + 0.3 * wobble[:, 0]
    elif moves == "pan":
        shift = (
            rng.choice([-1, 1]) * rng.uniform(0.18, 0.3) * w * np.stack([ease(t) - 0.5, 0 * t], 1)
        )
    elif moves == "zoom":
        scale = scale * np.exp(rng.choice([-1, 1]) * rng.uniform(0.25, 0.4) * (ease(t) - 0.5))
    elif moves == "carried about":
        way = rng.uniform(0.12, 0.2, 2) * rng.choice([-1, 1], 2) * (w, 0.5 * h)
        shift = wobble * 0.02 * w + way * (t[:, None] - 0.5)
        roll = roll + 1.5 * wobble[:, 1]
    views = []
    for k in range(T):
        view = cv2.getRotationMatrix2D((w / 2, h / 2), roll[k], scale[k])
        view[:, 2] += (W / 2 - w / 2, H / 2 - h / 2) + shift[k]
        views.append(view)
    return views


def developed(rng, frames):
    """Frames (T, H, W, 3) uint8 with a phone's light, exposure, colours, blur and noise."""
    T, h, w = frames.shape[:3]
    cast = np.exp(rng.normal(0, 0.18) + rng.normal(0, 0.05, 3))
    mains = 1 + rng.uniform(0, 0.04) * np.sin(rng.uniform(0.3, 3) * np.arange(T) + 1)
    bright = frames[:, ::8, ::8].mean((1, 2, 3))
    exposure = (bright[0] / bright) ** (0.5 * (rng.random() < 0.3))
    y, x = np.mgrid[-1 : 1 : h * 1j, -1 : 1 : w * 1j]
    corner = 1 - rng.uniform(0, 0.25) * (x * x + y * y)
    sigma, blur = rng.uniform(0.5, 9), rng.uniform(0.4, 1.1) * (rng.random() < 0.5)
    out = np.empty_like(frames)
    for t in range(T):
        picture = frames[t] * (cast * corner[..., None] * (mains[t] * exposure[t]))
        if blur:
            picture = cv2.GaussianBlur(picture, (0, 0), blur)
        noise = rng.standard_normal((h, w, 1)) + 0.5 * rng.standard_normal((h, w, 3))
        strength = picture + 20
        np.sqrt(np.divide(strength, 140, out=strength), out=strength).clip(0.3, 1.5, out=strength)
        noise *= sigma * 0.8
        picture += np.multiply(noise, strength, out=noise)
        out[t] = np.clip(picture, 0, 255, out=picture)
    return out
