"""Some of a clip's frames, side by side in one file, for the report of a run on that clip."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from lbw_minimal.training import write_atomic

QUALITY = [cv2.IMWRITE_WEBP_QUALITY, 90]  # 15 kB of a look-alike clip; without it 80 kB


def write_stills(path: Path, stills: np.ndarray) -> None:
    """Write stills (n, S, S, 3) uint8 as one picture; for none an older file is removed."""
    path.unlink(missing_ok=True)
    if len(stills):
        strip = np.concatenate(stills, axis=1)[..., ::-1]  # (S, n S, 3)
        write_atomic(path, cv2.imencode(".webp", strip, QUALITY)[1].tobytes())


def read_stills(path: Path) -> np.ndarray | None:
    """Stills (n, S, S, 3) uint8 from a file of `write_stills`; None where there is none."""
    strip = cv2.imread(str(path)) if path.exists() else None
    if strip is None:
        return None
    return np.stack(np.split(strip[..., ::-1], strip.shape[1] // strip.shape[0], axis=1))
