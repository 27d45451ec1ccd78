"""What golden figures are made of: inputs in which nothing equals another, and few numbers that
move with whatever a network, a training or a recipe does differently."""

import inspect
import re
from copy import deepcopy
from types import ModuleType

import numpy as np
import torch

from lbw_minimal.training import Checkpoint, load_state


def blocks(n, seed, low=0, high=256):
    """Frames (n, 84, 84, 3) uint8 of 36 squares each, of a colour of their own."""
    small = np.random.default_rng(seed).integers(low, high, (n, 6, 6, 3), np.uint8)
    return small.repeat(14, 1).repeat(14, 2)


def noise(*shape, seed):
    """Numbers of mean 0 and deviation 1, the same on every machine."""
    drawn = np.random.default_rng(seed).normal(size=shape)
    return torch.tensor(drawn, dtype=torch.float32)


def look(values, n=6):
    """Mean, deviation, and n of the values, spread over all."""
    v = torch.as_tensor(values).detach().double().flatten()
    places = np.linspace(0, len(v) - 1, n).astype(int)
    return [v.mean().item(), v.std(correction=0).item(), *v[places].tolist()]


def layers(network):
    """The names and sizes of all that a network's file would hold."""
    return [f"{name} {tuple(v.shape)}" for name, v in network.state_dict().items()]


def slopes(network):
    """The length of each layer's gradient, -1 where there is none.

    Not of each weight's: before a norm a bias has none but rounding's.
    """
    found = {}
    for name, p in network.named_parameters():
        layer = name.removesuffix(".weight").removesuffix(".bias")
        length = -1.0 if p.grad is None else p.grad.double().norm().item()
        found[layer] = float(np.hypot(found.get(layer, 0.0), length)) if length >= 0 else -1.0
    return list(found.values())


def weights(network):
    """Of each layer, to be compared later; no biases, see `slopes`."""
    return [p.detach().clone() for p in network.parameters() if p.ndim > 1]


def moved(before, network):
    """Mean absolute change of each layer's weights: a rate, a pace and a decay show in it."""
    pairs = zip(before, weights(network), strict=True)
    return [(after - old).abs().double().mean().item() for old, after in pairs]


def columns(log):
    """Rows of a log as {name: its figures}, no number where a row has none."""
    names = dict.fromkeys(name for row in log for name in row)
    return {f"log: {name}": [row.get(name, float("nan")) for row in log] for name in names}


class Kept(Checkpoint):
    """Keeps the states of a training in memory, one a call, and how each was asked for.

    begun: a state to begin with, for a training that goes on.
    """

    def __init__(self, begun=None):
        super().__init__(None)
        self.begun, self.states, self.forced = begun, [], []

    def load(self):
        return self.begun

    def save(self, make_state, force=False):
        self.states.append(deepcopy(make_state()))
        self.forced.append(force)


class Bar:
    """What a training's bar is told, in words without their figures, which may round otherwise."""

    def __init__(self, monkeypatch, module):
        self.told, self.n = [], 0
        monkeypatch.setattr(module, "progress", self.begin)

    def begin(self, total, name, start=0):
        self.told.append(f"{name} {start} of {total}")
        self.n = start
        return self

    def update(self, n=1):
        self.n += n
        self.told.append(str(self.n))

    def set_postfix_str(self, text, refresh=True):
        self.told.append(re.sub(r"\d", "0", text).replace("-", ""))

    def close(self):
        self.told.append("closed")


def in_file(path):
    """What a file of weights holds, in words: its settings, and how many numbers of which kind."""

    def words(name, value):
        if isinstance(value, dict) and any(torch.is_tensor(v) for v in value.values()):
            kinds = sorted({str(v.dtype) for v in value.values()})
            return f"{name}: {len(value)} tensors of {' '.join(kinds)}"
        if torch.is_tensor(value):
            return f"{name}: {tuple(value.shape)} {value.dtype}"
        return f"{name}: {value}"

    return [words(name, value) for name, value in load_state(path).items()]


def refusals(folder, *calls):
    """What those who call so are told, whatever folder it was tried in."""
    told = []
    for call in calls:
        try:
            call()
        except Exception as error:
            text = f"{type(error).__name__}: {error}".replace(f"{folder}", "folder")
            told.append(text.replace("\\", "/"))
        else:
            told.append("nothing")
    return told


def facts(module):
    """A module's constants, and what the arguments of its functions are by default, in words."""
    found = {}
    for name, value in vars(module).items():
        own = getattr(value, "__module__", None) == module.__name__
        if inspect.isclass(value) and own:
            found |= {f"{name}({k})": text for k, text in _defaults(value).items()}
            for part, method in vars(value).items():
                if inspect.isfunction(method) and part != "__init__":
                    found |= {f"{name}.{part}({k})": t for k, t in _defaults(method).items()}
        elif inspect.isfunction(value) and own:
            found |= {f"{name}({k})": text for k, text in _defaults(value).items()}
        elif name.isupper() and not isinstance(value, ModuleType | type):
            found[name] = repr(value)
    return found


def _defaults(function):
    parameters = inspect.signature(function).parameters.values()
    return {p.name: repr(p.default) for p in parameters if p.default is not inspect.Parameter.empty}
