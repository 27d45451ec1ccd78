"""The figures of `eyes` by hand, and the truth that each kind of clip is held against."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

import tasks
from lbw_minimal.clips.detector import Found
from lbw_minimal.training import InputError
from tasks.commands import eyes
from tasks.commands.eyes import Seen, compare
from tasks.world import load_recordings

NAN = float("nan")


def seen(unit=1.0, off=(), sure=(), there=()):
    """A clip whose tip is found `off` pixels to the right of 10, and whose object is nowhere."""
    n = len(off)
    truth = np.where(np.array(there, bool)[:, None], [10.0, 10.0], NAN)
    place = np.stack([10 + np.array(off, float), np.full(n, 10.0)], 1)
    nowhere = np.full((n, 2), NAN)
    found = Found(place, np.zeros((n, 2)), np.array(sure, float), np.zeros(n))
    return Seen(found, truth, nowhere, unit)


def test_errors_are_of_what_is_there_and_found_and_shares_of_what_is_or_is_not_there():
    """Of six frames four show the tip; three of these are found, 1, 2 and 3 pixels off.

    One of the two that do not show it is taken for it. Nine tenths between 2 and 3 are 2.8.
    """
    clip = seen(
        off=(1, 2, 3, 50, 7, 7), sure=(0.9, 0.6, 1, 0.4, 0.8, 0.1), there=(1, 1, 1, 1, 0, 0)
    )
    figures = compare([clip])
    assert figures["tip"] == {"frames": 4, "px": 2.0, "p90": 2.8, "found": 0.75, "false": 0.5}
    assert figures["object"] == {"frames": 0, "false": 0.0}


def test_pixels_are_those_of_a_frame_of_84_whatever_the_clips_size():
    large = seen(unit=4.0, off=(8, 8), sure=(1, 1), there=(1, 1))
    assert compare([large])["tip"] == {"frames": 2, "px": 2.0, "p90": 2.0, "found": 1.0}
    small = seen(off=(1,), sure=(1,), there=(1,))
    assert compare([large, small])["tip"]["px"] == 2.0
    assert compare([large, small, small, small])["tip"]["px"] == 1.0


class Model:
    """A detector that says where it looked."""

    def detect(self, frames):
        n = len(frames)
        return Found(np.zeros((n, 2)), np.ones((n, 2)), np.full(n, 0.9), np.full(n, 0.1))


def test_drawings_to_measure_on_are_of_seeds_that_no_training_reaches(monkeypatch):
    seeds = []
    clip = SimpleNamespace(frames=np.zeros((2, 84, 84, 3), np.uint8), tip=0, object=1)
    monkeypatch.setattr(eyes.np.random, "default_rng", lambda seed: seeds.append(seed))
    drawn = list(eyes.made(Model(), lambda rng: clip))
    assert len(drawn) == 100 and (drawn[0].tip, drawn[0].object, drawn[0].unit) == (0, 1, 1.0)
    assert min(first for first, _ in seeds) >= 1_000_000 and len({i for _, i in seeds}) == 100


def test_half_of_the_clips_to_learn_from_are_rendered(monkeypatch):
    monkeypatch.setattr(eyes, "render_clip", lambda rng: "rendered")
    monkeypatch.setattr(eyes, "draw_clip", lambda rng: "drawn")
    some = [eyes.a_clip(np.random.default_rng([0, i])) for i in range(400)]
    assert 160 < some.count("rendered") < 240 and set(some) == {"rendered", "drawn"}


@pytest.mark.parametrize("task", ["push", "reach"])
def test_the_truth_of_the_kits_videos_is_where_the_camera_sees_the_recorded_states(
    task, monkeypatch
):
    recording = load_recordings(tasks.VIDEOS / task / "experts.npz")[0]
    frames = np.zeros((len(recording.states), 84, 84, 3), np.uint8)
    read, refined = [], []
    monkeypatch.setattr(eyes.video, "read", lambda path: (read.append(path.name) or frames, []))
    monkeypatch.setattr(eyes.detector, "refine", lambda *what: refined.append(what) or what[1])
    (clip,) = eyes.filmed(Model(), task, most=1)
    env = tasks.bare(task, embodiment="human", observation="state")
    tip, thing = (env.world.pixel(recording.states[5, k : k + 3]) for k in (0, 3))
    env.close()
    assert read == ["expert_01.mp4"] and clip.unit == 1
    assert refined[0][0] is frames and refined[0][1] is clip.found
    np.testing.assert_allclose(clip.tip[5], tip)
    if task == "reach":  # it has no object
        assert np.isnan(clip.object).all()
    else:
        np.testing.assert_allclose(clip.object[5], thing)


def test_a_marked_clip_is_compared_in_its_marked_frames(tmp_path, monkeypatch):
    path = tmp_path / "clip.mp4"
    out = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"mp4v"), 25, (168, 96))
    for _ in range(5):
        out.write(np.full((96, 168, 3), (250, 20, 20), np.uint8))  # blue, as OpenCV counts
    out.release()
    looked = []

    class Counts(Model):
        def detect(self, frames):
            looked.append(frames)
            found = super().detect(frames)
            found.tip[:, 0] = np.arange(len(frames))
            return found

    monkeypatch.setattr(eyes.detector, "refine", lambda frames, found: found)
    marks = [
        {"frame": 3, "tip": [30, 40], "object": None},
        {"frame": 1, "tip": None, "object": [5, 6]},
    ]
    clip = eyes.marked(Counts(), path, {"size": [168, 96], "marks": marks})
    assert clip.unit == 2 and clip.found.tip[:, 0].tolist() == [3, 1]
    np.testing.assert_array_equal(clip.tip, [[30, 40], [NAN, NAN]])
    np.testing.assert_array_equal(clip.object, [[NAN, NAN], [5, 6]])
    assert looked[0].shape == (5, 96, 168, 3) and looked[0][0, 0, 0].argmax() == 2
    with pytest.raises(InputError, match="no clip that can be read"):
        eyes.marked(Model(), tmp_path / "none.mp4", {"size": [1, 1], "marks": []})
