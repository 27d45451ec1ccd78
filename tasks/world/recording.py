"""What a film does not show: what was done, where things were, and when the task was solved.

In: an environment, a seed and actions. Out: the film, and a `Recording` that makes the same film
again, frame by frame. An npz file beside the films keeps the recordings: for replays, for those
who learn from actions, and for export. The method of this kit sees only the films.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np

from lbw_minimal.training import InputError, write_atomic
from tasks.world.env import TaskEnv
from tasks.world.scene import DT, SUBSTEPS


class Recording(NamedTuple):
    """An episode of T frames without its pictures; `film` plays it again."""

    seed: int  # of the reset
    scatter: bool  # whether the reset put the object anywhere
    actions: np.ndarray  # (T - 1, 3) float32 in [-1, 1]; the one at t leads from frame t to t + 1
    states: np.ndarray  # (T, 9) float32: tip, object, target, in m
    times: np.ndarray  # (T,) s since the reset
    success: np.ndarray  # (T,) bool: whether the task was done


def film(
    env: TaskEnv, seed: int, actions: Iterable[np.ndarray], scatter: bool = False
) -> tuple[np.ndarray, np.ndarray, Recording]:
    """Reset with `seed`, play `actions` to their end, and keep what was seen and what was true.

    The first action is asked for after the reset, so a generator may look where things are.
    Returns the frames (T, 84, 84, 3) uint8, the true pixels (T, 4) of tip and object, and the
    recording.
    """
    frame, info = env.reset(seed=seed, options={"scatter": scatter})
    kept, played = [(frame, env.true_pixels(), env.true_state(), info["is_success"])], []
    for action in actions:
        played.append(np.array(action, np.float32))  # what is kept is what was played
        frame, _, _, _, info = env.step(played[-1])
        kept.append((frame, env.true_pixels(), env.true_state(), info["is_success"]))
    frames, pixels, states, success = (np.stack(part) for part in zip(*kept, strict=True))
    done = np.array(played, np.float32).reshape(-1, 3)
    times = np.arange(len(frames)) * (DT * SUBSTEPS)
    return frames, pixels, Recording(seed, scatter, done, states, times, success)


def save_recordings(path: Path | str, recordings: Iterable[Recording]) -> None:
    """Write recordings as an npz file, the same bytes for the same recordings.

    `seeds`, `scatter` and `lengths` have one entry per episode. `states`, `times` and `success`
    hold the episodes one after the other, `lengths` rows each; `actions` likewise, one row fewer.
    """
    seeds, scatter, actions, states, times, success = zip(*recordings, strict=True)
    data = io.BytesIO()
    np.savez_compressed(
        data,
        seeds=np.array(seeds),
        scatter=np.array(scatter),
        lengths=np.array([len(episode) for episode in states]),
        actions=np.concatenate(actions),
        states=np.concatenate(states),
        times=np.concatenate(times),
        success=np.concatenate(success),
    )
    write_atomic(path, data.getvalue())


def load_recordings(path: Path | str) -> list[Recording]:
    """What `save_recordings` wrote. Raises InputError if the file is missing or incomplete."""
    if not Path(path).is_file():
        raise InputError(f"{path}: there is no such file; python -m tasks record writes it.")
    try:
        with np.load(path) as file:
            ends = np.cumsum(file["lengths"])[:-1]
            columns = (
                file["seeds"].tolist(),
                file["scatter"].tolist(),
                np.split(file["actions"], ends - np.arange(1, len(ends) + 1)),
                *(np.split(file[name], ends) for name in ("states", "times", "success")),
            )
            return [Recording(*row) for row in zip(*columns, strict=True)]
    except (BadZipFile, EOFError, KeyError, OSError, ValueError):
        raise InputError(
            f"{path}: not a complete file of recordings; python -m tasks record writes it again."
        ) from None
