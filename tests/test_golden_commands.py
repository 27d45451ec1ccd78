"""Probes, test episodes and clips on their way are what they were."""

import json
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
import torch

from lbw_minimal.clips.arms import Arms
from lbw_minimal.clips.detector import Found
from lbw_minimal.clips.footage import Footage
from lbw_minimal.clips.reader import Clip
from lbw_minimal.training import InputError
from tasks.commands import eyes, prepare, probe, run
from tasks.commands.choices import Choices
from tests.toy_chance import cells
from tests.toy_clips import arm

# Probes


class Seer:
    """Keypoints that are the pixels, bent, noisy and mixed; a translation moves them."""

    def __init__(self, pixels):
        self.rng = np.random.default_rng(8)
        self.z_E = self.detect(pixels)

    def detect(self, frames):
        z = frames @ np.array([[1.0, 0.3, 0, 0], [0, 1, 0.2, 0], [0.1, 0, 1, 0], [0, 0, 0.5, 1]])
        return (np.sin(z / 70) + self.rng.normal(0, 0.03, z.shape)).reshape(-1, 2, 2)

    def translate(self, frames):
        return frames * (1.05, 1, 0.97, 1) + (2, -1, 0, 1)


def test_a_probe_finds_what_it_found(monkeypatch, golden):
    asked = []

    def record(env, frames, seed):
        asked.extend([frames, seed])
        pixels = np.random.default_rng([seed, env.arm == "human"]).uniform(-2, 86, (frames, 4))
        if env.arm == "human":
            pixels[frames // 2 :, 1] = 30  # in the frames that are held out it rests
        return pixels, pixels

    t = np.arange(40.0)[:, None]
    way = np.hstack([20 + t, 50 - t / 3, np.maximum(32, 26 + t), 40 + 0 * t])
    monkeypatch.setattr(probe, "record_random", record)
    monkeypatch.setattr(probe, "record_expert", lambda env, seed: (asked.append(seed) or way, 0))
    monkeypatch.setattr(probe.tasks, "bare", lambda name, embodiment: SimpleNamespace(
        arm=embodiment, CONTACT=0.04, close=list))  # fmt: skip
    found, figures = probe.probe("push", Seer(way + (0, 0, 3, 0)), 11, 120), {}
    for where in probe.SETS:
        for name, row in found[where].items():
            figures[f"{where} {name}"] = [-9 if row["r2"] is None else row["r2"], row["px"]]
    bend = probe.linear(Seer(way).detect(way), way)
    shown, kept = probe.in_picture(np.arange(40), way - (20, 0, 40, 0))
    golden(
        figures | {"asked": asked, "std": found["keypoint_std"],
                   "contact": list(found["contact_px"].values()), "names": list(found),
                   "linear": bend(Seer(way).detect(way + 1))[::13].ravel(),
                   "in picture": [*shown, *kept.mean(0)]},
        rtol=2e-3, atol=1e-3,
    )  # fmt: skip


# Test episodes


class Scene(gym.Env):
    """Five steps; a success at the third and, if the seed is even, at the last."""

    observation_space = action_space = gym.spaces.Box(-1, 1, (3,), np.float32)

    def __init__(self, ends):
        self.world, self.ends = SimpleNamespace(render=lambda: np.full((2, 2), self.t)), ends

    def reset(self, *, seed=None, options=None):
        self.t, self.seed = 0, seed
        return np.full(3, seed % 100, np.float32), {}

    def step(self, action):
        self.t += 1
        z = np.asarray(action, np.float32) + self.t
        won = (self.t == 3 and self.seed % 3 > 0) or (self.t == 5 and self.seed % 2 == 0)
        over = self.t == 5
        info = {"is_success": won, "reward_parts": {"r": self.t}}
        return z, 0.0, over and self.ends == "terminated", over and self.ends != "terminated", info


@pytest.mark.parametrize("ends", ["terminated", "truncated"])
def test_test_episodes_are_played_and_kept_as_they_were(ends, monkeypatch, golden):
    snaps = []
    scene = SimpleNamespace(
        snap=lambda: snaps.append(1), html=lambda title: f"{title}: {len(snaps)}"
    )
    monkeypatch.setattr(run, "mirror", lambda env: scene)
    asked = []
    agent = SimpleNamespace(act=lambda z, deterministic: asked.append(deterministic) or z / 2)
    rows, first, shown = run.evaluate(agent, Scene(ends), 4)
    golden(
        {"rows": json.dumps(rows), "film": first["frames"], "z": first["z"], "scene": shown,
         "parts": json.dumps(first["parts"]), "asked": [len(asked), *asked]}
    )  # fmt: skip


def a_job(**args):
    given = {"evaluate": False, "jitter": 0.02, "seed": 6, "method": "tracks"}
    return SimpleNamespace(
        name="push", recipe="recipe", demo="demo", weights="w",
        args=SimpleNamespace(**given | args), run=SimpleNamespace(metrics={"stages": {}}),
    )  # fmt: skip


@pytest.mark.parametrize("evaluate", [True, False])
@pytest.mark.parametrize("how", ["learn", "track"])
def test_a_replay_brings_its_policy_and_a_strangers_is_refused(how, evaluate, monkeypatch):
    """One that sees four numbers where three are given."""
    agent, told = SimpleNamespace(sizes={"obs_dim": 3}), []
    env = SimpleNamespace(observation_space=SimpleNamespace(shape=(3,)))
    monkeypatch.setattr(torch, "set_num_threads", told.append)
    monkeypatch.setattr(run, "bring", lambda job, *names: told.append(names))
    monkeypatch.setattr(run.gym, "make", lambda name, jitter: told.append((name, jitter)))
    monkeypatch.setattr(run, "imitate", lambda *a, **k: told.append(k["seed"]) or (agent, env))
    monkeypatch.setattr(run, "follow", lambda made, *a, **k: told.append((a, k)) or (agent, env))
    monkeypatch.setattr(run.tasks, "pace_film", lambda *of: of)
    monkeypatch.setattr(run.tracks, "draw", lambda demo: f"drawn {demo}")
    job = a_job(evaluate=evaluate, reward="mended", without=None)
    act = (lambda: run.learn(job, "seer", "film")) if how == "learn" else lambda: run.track(job)
    done = act()
    assert done[:2] == (agent, env) and told[0] == 1
    assert (("policy",) in told) == evaluate and ("LbW-Push-v0", 0.02) in told
    if how == "track":
        assert done[2] == {"demo": "drawn demo"}
        assert told[-1] == (("demo", ("push", 6, 400), "recipe"), {"seed": 6, "run": job.run})
    agent.sizes["obs_dim"] = 4
    option = "--reward" if how == "learn" else "--method"
    said = f"w: that policy sees 4 numbers, and 3 come with this {option[2:]}; give the {option} "
    with pytest.raises(InputError, match=said):
        act()


def test_a_robots_film_is_of_the_runs_seed_and_its_seconds_are_noted(monkeypatch):
    job, clock = a_job(), iter([10.0, 12.345])
    monkeypatch.setattr(run.time, "monotonic", lambda: next(clock))
    monkeypatch.setattr(run.tasks, "pace_film", lambda *of: of)
    assert run.film_robot(job, 55) == ("push", 6, 55)
    assert job.run.metrics["stages"] == {"robot_video": 2.3}


def test_what_is_told_of_a_training_of_eyes(tmp_path, monkeypatch):
    """Of four cores three learn and one draws; the seconds are whole."""
    asked, threads = [], []
    model = SimpleNamespace(save=asked.append)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(eyes.os, "cpu_count", lambda: 4)
    monkeypatch.setattr(eyes.torch, "set_num_threads", threads.append)
    monkeypatch.setattr(eyes.platform, "machine", lambda: "a laptop")
    monkeypatch.setattr(eyes, "Checkpoint", lambda path: SimpleNamespace(path=path, spent=12.6))
    monkeypatch.setattr(eyes.detector, "train", lambda **how: asked.append(how) or (model, ["row"]))
    told = eyes.learn(30, 4, tmp_path / "eyes.safetensors", "cpu")
    (how, saved), kept = asked, asked[0].pop("checkpoint")
    assert kept.path.as_posix() == "runs/eyes-4.checkpoint" and threads == [3]
    assert how.pop("draw") is eyes.a_clip
    assert how == {"iterations": 30, "seed": 4, "device": "cpu", "workers": 1}
    assert saved == tmp_path / "eyes.safetensors"
    assert told.pop("machine") == f"a laptop, 4 cores, torch {torch.__version__}"
    assert json.dumps(told) == json.dumps({
        "command": "python -m tasks eyes --iterations 30 --seed 4", "seed": 4, "iterations": 30,
        "seconds": 13, "log": ["row"],
    })  # fmt: skip


# A clip on its way


def found(T, width):
    """A hand and a thing that it pushes, with stretches in which neither is sure."""
    hand = np.stack([np.interp(np.arange(T), [0, 5, T - 5], [20, 60, 0.8 * width]),
                     np.interp(np.arange(T), [0, 5], [20, 60])], 1)  # fmt: skip
    thing = np.stack([np.maximum(76, hand[:, 0] + 12), np.full(T, 62.0)], 1)
    return Found(hand, thing, np.where(np.arange(T) == 7, 0.2, 0.9), np.full(T, 0.8))


def test_a_clip_is_searched_with_its_marks_and_its_shorter_side_as_it_was(monkeypatch, golden):
    frames, laid = arm(np.linspace(0, 0.8, 40)), []
    clip = Clip(frames, 1.0 + np.arange(40) / 20, [], [])
    monkeypatch.setattr(
        prepare, "look", lambda sights, frames, cuts, touched: found(len(frames), 160)
    )
    monkeypatch.setattr(prepare, "lay", lambda *what: laid.append(what))
    monkeypatch.setattr(prepare.footage, "check", lambda frames, cuts: Footage(
        255 - frames, ["It trembles."], slice(0, 40), None, True))  # fmt: skip
    monkeypatch.setattr(prepare, "coming_in", lambda sight, off: Arms(1.0, 0.0, 0.3, True, 0.0))
    monkeypatch.setattr(prepare.Sight, "beside", lambda *what: 0.0)
    monkeypatch.setattr(prepare.Sight, "room", lambda *what: 0.0)
    scene = SimpleNamespace(contact=0.04, name="scene")
    result = prepare.Prepared(clip, scene, warnings=["read"])
    marks = Choices(tip=((30.0, 40.0, 1.2), (50.0, 60.0, 1.5)), object=((90.0, 60.0, 2.0),))
    prepare.follow(result, marks)
    (tracks, scene, mirror, _), = laid  # fmt: skip
    golden(
        {"marked": [*tracks.tip[4], *tracks.tip[10], *tracks.object[20]],
         "else": [*tracks.tip[-1], *tracks.object[0], *tracks.tip_sure[[4, -1]]],
         "rest": [tracks.side, *tracks.cuts, tracks.enters, tracks.unmoved, *tracks.times[[0, -1]]],
         "yours": str(tracks.yours), "notes": result.notes, "warnings": result.warnings,
         "clip": result.clip.frames.mean(), "asked": [scene.name, str(mirror)]}
    )  # fmt: skip


def test_a_film_of_the_kits_own_is_told_and_taken_as_it_was(golden):
    first = arm([0.4])[0][:84, :84]
    figures = {}
    for step in (0.04, 0.05, 0.051):
        for off in (11, 12, 13):
            frames = np.repeat(np.clip(first.astype(int) + off, 0, 255)[None], 6, 0).astype(
                np.uint8
            )
            clip = Clip(frames, 2 + np.arange(6) * step, [], [])
            figures[f"{step} {off}"] = prepare.is_own(clip, first)
    wide = first.repeat(2, axis=1)[None].repeat(6, axis=0)  # squeezed it would look the same
    assert not prepare.is_own(Clip(wide, np.arange(6) / 25, [], []), first)
    result = prepare.Prepared(Clip(arm(np.linspace(0.2, 0.7, 9)), 3 + np.cumsum(
        [0, 0.05, 0.03, 0.04, 0.06, 0.02, 0.04, 0.04, 0.05]), [], []), "scene")  # fmt: skip
    prepare.take_as_it_is(result)
    golden({"own": "".join("01"[own] for own in figures.values()), "shape": result.film.shape,
            "film": result.film.mean((1, 2, 3)), "last": cells(result.film[-1].mean(2), 3),
            "notes": result.notes}, atol=0.5)  # fmt: skip


def levels(n, first=0):
    """Frames (n, 84, 84, 3) of one grey each, from `first` on."""
    return np.arange(first, first + n, dtype=np.uint8)[:, None, None, None].repeat(
        84, 1).repeat(84, 2).repeat(3, 3)  # fmt: skip


def test_a_page_shows_the_film_its_translation_and_the_keypoints_of_that(tmp_path, monkeypatch):
    """Seventy frames, of which sixty are shown; a translation adds a hundred."""
    asked = {}
    seer = SimpleNamespace(translate=lambda film: film + 100, detect=lambda film: film[:, 0, 0, 0])
    monkeypatch.setattr(prepare.imitate, "load_perception", lambda *of: asked.update(of=of) or seer)
    monkeypatch.setattr(prepare, "write_page", lambda page, **what: asked.update(what, page=page))
    monkeypatch.setattr(prepare, "links", lambda page: f"links of {page.name}")
    monkeypatch.setattr(prepare, "stills", lambda result: levels(2))
    clip = Clip(levels(5), np.arange(5) / 10, [], [])
    done = SimpleNamespace(motion="reenacted", recording=SimpleNamespace(states="states"))
    note = {"clip": "a.mp4", "corrections": "", "command": "python"}
    result = prepare.Prepared(clip, "scene", "tracks", "motion", done, levels(70), b"film",
                              notes=["read"], warnings=["dark"])  # fmt: skip
    assert prepare.write(tmp_path, "push", result, note, "learn") == tmp_path / "prepare.html"
    film, translated, z = asked.pop("columns")
    shown = asked.pop("shown")
    assert len(shown) == 60 and (shown[0], shown[-1]) == (0, 69)
    np.testing.assert_array_equal(film[:, 0, 0, 0], shown)
    np.testing.assert_array_equal(translated[:, 0, 0, 0], shown + 100)
    np.testing.assert_array_equal(z, shown + 100)
    assert asked.pop("frames") is clip.frames and asked.pop("times") is clip.times
    assert asked == {
        "of": (prepare.tasks.WEIGHTS / "push", "push"), "page": tmp_path / "prepare.html",
        "task": "push", "command": "python", "verdict": "usable, with a warning", "scene": "scene",
        "notes": ["read"], "warnings": ["dark"], "tracks": "tracks", "motion": "reenacted",
        "states": "states", "links": "links of prepare.html", "learn": "learn",
    }  # fmt: skip
    assert (tmp_path / "reenactment.mp4").read_bytes() == b"film"
    assert json.loads((tmp_path / "prepare.json").read_text()) == note
    assert (tmp_path / "stills.webp").exists()
    for before in (prepare.FILM, prepare.NOTE, prepare.STILLS):
        (tmp_path / before).unlink()
    nothing = prepare.Prepared(clip, "scene", motion="laid", why_not="why.")
    prepare.write(tmp_path, "push", nothing, note)
    assert (asked["columns"], asked["shown"], asked["states"]) == ((), None, None)
    assert (asked["motion"], asked["learn"]) == ("laid", "")
    assert asked["verdict"] == "not usable: why."
    assert [file.name for file in tmp_path.iterdir()] == ["prepare.json"]  # whose the page is


def test_a_piece_of_a_clip_is_read_and_keeps_the_clips_own_seconds(monkeypatch, tmp_path):
    """From 2 to 5 s; what was done comes in its order, and a reenactment's film is kept."""
    told, motion = [], SimpleNamespace(notes=["laid"], warnings=["fast"])
    done = SimpleNamespace(notes=["done"], warnings=["slipped"], frames="its frames")
    env = SimpleNamespace(reset=lambda seed: (told.append(seed) or "picture", {}),
                          scene=lambda: "scene", close=lambda: None)  # fmt: skip
    own = SimpleNamespace(clip=None)

    def read(path, **more):
        told.append((path, more))
        start = more["start"] or 0.0
        return Clip(levels(4), np.arange(4) / 10, [], ["read"], ["left out"], start)

    def take(result):
        own.clip = result.clip

    monkeypatch.setattr(prepare.tasks, "bare", lambda name, embodiment: told.append(
        (name, embodiment)) or env)  # fmt: skip
    monkeypatch.setattr(prepare, "read_clip", read)
    monkeypatch.setattr(prepare, "is_own", lambda clip, first: told.append(first) or True)
    monkeypatch.setattr(prepare, "take_as_it_is", take)
    monkeypatch.setattr(prepare, "follow", lambda result, choices: motion)
    monkeypatch.setattr(prepare, "reenact", lambda *of: told.append(of) or done)
    monkeypatch.setattr(prepare, "keep", lambda result, frames: told.append(frames))
    result = prepare.prepare("push", "a.mp4", Choices(first=2.0, last=5.0))
    assert told == [
        ("a.mp4", {"start": 2.0, "end": 5.0}), ("push", "human"), 0, (env, motion), "its frames",
    ]  # fmt: skip
    assert result.clip.times == pytest.approx([2, 2.1, 2.2, 2.3]) and own.clip is None
    assert result.notes == ["read", "laid", "done"] and result.scene == "scene"
    assert result.warnings == ["left out", "fast", "slipped"] and result.done is done
    told.clear()
    whole = prepare.prepare("push", "a.mp4")
    assert told == [("a.mp4", {"start": None, "end": None}), ("push", "human"), 0, "picture"]
    assert own.clip is whole.clip and whole.motion is None and whole.notes == ["read"]


def test_nothing_of_an_earlier_clip_stays_beside_one_that_is_not_usable(tmp_path, monkeypatch):
    monkeypatch.setattr(prepare, "write", lambda out, *what: out / "page")
    monkeypatch.setattr(prepare, "prepare", lambda *what: prepare.Prepared(
        None, None, why_not="no arm."))  # fmt: skip
    clip = tmp_path / "a.mp4"
    names = ("reenactment.mp4", "stills.webp", "prepare.json", "other.txt")
    for file in (clip, *(tmp_path / name for name in names)):
        file.touch()
    assert prepare.main(["push", str(clip), "--out", str(tmp_path)]) == 2
    assert {file.name for file in tmp_path.iterdir()} == {"a.mp4", "prepare.json", "other.txt"}
