"""A phone's HDR picture on an ordinary screen: from HLG or PQ with BT.2020 colours to BT.709.

    signal -> `screen_light`, in BT.709 colours -> `tone_map`, which rolls highlights off -> signal

Light is counted in units of 100 cd/m2, which is the white of an SDR screen. What comes out is the
signal that an SDR film would have for that light, as those films' own signals are left as they are:
BT.1886, a power of 2.4. By sRGB's curve it would be 3 to 8 of 255 darker.
"""

from __future__ import annotations

import functools

import numpy as np

HLG, PQ = 18, 16  # the two transfer functions, as ITU-T H.273 counts them in a file
PEAK = 10.0  # 1000 cd/m2, the nominal peak of HLG (BT.2100) and of most PQ films
WHITE = 2.03  # 203 cd/m2, a white sheet of paper in HDR (BT.2408)
KNEE = 0.5  # of white: below it greys stay as they are; white itself becomes 227, the peak 255
# BT.2020's linear RGB in BT.709's primaries (BT.2087, rounded to four digits there).
TO_BT709 = np.array(
    [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]],
    np.float32,
)
LUMINANCE = np.array([0.2627, 0.6780, 0.0593], np.float32)  # BT.2020's weights


def screen_light(signal: np.ndarray, transfer: int) -> np.ndarray:
    """Light (..., 3) float32 >= 0, linear BT.709 RGB, of an HDR screen that shows a signal.

    signal: R'G'B' (..., 3) uint16, 65535 the full signal. transfer: `HLG` or `PQ`.
    """
    if transfer == HLG:
        scene = _HLG_SCENE[signal]  # (..., 3) in [0, 1]
        # The OOTF of BT.2100 with gamma 1.2, a screen of 1000 cd/m2: F = L_W Y^(gamma - 1) E.
        light = PEAK * scene * (scene @ LUMINANCE)[..., None] ** 0.2
    else:
        light = _PQ_LIGHT[signal]
    return np.clip(light @ TO_BT709.T, 0, None)


def white_of(light: np.ndarray) -> float:
    """The light that is to be white, from a frame's light (H, W, 3).

    A camera's HDR has paper at WHITE. A film that was converted from SDR has its white at 1, and
    nothing above: it comes back as it was.
    """
    return float(np.clip(np.percentile(light.max(axis=-1), 99), 1, WHITE))


def tone_map(light: np.ndarray, white: float) -> np.ndarray:
    """SDR's R'G'B' (..., 3) uint8 of light (..., 3) float32, linear BT.709 RGB."""
    light = light / white
    brightest = np.clip(light.max(axis=-1, keepdims=True), 1e-6, PEAK / white)
    light *= _roll_off(brightest, PEAK / white) / brightest  # all three alike keep the hue
    table = _sdr()
    return table[np.rint(np.clip(light, 0, 1) * (len(table) - 1)).astype(np.int32)]


def hlg_scene(signal: np.ndarray) -> np.ndarray:
    """Scene light E in [0, 1] of an HLG signal E' in [0, 1], the inverse OETF of BT.2100."""
    a, b, c = 0.17883277, 0.28466892, 0.55991073
    return np.where(signal <= 0.5, signal**2 / 3, (np.exp((signal - c) / a) + b) / 12)


def pq_light(signal: np.ndarray) -> np.ndarray:
    """Light in units of 100 cd/m2 of a PQ signal E' in [0, 1], the EOTF of BT.2100 (ST 2084)."""
    m1, m2 = 2610 / 16384, 2523 / 4096 * 128
    c1, c2, c3 = 3424 / 4096, 2413 / 4096 * 32, 2392 / 4096 * 32
    power = signal ** (1 / m2)
    return 100 * (np.maximum(power - c1, 0) / (c2 - c3 * power)) ** (1 / m1)


def sdr_signal(light: np.ndarray) -> np.ndarray:
    """The SDR signal in [0, 1] of linear light in [0, 1], the inverse EOTF of BT.1886."""
    return light ** (1 / 2.4)


def _roll_off(x, peak):
    """x up to KNEE, then a hyperbola that goes on with the same slope and is 1 at the peak."""
    k = KNEE
    a = -(k**2) * (peak - 1) / (k**2 - 2 * k + peak)
    b = (k**2 - 2 * k * peak + peak) / (peak - 1)
    return np.where(x <= k, x, (b**2 + 2 * b * k + k**2) / (b - a) * (x + a) / (x + b))


_CODES = np.arange(65536) / 65535
_HLG_SCENE = hlg_scene(_CODES).astype(np.float32)
_PQ_LIGHT = pq_light(_CODES).astype(np.float32)


@functools.cache  # for the first HDR film: few are, and it takes longer than the other tables
def _sdr() -> np.ndarray:
    """8-bit signals, so fine that near black, where the curve is steepest, no level is skipped."""
    return np.rint(255 * sdr_signal(np.linspace(0, 1, 1 << 20))).astype(np.uint8)
