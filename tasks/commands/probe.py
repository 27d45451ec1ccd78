"""How good is perception? The simulator knows the truth, so it can be measured, not admired.

In: a trained translator and detector. Out: for the tip and the object, R^2 of a linear map from the
keypoints z to their true pixels, on robot frames and on translated human frames that no training
saw. The truth goes into these figures and nowhere else.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import tasks
from lbw_minimal.imitate import Perception
from lbw_minimal.report import score
from lbw_minimal.transporter import pixel_error, r2
from tasks.commands import Parser, at_least
from tasks.world import SIZE, record_expert, record_random

SETS = ("robot", "translated", "transfer")
NAMES = ("tip_x", "tip_y", "object_x", "object_y")
PROBE_SEED = 2_000_000  # frames that no training saw


def parser() -> Parser:
    """The arguments of `probe`."""
    p = Parser("probe", "Measure how well the keypoints of a task tell where things are.")
    p.add_task()
    p.add_weights()
    p.add_argument("--frames", type=at_least(100), default=400, help="frames to measure on")
    p.add_argument("--seed", type=at_least(0), default=0, help="of those frames")
    return p


def main(argv: list[str]) -> None:
    """Print the figures. Raises InputError for a mistake in the arguments or the weights."""
    args = parser().read(argv)
    perception = tasks.trained_perception(args.task, args.weights)
    found = probe(args.task, perception, PROBE_SEED + args.seed, args.frames)
    print(f"{args.task}: R² of a linear map to the true pixels (error in pixels)")
    print(f"{'':10s}" + "".join(f"{name:>16s}" for name in SETS))
    for name in NAMES:
        print(f"{name:10s}" + "".join(f"{score(found[where][name]):>16s}" for where in SETS))
    for what in ("contact_px", "keypoint_std"):
        if what in found:
            print(f"{what}: {found[what]}")


def probe(name: str, perception: Perception, seed: int, frames: int = 400) -> dict[str, Any]:
    """Figures of one task's perception, from frames filmed with seeds that no training uses.

    Returns R^2 per coordinate on robot and translated frames, each with the residual in pixels, and
    the standard deviation of every keypoint. Where something is touched, also the gap from tip to
    object in pixels while the object moves, as the keypoints show it in the translated
    demonstration and in a robot expert's film: they agree if the translated gripper touches what it
    seems to push.
    """
    robot = tasks.bare(name, embodiment="robot")
    human = tasks.bare(name, embodiment="human")
    film, truth = in_picture(*record_random(robot, 2 * frames, seed))
    z = perception.detect(film)
    v, v_truth = in_picture(*record_random(human, frames, seed + 1))
    z_v = perception.detect(perception.translate(v))
    frames, half = len(film) // 2, len(v) // 2
    sets = {
        "robot": (z[:frames], truth[:frames], z[frames:], truth[frames:]),
        "translated": (z_v[:half], v_truth[:half], z_v[half:], v_truth[half:]),
        # The robot's map applied to translated frames: do both put the same thing in the same
        # place?
        "transfer": (z[:frames], truth[:frames], z_v, v_truth),
    }
    out: dict[str, Any] = {}
    for where, (z_fit, px_fit, z_held, px_held) in sets.items():
        moves = px_held.std(0) > 0.5  # R^2 says nothing about what does not move
        fit = r2(z_fit, px_fit, z_held, px_held)
        error = pixel_error(z_fit, px_fit, z_held, px_held)
        out[where] = {
            n: {"r2": round(float(s), 3) if m else None, "px": round(float(e), 2)}
            for n, s, m, e in zip(NAMES, fit, moves, error, strict=True)
        }
    if robot.CONTACT:
        pixels = linear(z[:frames], truth[:frames])
        expert = perception.detect(record_expert(robot, seed)[0])
        out["contact_px"] = {
            "demonstration": gap(pixels(perception.z_E)),
            "robot": gap(pixels(expert)),
        }
    robot.close()
    human.close()
    out["keypoint_std"] = np.round(z.reshape(len(z), -1).std(0), 3).tolist()
    return out


def in_picture(film: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The frames that show tip and object: a puck may slide out of the picture."""
    seen = ((truth > 0) & (truth < SIZE)).all(1)
    return film[seen], truth[seen]


def gap(px: np.ndarray) -> float | None:
    """Mean x in pixels from tip to object, of the frames (T, 4) in which the object moves; None if
    it never does, as by keypoints that have learnt nothing."""
    moving = np.abs(np.gradient(px[:, 2])) > 0.5
    if not moving.any():
        return None
    return round(float((px[moving, 2] - px[moving, 0]).mean()), 2)


def linear(z: np.ndarray, pixels: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """The least-squares map from keypoints (T, K, 2) to pixels (T, n), as a function."""

    def flat(z):
        return np.concatenate([z.reshape(len(z), -1), np.ones((len(z), 1))], 1)

    W = np.linalg.lstsq(flat(z), pixels, rcond=None)[0]
    return lambda z: flat(z) @ W
