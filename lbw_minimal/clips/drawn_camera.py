"""What a camera makes of drawings: where it stands, its light, noise, blur and compression.

Not from the paper. In: pictures and masks of a clip, and where tip and object are in them. Out:
what a file of the clip shows, between black bars if it is not square, and the places in there.
"""

from __future__ import annotations

import cv2
import numpy as np

from lbw_minimal.clips.drawn_shapes import SIZE


def filmed(
    rng: np.random.Generator,
    pictures: list[np.ndarray],
    masks: list[np.ndarray],
    places: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The clip of T pictures (84, 84, 3), masks (84, 84, 2) and places (2, T, 2) in pixels.

    Returns frames (T, 84, 84, 3) uint8, the places of tip and of object, (T, 2) float32, nan where
    the frame does not show them, and masks (T, 42, 42, 2) uint8.
    """
    T = len(pictures)
    # The camera stands and looks somewhat elsewhere, and may shake a little.
    zoom = np.exp(rng.normal(-0.05, 0.18))
    view = np.array(cv2.getRotationMatrix2D((SIZE / 2, SIZE / 2), rng.normal(0, 6), zoom), float)
    view[:, 2] += rng.normal(0, 4, 2)
    view[0, 1] += rng.normal(0, 0.06)
    shake = rng.normal(0, 0.3, (T, 2)) * (rng.random() < 0.15)
    views = [view + [[0, 0, x], [0, 0, y]] for x, y in shake]
    frames, shown = (
        np.stack(
            [
                cv2.warpAffine(layer, view, (SIZE, SIZE), borderMode=cv2.BORDER_REFLECT)
                for layer, view in zip(layers, views, strict=True)
            ]
        )
        for layers in (pictures, masks)
    )
    places = (places - 0.5) @ view[:, :2].T + view[:, 2] + shake + 0.5
    frames = _developed(rng, frames)
    edge = np.zeros(2, int)
    # Black bars beside an upright clip, or above and below a wide one; 18 pixels at 16:9.
    if rng.random() < 0.4:
        edge[rng.integers(2)] = rng.integers(4, 22)
        x, y = edge
        for picture in (frames, shown):
            picture[:, :, :x] = picture[:, :, SIZE - x :] = 0
            picture[:, :y] = picture[:, SIZE - y :] = 0
    places[~((places >= edge) & (places < SIZE - edge)).all(2)] = np.nan
    if rng.random() < 0.5:
        frames, shown = frames[:, :, ::-1], shown[:, :, ::-1]
        places[..., 0] = SIZE - places[..., 0]
    if rng.random() < 0.08:  # a loop that begins in its middle
        cut = rng.integers(1, T)
        frames, shown = np.roll(frames, cut, 0), np.roll(shown, cut, 0)
        places = np.roll(places, cut, 1)
    half = (SIZE // 2, SIZE // 2)
    cells = np.stack([cv2.resize(mask, half, interpolation=cv2.INTER_AREA) for mask in shown])
    tip, object_ = places.astype(np.float32)
    return np.ascontiguousarray(frames), tip, object_, cells


def _developed(rng, frames):
    """Frames (T, 84, 84, 3) uint8 with light, colour cast, flicker, noise, blur, compression."""
    T = len(frames)
    cast = np.exp(rng.normal(0, 0.25) + rng.normal(0, 0.07, 3))
    flicker = 1 + rng.normal(0, 0.03, (T, 1, 1, 1)) * (rng.random() < 0.3)
    slope = 1 + rng.normal(0, 0.12) * np.linspace(-1, 1, SIZE)[:, None]
    if rng.random() < 0.25:  # haze, backlight: all is much alike
        middle = frames.mean()
        frames = middle + np.float32(rng.uniform(0.4, 1)) * (frames - middle)
    frames = frames * np.float32(cast * flicker * slope) + np.float32(rng.normal(0, 12))
    if rng.random() < 0.6:
        noise = rng.standard_normal(frames.shape, np.float32)
        frames += np.float32(rng.uniform(0, 8)) * noise
    blur = rng.uniform(0.3, 1.1) * (rng.random() < 0.4)
    quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.uniform(25, 90))] if rng.random() < 0.4 else None
    frames = np.clip(frames, 0, 255).astype(np.uint8)
    for t in range(T):
        if blur:
            frames[t] = cv2.GaussianBlur(frames[t], (0, 0), blur)
        if quality:
            file = cv2.imencode(".jpg", frames[t], quality)[1]
            frames[t] = cv2.imdecode(file, cv2.IMREAD_COLOR)
    return frames
