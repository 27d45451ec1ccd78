"""What is kept of an episode beside its film: it is played again, and learnt from."""

import os
import subprocess
import sys
from zipfile import BadZipFile

import numpy as np
import pytest

import tasks
from lbw_minimal import video
from lbw_minimal.training import InputError
from tasks.__main__ import main
from tasks.commands import JITTER
from tasks.world import (
    Recording,
    expert_takes,
    film,
    load_recordings,
    random_takes,
    record_expert,
    save_recordings,
)
from tasks.world import recording as recording_module

# The films were made with OpenBLAS's kernels for processors with AVX2, named after Intel's Haswell.
# Others round the arm's linear algebra otherwise, by 1e-20 m, and a contact may make more of it: in
# one of push's experts those for AVX-512 make 0.02 mm.
KERNELS = {"OPENBLAS_CORETYPE": "Haswell"}
KNOWN = np.show_config(mode="dicts")["SIMD Extensions"]["found"]  # by this processor
AS_FILMED = {"slide": 0.01, "coffee": 0.01, "push": 1e-4}  # m, with whatever kernels: at most 0.007
PLAYED_AGAIN = """
import sys
import numpy as np
import tasks
from tasks.world import film, load_recordings

for name in tasks.TASKS:
    env = tasks.bare(name, embodiment="human", observation="state")
    for kept in load_recordings(tasks.VIDEOS / name / "experts.npz")[:: int(sys.argv[1])]:
        _, _, again = film(env, kept.seed, kept.actions, kept.scatter)
        np.testing.assert_array_equal(again.states, kept.states, name)
    env.close()
"""


def shipped(name):
    return load_recordings(tasks.VIDEOS / name / "experts.npz")


@pytest.mark.skipif(
    sys.platform != "linux" or not {"AVX2", "X86_V3"} & set(KNOWN),  # NumPy has two names for it
    reason="needs Linux and a processor with AVX2, with which the films were made",
)
@pytest.mark.parametrize("every", [14, pytest.param(1, marks=pytest.mark.slow)])
def test_with_the_same_kernels_the_experts_go_where_they_went_to_the_last_bit(every):
    line = [sys.executable, "-c", PLAYED_AGAIN, str(every)]
    done = subprocess.run(
        line, cwd=tasks.ROOT, env=os.environ | KERNELS, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("every", [14, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", tasks.TASKS)
def test_the_shipped_experts_played_again_go_where_they_went(name, every):
    experts = shipped(name)
    assert len(experts) == 15
    env = tasks.bare(name, embodiment="human")
    for i in range(0, 15, every):
        seed, scatter, actions, states, times, success = experts[i]
        frames, _, again = film(env, seed, actions, scatter)
        np.testing.assert_allclose(again.states, states, atol=AS_FILMED.get(name, 1e-6))
        np.testing.assert_array_equal(again.times, times)
        assert success[-1] and again.success[-1]
        shown = video.read(tasks.VIDEOS / name / f"expert_{i + 1:02d}.mp4")[0]
        assert differ(frames, shown) < (1e-3 if name in AS_FILMED else 5e-4)
    env.close()


@pytest.mark.parametrize("name", tasks.TASKS)
def test_the_shipped_random_motion_played_again_shows_the_shipped_film(name):
    takes = load_recordings(tasks.VIDEOS / name / "random.npz")
    shown = video.read(tasks.VIDEOS / name / "random.mp4", whole=True)[0]
    assert sum(len(take.states) for take in takes) == len(shown)
    env = tasks.bare(name, embodiment="human")
    for take, part in ((takes[0], shown[:20]), (takes[-1], shown[-len(takes[-1].states) :])):
        frames, _, _ = film(env, take.seed, take.actions, take.scatter)
        assert differ(frames, part) < 5e-4
    env.close()


@pytest.mark.parametrize("name", tasks.TASKS)
def test_the_shipped_motion_is_thought_out_again_from_its_seeds(name):
    """The expert's actions, where random takes start, and what chance does in them."""
    env = tasks.bare(name, embodiment="human", observation="state")
    experts, takes = shipped(name), load_recordings(tasks.VIDEOS / name / "random.npz")
    _, _, again = record_expert(env, experts[0].seed)
    np.testing.assert_allclose(again.actions, experts[0].actions, atol=1e-3)
    for kept in takes[:8]:
        start, _ = env.reset(seed=kept.seed, options={"scatter": True})
        np.testing.assert_allclose(start, kept.states[0], atol=1e-6)
    drawn = random_takes(env, 40, seed=experts[-1].seed + 1, take=20)
    for (_, _, again), kept in zip(drawn, takes[:2], strict=True):
        assert again.seed == kept.seed
        np.testing.assert_allclose(again.actions, kept.actions, atol=1e-6)
    env.close()


def differ(frames, shown):
    """Share of the values that are off by more than 20 grey levels. A video file costs 1e-5 of
    reach's; another expert's film of the ball has 3e-3, a film one frame late 1e-2."""
    return (np.abs(frames.astype(float) - shown) > 20).mean()


def test_a_recording_from_its_file_makes_the_same_film(tmp_path):
    env = tasks.bare("slide", embodiment="human")
    films = [record_expert(env, seed=3), *random_takes(env, 30, seed=5, take=20)]
    save_recordings(tmp_path / "kept.npz", [recording for _, _, recording in films])
    kept = load_recordings(tmp_path / "kept.npz")
    assert [len(recording.states) for recording in kept[1:]] == [20, 10]
    for (frames, pixels, recording), (seed, scatter, actions, *_) in zip(films, kept, strict=True):
        frames_again, pixels_again, again = film(env, seed, actions, scatter)
        np.testing.assert_array_equal(frames_again, frames)
        np.testing.assert_array_equal(pixels_again, pixels)
        for one, other in zip(again, recording, strict=True):
            np.testing.assert_array_equal(one, other)
    env.close()


def test_a_recording_is_what_the_environment_said():
    env = tasks.bare("reach", embodiment="human", observation="state")
    observations, _, recording = record_expert(env, seed=0)
    np.testing.assert_array_equal(recording.states, observations)
    assert recording.actions.shape == (len(observations) - 1, 3)
    assert recording.times[-1] == pytest.approx((len(observations) - 1) / 25)
    near = np.linalg.norm(recording.states[:, 3:6] - recording.states[:, 6:], axis=1) < 0.05
    np.testing.assert_array_equal(recording.success, near)
    env.close()


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_what_is_kept_of_an_action_is_what_was_played_whatever_becomes_of_it(kind):
    """A policy may give the same array again and again, in single or double precision."""
    env = tasks.bare("reach", observation="state")
    action, one_third = np.zeros(3, kind), 1 / 3

    def changing():
        for x in (one_third, -1.0):
            action[0] = x
            yield action

    played, step = [], env.step
    env.step = lambda a: played.append(a.copy()) or step(a)
    *_, recording = film(env, 0, changing())
    assert recording.actions.dtype == np.float32
    np.testing.assert_array_equal(recording.actions[:, 0], np.float32([one_third, -1]))
    np.testing.assert_array_equal(recording.actions, played)
    env.close()


def test_the_same_recordings_make_the_same_file(tmp_path):
    env = tasks.bare("reach", observation="state")
    for name in ("a", "b"):
        save_recordings(tmp_path / name, [record_expert(env, seed=1)[2]])
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    env.close()


def test_a_file_of_recordings_that_is_missing_or_cut_is_named(tmp_path):
    path = tmp_path / "experts.npz"
    with pytest.raises(InputError, match=r"no such file; python -m tasks record"):
        load_recordings(path)
    env = tasks.bare("reach", observation="state")
    save_recordings(path, [record_expert(env, seed=1)[2]])
    env.close()
    whole = path.read_bytes()
    renamed = whole.replace(b"actions", b"notions")
    for other in (b"", b"no recordings", whole[:1000], whole[:-10], renamed):
        path.write_bytes(other)
        with pytest.raises(InputError, match="not a complete file"):
            load_recordings(path)


@pytest.mark.parametrize("error", [BadZipFile, EOFError, KeyError, OSError, ValueError])
def test_whatever_ails_a_file_of_recordings_it_is_named(error, tmp_path, monkeypatch):
    """As zip, NumPy and the disk put it: cut, empty, of other arrays, unreadable, pickled."""

    def fails(path):
        raise error("it is broken")

    path = tmp_path / "experts.npz"
    path.write_bytes(b"x")
    monkeypatch.setattr(np, "load", fails)
    with pytest.raises(InputError, match=r"experts.npz: not a complete file"):
        load_recordings(path)


def test_a_recording_without_a_step_is_one_frame_and_comes_back_from_its_file(tmp_path):
    env = tasks.bare("reach", observation="state")
    frames, pixels, recording = film(env, 5, [])
    assert frames.shape == (1, 9) and pixels.shape == (1, 4)
    assert recording.actions.shape == (0, 3) and not recording.scatter
    save_recordings(tmp_path / "kept.npz", [recording, film(env, 6, [np.zeros(3)])[2], recording])
    kept = load_recordings(tmp_path / "kept.npz")
    assert [(one.seed, len(one.states), len(one.actions)) for one in kept] == [
        (5, 1, 0), (6, 2, 1), (5, 1, 0)
    ]  # fmt: skip
    env.close()


def test_a_file_of_recordings_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr(recording_module, "write_atomic", lambda path, data: written.append(path))
    env = tasks.bare("reach", observation="state")
    save_recordings(tmp_path / "kept.npz", [film(env, 5, [])[2]])
    assert written == [tmp_path / "kept.npz"] and not list(tmp_path.iterdir())
    env.close()


def test_the_robots_experts_are_filmed_as_they_are_learnt_from(tmp_path, monkeypatch):
    monkeypatch.setattr("tasks.ROBOT_EXPERTS", 3)
    monkeypatch.chdir(tmp_path)
    assert main(["record", "reach", "--robot"]) == 0
    folder = tmp_path / "runs" / "robot" / "reach"
    kept = load_recordings(folder / "experts.npz")
    again = list(tasks.robot_experts("reach", JITTER))
    assert len(list(folder.glob("*.mp4"))) == len(kept) == len(again) == 3
    for i, ((frames, recording), in_file) in enumerate(zip(again, kept, strict=True), 1):
        assert recording.success[-1]
        np.testing.assert_array_equal(recording.states, in_file.states)
        assert differ(frames, video.read(folder / f"expert_{i:02d}.mp4")[0]) < 5e-4
    starts = {tuple(recording.states[0, [0, 2]]) for recording in kept}
    assert len(starts) == 3  # no two start alike
    home = np.array(tasks.module("reach").Reach.START)[[0, 2]]
    assert max(np.abs(np.array(start) - home).max() for start in starts) < JITTER + 1e-3  # m


def test_a_take_that_fails_at_its_end_is_filmed_again(monkeypatch):
    def take(env, seed):
        success = np.array([True, seed % 2 == 1])  # done on the way is not enough
        return None, None, Recording(seed, False, None, None, None, success)

    monkeypatch.setattr("tasks.world.motion.record_expert", take)
    assert [recording.seed for _, _, recording in expert_takes(None, 3)] == [1, 3, 5]


def test_an_expert_that_fails_two_of_three_times_is_given_up(monkeypatch):
    take = None, None, Recording(0, False, None, None, None, np.array([True, False]))
    tried = []
    monkeypatch.setattr("tasks.world.motion.record_expert", lambda *a: tried.append(a) or take)
    with pytest.raises(InputError, match="nonetype: its expert succeeds in 0 of 6 tries"):
        list(expert_takes(None, 2))
    assert len(tried) == 6


def features(states):
    """Where tip and object are along x and z (T, 9) -> and all products of two of them (T, 15)."""
    x = np.concatenate([np.ones((len(states), 1)), states[:, [0, 2, 3, 5]]], axis=1)
    i, j = np.triu_indices(5)
    return x[:, i] * x[:, j]


def test_the_robot_reaches_the_ball_by_the_humans_recorded_actions():
    """Behaviour cloning by least squares. The mean action passes the ball and goes on."""
    experts = shipped("reach")
    x = np.concatenate([features(recording.states[:-1]) for recording in experts])
    actions = np.concatenate([recording.actions for recording in experts])
    W = np.linalg.lstsq(x, actions, rcond=None)[0]

    env = tasks.bare("reach", observation="state", jitter=0.005)
    for seed in range(3):
        ends = []
        for policy in (lambda state: features(state[None])[0] @ W, lambda _: actions.mean(0)):
            state, _ = env.reset(seed=seed)
            for _ in range(50):
                state, *_ = env.step(policy(state))
            ends.append(env.distance())
        assert ends[0] < 0.02 and ends[1] > 0.05  # m
    env.close()
