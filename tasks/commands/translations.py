"""How CycleGAN and MUNIT translate push, and what keypoints then know: LbW's and AVID-m's runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import tasks
from lbw_minimal import cyclegan, transporter, video
from lbw_minimal.imitate import Perception
from lbw_minimal.pictures import draw_keypoints, enlarge
from tasks.commands import figures
from tasks.commands.batch import folder
from tasks.commands.job import settings_of
from tasks.commands.probe import PROBE_SEED, probe


def demo_of(task: str) -> np.ndarray:
    """The demonstration, (N, 84, 84, 3) uint8."""
    return video.read(tasks.VIDEOS / task / "expert_01.mp4")[0]


@cache
def munit(runs: Path) -> Perception:
    """What LbW's first run on push perceives, which has watched the demonstration."""
    return tasks.trained_perception("push", folder(runs, "push", 0))


@dataclass
class Cycled:
    """CycleGAN's frames, and a detector that learnt on them as LbW's did on MUNIT's."""

    model: cyclegan.CycleGAN
    detector: transporter.Transporter
    z_E: np.ndarray

    @classmethod
    @cache
    def learn(cls, runs: Path, change: str) -> Cycled:
        """From AVID-m's first run on push with that change; the detector is trained once."""
        out = folder(runs, "push", 0, change)
        model, path = (
            cyclegan.load(out / "translation.safetensors", "push"),
            out / "keypoints.safetensors",
        )
        demo = demo_of("push")
        if not path.exists():
            random = video.read(tasks.VIDEOS / "push" / "random.mp4", whole=True)[0]
            recipe = settings_of(folder(runs, "push", 0))["recipe"]
            robot = tasks.pace_film("push", 0, recipe["robot_frames"])
            v = [cyclegan.translate(model, frames) for frames in (demo, random)]
            detector, _ = transporter.train(
                [*v, robot], iterations=recipe["transporter_iterations"], K=recipe["K"], seed=0
            )
            transporter.save(path, detector, "push")
        detector = transporter.load(path, "push")
        return cls(model, detector, transporter.detect(detector, cyclegan.translate(model, demo)))

    def translate(self, frames: np.ndarray) -> np.ndarray:
        """Human frames (T, 84, 84, 3) uint8 as CycleGAN makes the robot's of them."""
        return cyclegan.translate(self.model, frames)

    def detect(self, frames: np.ndarray) -> np.ndarray:
        """Keypoints (T, K, 2)."""
        return transporter.detect(self.detector, frames)


def strips(runs: Path, cycles: Mapping[str, str]) -> Figure:
    """Figure 5: the same frames of push's video by each method; cycles: name -> change."""
    seen, demo = munit(runs), demo_of("push")
    cycled = {name: Cycled.learn(runs, change) for name, change in cycles.items()}
    rows = {
        "human": enlarge(demo, 4),
        **{
            name.replace(" with", "\nwith"): enlarge(model.translate(demo), 4)
            for name, model in cycled.items()
        },
        "MUNIT": enlarge(seen.translated, 4),
        "MUNIT's\nkeypoints": draw_keypoints(seen.translated, seen.z_E, 4),
    }
    return figures.strips(rows)


def scores(runs: Path, cycles: Mapping[str, str]) -> dict[str, Any]:
    """What `probe` finds of push's keypoints, by translation; cycles: name -> change."""
    seers: dict[str, Any] = {"MUNIT": munit(runs)}
    seers |= {name: Cycled.learn(runs, change) for name, change in cycles.items()}
    return {name: probe("push", seer, PROBE_SEED) for name, seer in seers.items()}
