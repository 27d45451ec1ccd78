"""What every training shares: device, seeds, atomic files, checkpoint and resume, a log.

In: a nested state of dicts, lists, numbers and tensors. Out: one safetensors file, which is always
the whole old one or the whole new one. Nothing in it is unpickled.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, TypeVar

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from tqdm import tqdm

T = TypeVar("T")


class InputError(ValueError):
    """A mistake in what the user gave: one sentence that names the thing and the remedy."""


def quantity(n: int, noun: str) -> str:
    """So many things in words: "1 frame", "2 frames"."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def pick_device(name: str = "cpu") -> torch.device:
    """Torch device of that name. Raises InputError if the machine has no such device."""
    if name.startswith("cuda") and not torch.cuda.is_available():
        raise InputError(f"--device {name}: this machine has no CUDA device; use --device cpu.")
    try:
        return torch.device(name)
    except RuntimeError:
        raise InputError(f"--device {name}: torch knows no such device; use cpu or cuda.") from None


def peak_memory() -> int | None:
    """The most memory this process has taken so far, in bytes; None on Windows, which counts it
    elsewhere."""
    try:
        import resource
    except ImportError:
        return None
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else 1024 * most  # in bytes there, else in KiB


def seed_everything(seed: int) -> np.random.Generator:
    """Seed torch and return a NumPy generator of the same seed."""
    torch.manual_seed(seed)
    return np.random.default_rng(seed)


def write_atomic(path: Path | str, data: bytes | str) -> None:
    """Write a file so that a kill at any moment leaves the old file or the new one."""
    path = Path(path)
    part = path.with_name(f".{path.name}.part")
    with open(part, "wb") as f:
        # A file's name, which may stand in a text, need not be one.
        f.write(data.encode(errors="backslashreplace") if isinstance(data, str) else data)
        f.flush()
        os.fsync(f.fileno())  # without it a power cut can rename an empty file into place
    os.replace(part, path)


def read_json(path: Path | str) -> Any:
    """What a JSON file of a run holds. Raises InputError if it is torn or no JSON."""
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except ValueError:  # bytes that are no text are one as well
        raise InputError(
            f"{path}: this is no JSON, or half of it; restore it, or give another folder."
        ) from None


def _flatten(state, name, tensors):
    if isinstance(state, dict):
        # Optimizers key their state by integers, and JSON's keys are strings: pairs keep the type.
        return {"dict": [[k, _flatten(v, f"{name}/{k}", tensors)] for k, v in state.items()]}
    if isinstance(state, list | tuple):
        return {"list": [_flatten(v, f"{name}/{i}", tensors) for i, v in enumerate(state)]}
    if isinstance(state, np.ndarray):
        state = torch.from_numpy(state)
    if isinstance(state, torch.Tensor):
        tensors[name] = state.detach().cpu().contiguous().clone()
        return {"tensor": name}
    return {"value": state}


def _unflatten(tree, tensors):
    kind, content = next(iter(tree.items()))
    if kind == "dict":
        return {k: _unflatten(v, tensors) for k, v in content}
    if kind == "list":
        return [_unflatten(v, tensors) for v in content]
    return tensors[content] if kind == "tensor" else content


def save_state(path: Path | str, state: dict) -> None:
    """Save nested dicts, lists, JSON values, arrays and tensors as one file, atomically."""
    tensors: dict[str, torch.Tensor] = {}
    tree = _flatten(state, "", tensors)
    write_atomic(path, save(tensors, metadata={"tree": json.dumps(tree)}))


def load_state(path: Path | str) -> dict:
    """What `save_state` wrote; arrays come back as tensors, tuples as lists.

    Raises InputError if the file is missing, cut short, or not written by `save_state`.
    """
    if not Path(path).is_file():
        raise InputError(f"{path}: there is no such file; train first or give another path.")
    try:
        with safe_open(str(path), "pt") as f:
            tensors = {k: f.get_tensor(k) for k in f.keys()}  # noqa: SIM118 (not a dict)
            tree = json.loads(f.metadata()["tree"])
    except (SafetensorError, KeyError, TypeError, ValueError):
        sentence = f"{path}: not a complete weights file; delete it and train again."
        raise InputError(sentence) from None
    return _unflatten(tree, tensors)


def load_weights(path: Path | str, kind: str, called: str, task: str | None) -> dict:
    """What `save_state` wrote, if it is of this kind and task; any task's if `task` is None.

    called: what a sentence calls the kind, as "a MUNIT". Raises InputError if the file holds
    something else or belongs to another task.
    """
    saved = load_state(path)
    if saved.get("kind") != kind:
        raise InputError(
            f"{path}: not the weights of {called}; give the file that its training wrote."
        )
    if task is not None and saved["task"] != task:
        raise InputError(
            f"{path}: weights of the task {saved['task']}, not of {task}; "
            f"give those of {task} or train anew."
        )
    return saved


def _state_of(thing):
    is_generator = isinstance(thing, np.random.Generator)
    return thing.bit_generator.state if is_generator else thing.state_dict()


class Checkpoint:
    """One training's state on disk, saved at most every `seconds`, so that a kill costs no more.

    `path` None switches it off: the same loop then runs without a file. `spent` is the time the
    training took so far in seconds, kills and resumes included.
    """

    def __init__(self, path: Path | str | None, seconds: float = 20.0):
        self.path = Path(path) if path else None
        self.seconds = seconds
        self._start = self._last = time.monotonic()

    @property
    def spent(self) -> float:
        return time.monotonic() - self._start

    def load(self) -> dict | None:
        """The saved state with torch's random state restored, or None where there is none."""
        if self.path is None or not self.path.exists():
            return None
        saved = load_state(self.path)
        torch.set_rng_state(saved["torch_rng"])
        self._start -= saved["spent"]
        return saved["state"]

    def resume(
        self, stateful: dict[str, Any], **variables: Any
    ) -> tuple[SimpleNamespace, Callable[[], dict]]:
        """Resume a training where it stopped: the loop's variables now, and the state for `save`.

        stateful: networks and optimizers by name, all that have `state_dict` and `load_state_dict`,
        and NumPy generators. They are set to the saved state in place. variables: what the loop
        changes, with values for a new start; a checkpoint must be able to hold them.

            now, state = checkpoint.resume({"model": model, "rng": rng}, step=0, log=[])
            while now.step < iterations:
                ...
                now.step += 1
                checkpoint.save(state)
        """
        now = SimpleNamespace(**variables)
        if saved := self.load():
            for name, thing in stateful.items():
                if isinstance(thing, np.random.Generator):
                    thing.bit_generator.state = saved[name]
                else:
                    thing.load_state_dict(saved[name])
            vars(now).update({name: saved[name] for name in variables})

        def state():
            return {name: _state_of(thing) for name, thing in stateful.items()} | vars(now)

        return now, state

    def save(self, make_state: Callable[[], dict], force: bool = False) -> None:
        """Call `make_state()` and save it, if `seconds` have passed or `force` asks for it."""
        if self.path is None or not (force or time.monotonic() - self._last > self.seconds):
            return
        rest = {"torch_rng": torch.get_rng_state(), "spent": self.spent}
        save_state(self.path, {"state": make_state(), **rest})
        self._last = time.monotonic()


def progress(total: int, name: str, start: int = 0, delay: float = 0) -> tqdm:
    """A tqdm bar on stderr that also reads well in a log file; it shows after `delay` seconds."""
    every = 0.3 if sys.stderr.isatty() else 15
    return tqdm(total=total, initial=start, desc=name, mininterval=every, ncols=100, delay=delay)


def counted(things: Iterable[T], total: int, name: str) -> Iterator[T]:
    """The things, with a bar that appears if they take longer than 3 s."""
    with progress(total, name, delay=3) as bar:
        for thing in things:
            yield thing
            bar.update()
