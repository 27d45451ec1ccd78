"""What every training shares: states come back whole or not at all, and a kill costs little."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from lbw_minimal import training
from lbw_minimal.training import (
    Checkpoint,
    InputError,
    load_state,
    pick_device,
    quantity,
    save_state,
    seed_everything,
)

ROOT = Path(__file__).resolve().parent.parent


def round_trip(path, state):
    save_state(path / "state", state)
    return load_state(path / "state")


def test_one_thing_is_no_plural():
    assert [quantity(n, "frame") for n in range(3)] == ["0 frames", "1 frame", "2 frames"]


def test_nested_state_comes_back(tmp_path):
    state = {"a": {"b": [1, 2.5, None, True, "text"], "c": {}}, "d": [[], [{"e": -1}]]}
    assert round_trip(tmp_path, state) == state


def test_integer_keys_stay_integers_and_texts_stay_texts(tmp_path):
    assert round_trip(tmp_path, {0: "zero", "0": "text", 17: {3: "three"}}) == {
        0: "zero",
        "0": "text",
        17: {3: "three"},
    }


def test_tuples_come_back_as_lists(tmp_path):
    assert round_trip(tmp_path, {"betas": (0.5, 0.999)}) == {"betas": [0.5, 0.999]}


@pytest.mark.parametrize(
    "dtype", [torch.float32, torch.float64, torch.bfloat16, torch.int64, torch.uint8, torch.bool]
)
def test_tensors_keep_type_shape_and_every_bit(tmp_path, dtype):
    value = (torch.randn(3, 1, 5) * 10).to(dtype)
    back = round_trip(tmp_path, {"w": value, "scalar": value[0, 0, 0], "none": value[:0]})
    assert back["w"].dtype == dtype and torch.equal(back["w"], value)
    assert back["scalar"].shape == () and back["none"].shape == (0, 1, 5)


def test_arrays_come_back_as_tensors(tmp_path):
    back = round_trip(tmp_path, {"frames": np.arange(6, dtype=np.uint8).reshape(2, 3)})["frames"]
    assert torch.equal(back, torch.arange(6, dtype=torch.uint8).reshape(2, 3))


def test_two_names_of_one_tensor_and_slices_of_another_are_allowed(tmp_path):
    w = torch.arange(12.0).reshape(3, 4)
    back = round_trip(tmp_path, {"a": w, "b": w, "column": w[:, 1], "turned": w.T})
    assert torch.equal(back["a"], back["b"]) and torch.equal(back["turned"], w.T)
    assert back["column"].tolist() == [1, 5, 9]


def test_numpy_generator_goes_on_where_it_was(tmp_path):
    rng = np.random.default_rng(0)
    rng.random(7)
    state = round_trip(tmp_path, {"rng": rng.bit_generator.state})
    other = np.random.default_rng(1)
    other.bit_generator.state = state["rng"]
    assert np.array_equal(other.random(5), rng.random(5))


def learner():
    torch.manual_seed(0)
    model = torch.nn.Linear(3, 2)
    return model, torch.optim.AdamW(model.parameters(), lr=0.1, betas=(0.5, 0.999))


def learn(model, optimizer, steps):
    for _ in range(steps):
        optimizer.zero_grad()
        model(torch.randn(4, 3)).square().mean().backward()
        optimizer.step()


def test_optimizer_goes_on_where_it_was(tmp_path):
    model, optimizer = learner()
    learn(model, optimizer, 3)
    state = round_trip(tmp_path, {"model": model.state_dict(), "optimizer": optimizer.state_dict()})
    twin, twin_optimizer = learner()
    twin.load_state_dict(state["model"])
    twin_optimizer.load_state_dict(state["optimizer"])
    for pair in ((model, optimizer), (twin, twin_optimizer)):
        torch.manual_seed(1)
        learn(*pair, 3)
    assert torch.equal(model.weight, twin.weight)


def test_file_cut_short_anywhere_is_refused_by_name(tmp_path):
    save_state(tmp_path / "whole", {"w": torch.randn(50), "log": [{"step": 1}]})
    whole, cut = (tmp_path / "whole").read_bytes(), tmp_path / "cut.safetensors"
    for length in [*range(0, len(whole), 7), len(whole) - 1]:
        cut.write_bytes(whole[:length])
        with pytest.raises(
            InputError, match=r"cut\.safetensors: not a complete weights file; delete it and train"
        ):
            load_state(cut)


@pytest.mark.parametrize(
    "content", [b"", b"this is text\n" * 50, bytes(range(256))], ids=["empty", "text", "bytes"]
)
def test_file_of_another_kind_is_refused_by_name(tmp_path, content):
    (tmp_path / "other").write_bytes(content)
    with pytest.raises(InputError, match="other: not a complete weights file"):
        load_state(tmp_path / "other")


def test_weights_of_another_program_are_refused_by_name(tmp_path):
    (tmp_path / "other").write_bytes(training.save({"w": torch.zeros(3)}))
    with pytest.raises(InputError, match="other: not a complete weights file"):
        load_state(tmp_path / "other")


def test_missing_file_is_refused_by_name(tmp_path):
    with pytest.raises(InputError, match="nowhere: there is no such file; train first"):
        load_state(tmp_path / "nowhere")


def test_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    save_state(tmp_path / "state", {"step": 1})

    def full(_):
        raise OSError("No space left on device")

    monkeypatch.setattr(training.os, "fsync", full)
    with pytest.raises(OSError):
        save_state(tmp_path / "state", {"step": 2})
    assert load_state(tmp_path / "state") == {"step": 1}


KILL_TWENTY_TIMES = """
import itertools, os, random, signal, sys, time
import torch
from lbw_minimal.training import load_state, save_state

torch.set_num_threads(1)  # a forked process has no pool of threads
path, chance, seen = sys.argv[1], random.Random(0), -1
save_state(path, {"step": -1, "w": torch.full((500_000,), -1.0)})
for _ in range(20):
    child = os.fork()
    if not child:
        for step in itertools.count(seen + 1):
            save_state(path, {"step": step, "w": torch.full((500_000,), float(step))})
    time.sleep(chance.uniform(0.02, 0.1))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    state = load_state(path)
    assert (state["w"] == state["step"]).all() and state["step"] >= seen
    seen = state["step"]
print(seen)
"""


def test_kill_during_a_write_leaves_the_old_state_or_the_new_one(tmp_path):
    run = [sys.executable, "-c", KILL_TWENTY_TIMES, tmp_path / "state"]
    done = subprocess.run(run, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 0  # it did write


class Clock:
    def __init__(self, monkeypatch):
        self.now = 1000.0
        monkeypatch.setattr(training.time, "monotonic", lambda: self.now)


@pytest.mark.parametrize(
    ("seconds", "saved"), [({}, [21, 42]), ({"seconds": 9}, [10, 20, 30, 40, 50])]
)
def test_checkpoint_saves_only_when_its_seconds_have_passed(tmp_path, monkeypatch, seconds, saved):
    """Twenty, if nobody says how many."""
    clock, made = Clock(monkeypatch), []
    checkpoint = Checkpoint(tmp_path / "state", **seconds)
    for second in range(60):
        clock.now = 1000.0 + second
        checkpoint.save(lambda second=second: made.append(second) or {"second": second})
    assert made == saved


def test_forced_checkpoint_does_not_wait(tmp_path):
    checkpoint = Checkpoint(tmp_path / "state", seconds=1e9)
    checkpoint.save(lambda: {"step": 1})
    assert checkpoint.load() is None
    checkpoint.save(lambda: {"step": 2}, force=True)
    assert checkpoint.load() == {"step": 2}


def test_checkpoint_without_a_path_never_makes_a_state(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    checkpoint = Checkpoint(None, seconds=0)
    checkpoint.save(lambda: pytest.fail("made a state"), force=True)
    assert checkpoint.load() is None and list(tmp_path.iterdir()) == []


def test_resume_brings_networks_generators_and_variables_back(tmp_path):
    model, optimizer = learner()
    rng = np.random.default_rng(0)
    parts = {"model": model, "optimizer": optimizer, "rng": rng}
    checkpoint = Checkpoint(tmp_path / "state")
    now, state = checkpoint.resume(parts, step=0, log=[])
    learn(model, optimizer, 2)
    now.step, now.log = 2, [{"loss": 0.5}]
    checkpoint.save(state, force=True)
    drawn = rng.random(3)

    twin, twin_optimizer = learner()
    other = np.random.default_rng(9)
    parts = {"model": twin, "optimizer": twin_optimizer, "rng": other}
    then, _ = Checkpoint(tmp_path / "state").resume(parts, step=0, log=[])
    assert (then.step, then.log) == (2, [{"loss": 0.5}])
    assert torch.equal(model.weight, twin.weight) and np.array_equal(other.random(3), drawn)
    torch.manual_seed(1)
    learn(model, optimizer, 1)
    torch.manual_seed(1)
    learn(twin, twin_optimizer, 1)
    assert torch.equal(model.weight, twin.weight)


def test_resume_without_a_file_starts_anew():
    rng = np.random.default_rng(0)
    now, state = Checkpoint(None).resume({"rng": rng}, step=0, log=[])
    assert vars(now) == {"step": 0, "log": []}
    now.step += 1
    assert state() == {"rng": rng.bit_generator.state, "step": 1, "log": []}


def test_resumed_training_draws_the_same_random_numbers(tmp_path):
    torch.manual_seed(5)
    Checkpoint(tmp_path / "state").save(dict, force=True)
    drawn = torch.randn(4)
    torch.manual_seed(6)
    Checkpoint(tmp_path / "state").load()
    assert torch.equal(torch.randn(4), drawn)


def test_time_spent_counts_the_sittings_and_not_the_break_between(tmp_path, monkeypatch):
    clock = Clock(monkeypatch)
    first = Checkpoint(tmp_path / "state")
    clock.now += 30
    first.save(dict, force=True)
    clock.now += 5000  # killed, and started again later
    second = Checkpoint(tmp_path / "state")
    second.load()
    clock.now += 12
    assert second.spent == 42


def test_same_seed_gives_the_same_numbers_in_torch_and_numpy():
    first, second = ((seed_everything(3).random(), torch.rand(1).item()) for _ in range(2))
    assert first == second


@pytest.mark.parametrize("name", ["cuda", "cuda:1"])
def test_cuda_is_refused_where_there_is_none(monkeypatch, name):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(
        InputError, match=f"--device {name}: this machine has no CUDA device; use --device cpu"
    ):
        pick_device(name)


def test_unknown_device_is_refused():
    with pytest.raises(
        InputError, match="--device toaster: torch knows no such device; use cpu or cuda"
    ):
        pick_device("toaster")


def test_cpu_is_a_device():
    assert pick_device("cpu") == torch.device("cpu")


def test_a_wait_shows_a_bar_and_a_moment_does_not(capsys, monkeypatch):
    things = training.counted(iter("abc"), 3, "letters")
    assert list(things) == ["a", "b", "c"] and not capsys.readouterr().err
    real = training.progress
    monkeypatch.setattr(training, "progress", lambda *a, delay: real(*a))  # 3 s have gone by
    assert list(training.counted(iter("abc"), 3, "letters"))
    assert "letters: 100%" in capsys.readouterr().err


# What it says and does to the letter --------------------------------------------------------------


def test_a_file_is_written_beside_its_place_and_put_there_when_it_is_safe(tmp_path, monkeypatch):
    """A text as UTF-8, bytes as they are; by another name until all of it is on the disk."""
    done, path = [], tmp_path / "a.json"
    real = training.os.fsync, training.os.replace

    def there():
        return sorted(file.name for file in tmp_path.iterdir())

    def fsync(f):
        done.append(("safe", there(), (tmp_path / ".a.json.part").read_bytes()))
        real[0](f)

    def replace(old, new):
        done.append(("put", Path(old).name, Path(new).name))
        real[1](old, new)

    monkeypatch.setattr(training.os, "fsync", fsync)
    monkeypatch.setattr(training.os, "replace", replace)
    training.write_atomic(str(path), "ü\n")
    assert done == [
        ("safe", [".a.json.part"], "ü\n".encode()),
        ("put", ".a.json.part", "a.json"),
    ]
    training.write_atomic(path, b"\r\n\xff")
    assert path.read_bytes() == b"\r\n\xff" and there() == ["a.json"]


def test_all_that_a_state_may_hold_comes_back_as_what_it_was(tmp_path):
    state = {
        "none": None, "yes": True, "text": "a/b", "deep": {1: {"x": [1.5, (2, "c")]}, "1": -3},
        "array": np.arange(6, dtype=np.int16).reshape(2, 3)[:, ::2].copy(),
        "view": torch.arange(6.0).reshape(2, 3).T, "scalar": torch.tensor(7),
        "learnt": torch.ones(2, requires_grad=True) * 2, "empty": {}, "nothing": [],
        "here": [torch.zeros(1), {"t": torch.ones(1)}],
    }  # fmt: skip
    save_state(tmp_path / "s", state)
    back = load_state(tmp_path / "s")
    assert list(back) == list(state)
    assert (back["none"], back["yes"], back["text"]) == (None, True, "a/b")
    assert back["deep"] == {1: {"x": [1.5, [2, "c"]]}, "1": -3}
    assert back["array"].dtype == torch.int16 and back["array"].tolist() == [[0, 2], [3, 5]]
    assert back["view"].tolist() == [[0, 3], [1, 4], [2, 5]] and back["scalar"].item() == 7
    assert back["learnt"].tolist() == [2, 2] and not back["learnt"].requires_grad
    assert (back["empty"], back["nothing"]) == ({}, [])
    assert back["here"][0].tolist() == [0] and back["here"][1]["t"].tolist() == [1]


def test_weights_of_another_kind_or_task_are_named_with_the_remedy(tmp_path):
    path = tmp_path / "w"
    save_state(path, {"kind": "munit", "task": "push", "w": 1})
    assert training.load_weights(path, "munit", "a MUNIT", "push")["w"] == 1
    assert training.load_weights(path, "munit", "a MUNIT", None)["w"] == 1
    for kind, task, what in (
        ("sac", "push", "not the weights of a policy; give the file that its training wrote."),
        (
            "munit", "slide",
            "weights of the task push, not of slide; give those of slide or train anew.",
        ),
    ):  # fmt: skip
        with pytest.raises(InputError) as told:
            training.load_weights(path, kind, "a policy", task)
        assert str(told.value) == f"{path}: {what}"
    save_state(path, {"w": 1})
    with pytest.raises(InputError, match="not the weights of a policy"):
        training.load_weights(path, "sac", "a policy", None)
    for ruined in (b"", b"\0" * 40):
        path.write_bytes(ruined)
        with pytest.raises(InputError) as told:
            load_state(path)
        assert str(told.value) == f"{path}: not a complete weights file; delete it and train again."
    with pytest.raises(InputError) as told:
        load_state(tmp_path)  # a folder
    assert str(told.value) == (
        f"{tmp_path}: there is no such file; train first or give another path."
    )


@pytest.mark.parametrize(("system", "most"), [("linux", 7 * 1024), ("darwin", 7)])
def test_a_systems_memory_is_told_in_bytes(system, most, monkeypatch):
    import resource

    monkeypatch.setattr(training.sys, "platform", system)
    monkeypatch.setattr(
        resource, "getrusage", lambda who: type("Used", (), {"ru_maxrss": 7 if who == 0 else 99})
    )
    assert training.peak_memory() == most
    monkeypatch.setitem(sys.modules, "resource", None)  # as on Windows
    assert training.peak_memory() is None


def test_seeds_are_those_of_the_results():
    """Torch's generator and NumPy's begin with the same number."""
    rng = seed_everything(5)
    assert (
        rng.integers(1000, size=3).tolist()
        == np.random.default_rng(5).integers(1000, size=3).tolist()
    )
    torch.testing.assert_close(torch.rand(2), torch.rand(2, generator=torch.manual_seed(5)))


@pytest.mark.parametrize(("terminal", "every"), [(True, 0.3), (False, 15)])
def test_a_bar_goes_on_where_it_was_and_a_log_is_not_filled_with_it(terminal, every, monkeypatch):
    monkeypatch.setattr(training.sys.stderr, "isatty", lambda: terminal, raising=False)
    asked = []
    monkeypatch.setattr(training, "tqdm", lambda **of: asked.append(of))
    training.progress(50, "policy", start=20)
    training.progress(5, "film", delay=1.5)
    usual = {"mininterval": every, "ncols": 100}
    assert asked == [
        {"total": 50, "initial": 20, "desc": "policy", "delay": 0} | usual,
        {"total": 5, "initial": 0, "desc": "film", "delay": 1.5} | usual,
    ]


def test_things_are_counted_one_by_one_behind_a_bar_that_waits_three_seconds(monkeypatch):
    seen = []

    class Bar:
        def __init__(self, *asked, **options):
            seen.append((asked, options))

        def __enter__(self):
            return self

        def __exit__(self, *_):
            seen.append("closed")

        def update(self):
            seen.append("counted")

    monkeypatch.setattr(training, "progress", Bar)
    for thing in training.counted("ab", 2, "letters"):
        seen.append(thing)
    assert seen == [((2, "letters"), {"delay": 3}), "a", "counted", "b", "counted", "closed"]


def test_a_checkpoint_holds_the_time_and_starts_its_wait_anew(tmp_path, monkeypatch):
    clock = Clock(monkeypatch)
    checkpoint = Checkpoint(str(tmp_path / "state"), seconds=10)
    clock.now += 10  # just as long is not longer
    checkpoint.save(lambda: pytest.fail("made a state"))
    clock.now += 1
    checkpoint.save(lambda: {"step": 1})
    assert load_state(tmp_path / "state")["spent"] == 11
    clock.now += 9
    checkpoint.save(lambda: {"step": 2}, force=True)
    assert load_state(tmp_path / "state").keys() == {"state", "torch_rng", "spent"}
    clock.now += 9
    checkpoint.save(lambda: pytest.fail("made a state"))  # what was forced counts, too
    assert checkpoint.load() == {"step": 2}
    assert checkpoint.spent == 29 + 20  # what was saved, and what this one has taken so far
    assert Checkpoint("").path is None
