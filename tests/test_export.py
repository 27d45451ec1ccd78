"""The experts as a Minari dataset: what is refused, and what Minari reads back."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

import tasks
from lbw_minimal.training import InputError
from tasks.__main__ import main
from tasks.commands import export
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


@pytest.fixture
def told(monkeypatch):
    """What Minari is told, without Minari; of two recordings, each of two steps."""
    told = {"films": [], "closed": 0}

    class Path:
        def exists(self):
            return told.get("exists", False)

    def create(dataset, episodes, **more):
        told.update(dataset=dataset, episodes=episodes, **more)

    fakes = {
        "h5py": {}, "minari": {"create_dataset_from_buffers": create},
        "minari.data_collector": {"EpisodeBuffer": lambda **what: what},
        "minari.storage": {"get_dataset_path": lambda dataset: Path()},
    }  # fmt: skip
    for name, has in fakes.items():
        monkeypatch.setitem(sys.modules, name, SimpleNamespace(**has))

    def film(env, seed, actions, scatter):
        told["films"].append((env.arm, seed, len(actions), scatter))
        fails = seed == told.get("fails")  # or rather loses at its end what it had
        success = np.array([False, fails, not fails])
        state, time = np.zeros((3, 9)), np.arange(3) / 25
        done = SimpleNamespace(success=success, actions=actions, states=state, times=time)
        return f"film {seed}", None, done

    def bare(name, embodiment="robot"):
        return SimpleNamespace(arm=embodiment, close=lambda: told.update(closed=1))

    played = [(seed, f"scatter {seed}", np.zeros((2, 3)), "more") for seed in (4, 5)]
    monkeypatch.setattr(export, "load_recordings", lambda path: played)
    monkeypatch.setattr(export, "film", film)
    monkeypatch.setattr(export.tasks, "bare", bare)
    return told


def test_an_episode_is_the_humans_played_again_with_the_environments_rewards(told, capsys):
    """It is cut off at its end, where the expert has finished, and ends nowhere by itself."""
    export.main(["push"])
    assert told["films"] == [("human", 4, 2, "scatter 4"), ("human", 5, 2, "scatter 5")]
    assert told["dataset"] == "lbw/push/human-v0" and told["env"].arm == "human" and told["closed"]
    assert told["eval_env"] == "LbW-Push-v0" and not told["jpeg_encoding"]
    first, _ = told["episodes"]
    assert (first["seed"], first["observations"]) == (4, "film 4")
    assert first["rewards"].tolist() == [0.0, 1.0]  # of each step, not of the start
    assert first["terminations"] == [False, False] and first["truncations"] == [False, True]
    assert first["infos"]["is_success"].tolist() == [False, False, True]
    assert "push: 2 episodes" in capsys.readouterr().out


def test_nothing_is_exported_twice_or_of_an_expert_that_fails(told):
    told["fails"] = 5
    with pytest.raises(InputError, match="played again, seed 5 fails"):
        export.main(["push"])
    told["exists"] = True
    with pytest.raises(InputError, match="minari delete lbw/push/human-v0"):
        export.main(["push"])
    assert "dataset" not in told
