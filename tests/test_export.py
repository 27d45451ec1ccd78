"""The experts as a Minari dataset: what is refused, and what Minari reads back."""

import sys

import numpy as np
import pytest

import tasks
from tasks.__main__ import main
from tasks.world import load_recordings, record_expert, save_recordings


@pytest.fixture
def two_experts(tmp_path, monkeypatch):
    """Two recordings of reach where the kit keeps its own, and a folder for Minari's data."""
    monkeypatch.setattr("tasks.VIDEOS", tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    (tmp_path / "reach").mkdir()
    env = tasks.bare("reach", embodiment="human", observation="state")
    experts = [record_expert(env, seed)[2] for seed in (3, 5)]
    env.close()
    save_recordings(tmp_path / "reach" / "experts.npz", experts)
    return experts


def refused(capfd):
    assert main(["export", "reach"]) == 2
    out, err = capfd.readouterr()
    assert out == "" and err.startswith("error: ") and err.count("\n") == 1
    return err


def test_without_recordings_it_says_who_makes_them(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr("tasks.VIDEOS", tmp_path)
    assert "python -m tasks record" in refused(capfd)


def test_without_minari_it_says_how_to_get_it(two_experts, monkeypatch, capfd):
    monkeypatch.setitem(sys.modules, "minari", None)
    assert "pip install 'minari[hdf5]'" in refused(capfd)


@pytest.mark.peers
def test_minari_reads_back_what_the_environment_shows_again(two_experts, capfd):
    minari = pytest.importorskip("minari", reason="needs Minari: make peers")
    assert main(["export", "reach"]) == 0
    assert "minari.load_dataset('lbw/reach/human-v0')" in capfd.readouterr().out
    assert "minari delete lbw/reach/human-v0" in refused(capfd)

    dataset = minari.load_dataset("lbw/reach/human-v0")
    seeds = [episode["seed"] for episode in dataset.storage.get_episode_metadata([0, 1])]
    env = dataset.recover_environment()
    assert seeds == [3, 5] and env.unwrapped.embodiment == "human"
    assert dataset.recover_environment(eval_env=True).unwrapped.embodiment == "robot"
    for expert, seed, episode in zip(two_experts, seeds, dataset, strict=True):
        np.testing.assert_array_equal(episode.actions, expert.actions)
        np.testing.assert_array_equal(episode.infos["state"], expert.states)
        np.testing.assert_array_equal(episode.infos["time"], expert.times)
        assert not episode.terminations.any()
        assert np.flatnonzero(episode.truncations).tolist() == [len(expert.actions) - 1]
        frame, info = env.reset(seed=seed)
        np.testing.assert_array_equal(episode.observations[0], frame)
        for i, action in enumerate(episode.actions):
            frame, reward, _, _, info = env.step(action)
            np.testing.assert_array_equal(episode.observations[i + 1], frame)
            assert episode.rewards[i] == reward
            assert episode.infos["is_success"][i + 1] == info["is_success"]
        assert info["is_success"]


@pytest.mark.peers
def test_a_recording_that_no_longer_does_the_task_is_not_exported(two_experts, capfd, tmp_path):
    pytest.importorskip("minari", reason="needs Minari: make peers")
    still = two_experts[1]._replace(actions=np.zeros_like(two_experts[1].actions))
    save_recordings(tasks.VIDEOS / "reach" / "experts.npz", [two_experts[0], still])
    assert "seed 5 fails" in refused(capfd)
    assert not (tmp_path / "minari" / "lbw").exists()


@pytest.mark.peers
def test_minari_holds_all_the_shipped_experts_of_push(tmp_path, monkeypatch):
    minari = pytest.importorskip("minari", reason="needs Minari: make peers")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    assert main(["export", "push"]) == 0
    experts = load_recordings(tasks.VIDEOS / "push" / "experts.npz")
    dataset = minari.load_dataset("lbw/push/human-v0")
    assert dataset.total_episodes == 15
    assert dataset.total_steps == sum(len(expert.actions) for expert in experts)
