"""The benchmark's arithmetic, by a clock that the contestants turn themselves."""

from types import SimpleNamespace

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from tasks.commands import bench


@pytest.fixture
def clock(monkeypatch):
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr(bench, "time", SimpleNamespace(perf_counter=lambda: clock.now))
    return clock


def test_contestants_take_turns_and_the_median_of_the_rounds_counts(capsys):
    """A slow round slows both: ratios are taken round by round."""
    turns, rates = [], {"push (ours)": [8, 8, 2, 8, 8], "peer": [4, 4, 1, 4, 2]}

    def contestant(name):
        def measure(seconds):
            turns.append((name, seconds))
            return rates[name].pop(0)

        return measure

    bench.contest("a step", {name: contestant(name) for name in rates}, 10)
    assert turns == 5 * [("push (ours)", 2.0), ("peer", 2.0)]
    head, ours, peer = capsys.readouterr().out.strip().splitlines()
    assert head == "a step, times a second (10 s for each)"
    assert ours.split() == ["push", "(ours)", "8.0"]
    assert peer.split() == ["peer", "4.0", "push", "(ours):", "2.0", "times", "as", "fast"]


def test_what_a_training_takes_to_start_is_not_counted(clock):
    asked = []

    def train(*videos, iterations, seed):
        asked.append((videos, iterations, seed))
        clock.now += 5 + 0.5 * iterations

    assert bench.iterations(train, "human", "robot")(1.0) == pytest.approx(2)
    assert asked == [(("human", "robot"), 3, 0), (("human", "robot"), 9, 0)]


def test_calls_are_counted_after_the_first(clock):
    times = iter([30, *[0.5] * 20])

    def do():
        clock.now += next(times)

    assert bench.calls(do)(4.0) == pytest.approx(2)


def test_updates_are_of_the_size_that_a_policy_on_five_keypoints_has(monkeypatch):
    seen = []

    def update(self, batch):
        seen.append({k: tuple(v.shape) for k, v in batch.items()} | {"sizes": self.sizes})

    monkeypatch.setattr(bench.sac.SAC, "update", update)
    monkeypatch.setattr(bench, "calls", lambda do: do)
    bench.our_updates(256)()
    assert seen[0]["obs"] == seen[0]["next_obs"] == (128, 41) and seen[0]["action"] == (128, 3)
    assert seen[0]["sizes"] == {"obs_dim": 41, "action_dim": 3, "width": 256}


def test_noise_is_an_environment_of_that_size():
    check_env(bench.Noise(), skip_render_check=True)
    env = bench.Noise()
    assert not env.reset(seed=0)[0].any()
    steps = np.stack([env.step(np.zeros(3))[0] for _ in range(500)])
    assert steps.std() == pytest.approx(1, abs=0.02)


def test_a_peer_that_is_filmed_renders_at_every_step():
    class Peer(bench.Noise):
        frames = 0

        def render(self):
            self.frames += 1

    peer = Peer()
    filmed = bench.Filmed(peer)
    filmed.reset(seed=0)
    assert filmed.step(np.zeros(3))[1] == 0 and peer.frames == 1


def test_each_kind_of_work_is_measured_for_as_long_as_asked(monkeypatch):
    """With frames and without, for each task; two translations, Transporter, SAC twice as wide."""
    asked = []
    monkeypatch.setattr(bench, "contest", lambda *what: asked.append(what))
    monkeypatch.setattr(bench, "peers", lambda filmed: {f"a peer, filmed {filmed}": None})
    monkeypatch.setattr(bench, "our_env", lambda task, filmed: (task, filmed))
    monkeypatch.setattr(bench, "env_steps", lambda env: env)
    monkeypatch.setattr(bench, "iterations", lambda train, *videos: (train, len(videos)))
    monkeypatch.setattr(bench, "our_updates", lambda width: width)
    monkeypatch.setattr(bench, "sb3_updates", lambda width: {"stable-baselines3 SAC": width})
    bench.main(["--seconds", "7"])
    assert [what for what, _, _ in asked] == [
        "a step with an 84x84 frame", "a step without a frame", "an iteration of a translation",
        "an iteration of Transporter", "an update of SAC, width 128, batch 128",
        "an update of SAC, width 256, batch 128",
    ]  # fmt: skip
    assert {seconds for *_, seconds in asked} == {7}
    steps, translations = asked[0][1], asked[2][1]
    assert next(iter(steps)) == "push (ours)" and steps["slide (ours)"] == ("slide", True)
    assert len(steps) == 6 and "a peer, filmed True" in steps
    assert translations["CycleGAN (ours)"] == (bench.cyclegan.train, 2)
    assert asked[3][1] == {"ours": (bench.transporter.train, 1)}
    assert asked[5][1] == {"ours": 256, "stable-baselines3 SAC": 256}


def test_a_peer_that_is_not_there_is_named_with_its_package(capsys):
    assert bench.installed("json", "json")
    assert not bench.installed("no_such_module", "no-such-package")
    assert "pip install no-such-package" in capsys.readouterr().out
