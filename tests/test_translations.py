"""CycleGAN beside MUNIT: whose frames a detector learns on, and what stands in which row."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from tasks.commands import translations
from tasks.commands.translations import Cycled

DEMO, RANDOM, ROBOT = (np.full((n, 84, 84, 3), n, np.uint8) for n in (7, 5, 9))
RECIPE = {"robot_frames": 9, "transporter_iterations": 30, "K": 4}


@pytest.fixture
def told(tmp_path, monkeypatch):
    """What the networks are asked for: translating adds 100, keypoints are the frames' levels."""
    told = []
    (tmp_path / "push-0").mkdir()
    (tmp_path / "push-0" / "settings.json").write_text(json.dumps({"recipe": RECIPE}))
    (tmp_path / "push-0-avid").mkdir()

    def read(path, whole=False):
        told.append((path.name, whole))
        return {"random.mp4": RANDOM, "expert_01.mp4": DEMO}[path.name], []

    def train(videos, **how):
        told.append(([int(v[0, 0, 0, 0]) for v in videos], how))
        return "detector", []

    def save(path, detector, task):
        told.append((path.parent.name, detector, task))
        path.write_text(detector)

    def load(path, task):
        return f"{task}'s of {path.parent.name}: {path.read_text()}"

    monkeypatch.setattr(translations.video, "read", read)
    monkeypatch.setattr(translations.tasks, "pace_film", lambda *asked: told.append(asked) or ROBOT)
    monkeypatch.setattr(
        translations, "cyclegan",
        SimpleNamespace(
            load=lambda path, task: f"{path.parent.name}'s {path.stem} of {task}",
            translate=lambda model, frames: frames + np.uint8(100),
        ),
    )  # fmt: skip
    monkeypatch.setattr(
        translations, "transporter",
        SimpleNamespace(
            train=train, save=save, load=load,
            detect=lambda detector, frames: frames[:, 0, 0, :2, None] * [1.0, 0],
        ),
    )  # fmt: skip
    Cycled.learn.__func__.cache_clear()
    translations.munit.cache_clear()
    return told


def test_a_detector_learns_on_cyclegans_frames_as_lbws_did_on_munits(told, tmp_path):
    """Translated are demonstration and random motion, the robot's film is as long as LbW's."""
    cycled = Cycled.learn(tmp_path, "avid")
    assert cycled.model == "push-0-avid's translation of push"
    assert ("push", 0, 9) in told and ("random.mp4", True) in told
    assert ([107, 105, 9], {"iterations": 30, "K": 4, "seed": 0}) in told
    assert cycled.detector == "push's of push-0-avid: detector"
    np.testing.assert_array_equal(cycled.z_E, np.tile([107.0, 0], (7, 2, 1)))
    np.testing.assert_array_equal(cycled.translate(DEMO), DEMO + 100)
    np.testing.assert_array_equal(cycled.detect(RANDOM), np.tile([5.0, 0], (5, 2, 1)))


def test_a_detector_that_is_there_is_not_trained_again(told, tmp_path):
    (tmp_path / "push-0-avid" / "keypoints.safetensors").write_text("earlier")
    assert Cycled.learn(tmp_path, "avid").detector == "push's of push-0-avid: earlier"
    assert told == [("expert_01.mp4", False)]
    assert Cycled.learn(tmp_path, "avid") and len(told) == 1  # nor loaded again


def test_strips_stand_from_the_human_to_munits_keypoints(told, tmp_path, monkeypatch):
    asked = []
    seen = SimpleNamespace(translated=DEMO + np.uint8(50), z_E=np.zeros((7, 2, 2)))
    monkeypatch.setattr(
        translations.tasks, "trained_perception", lambda *which: asked.append(which) or seen
    )
    cycles = {"CycleGAN": "avid", "CycleGAN with motion weights": "avid"}
    figure = translations.strips(tmp_path, cycles)
    assert asked == [("push", tmp_path / "push-0")]
    first = figure.axes[:: len(figure.axes) // 5]
    assert [axis.get_ylabel() for axis in first] == [
        "human", "CycleGAN", "CycleGAN\nwith motion weights", "MUNIT", "MUNIT's\nkeypoints",
    ]  # fmt: skip
    corners = [int(axis.images[0].get_array()[0, 0, 0]) for axis in first]
    assert corners == [7, 107, 107, 57, 57]
    pixels = [axis.images[0].get_array() for axis in first]
    assert (pixels[3] == 57).all() and not (pixels[4] == 57).all()  # keypoints are drawn there


def test_scores_are_the_probes_of_each_translation_on_frames_that_no_training_saw(
    told, tmp_path, monkeypatch
):
    asked = []
    monkeypatch.setattr(translations.tasks, "trained_perception", lambda *_: "MUNIT's")
    monkeypatch.setattr(translations, "probe", lambda *a: asked.append(a) or len(asked))
    assert translations.scores(tmp_path, {"CycleGAN": "avid"}) == {"MUNIT": 1, "CycleGAN": 2}
    assert asked[0] == ("push", "MUNIT's", 2_000_000)
    assert asked[1][0] == "push" and asked[1][1] is Cycled.learn(tmp_path, "avid")


def test_the_demonstration_is_the_first_of_the_human_videos(told):
    assert translations.demo_of("push") is DEMO
