"""Arrays too long to be kept whole, as a few figures."""

import numpy as np


def digest(array):
    """Four figures of an array: its mean, its mean size, and two mixtures in which places count
    differently, so that what is turned round or swapped shows."""
    a = np.asarray(array, float).ravel()
    along = np.linspace(0.5, 1.5, len(a))
    about = 1 + 0.5 * np.cos(7.3 * np.arange(len(a)))
    return np.array([a.mean(), np.abs(a).mean(), along @ a / len(a), about @ a / len(a)])


def options(parser):
    """What an argparse parser's arguments are, a line each, without their help."""
    for a in parser._actions[1:]:
        kind, names = getattr(a.type, "__name__", a.type), "/".join(a.option_strings) or a.dest
        kept = type(a).__name__.strip("_").removesuffix("Action")
        yield f"{names}: {a.default} {a.choices} {kind} {a.metavar} {kept}"
