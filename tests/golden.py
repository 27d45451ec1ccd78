"""Golden figures: what a recipe computed when the shipped results were made.

A known answer, worked out by hand, says what is right. Golden figures say that it is still so
for all that no hand works out: a whole update of a network, a rollout, a drawing. A meant change
rewrites them by `pytest --write-golden`, and the diff shows what it changed.
"""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

FOLDER = Path(__file__).with_name("golden")
DIGITS = 6  # kept of each figure: more than any tolerance asks for


def path(test: str) -> Path:
    """Where a test's figures lie: test_sac.py::test_step[2] -> golden/test_sac/test_step_2.json"""
    file, _, name = test.rpartition("/")[2].partition(".py::")
    return FOLDER / file / (re.sub(r"\W+", "_", name).strip("_") + ".json")


def rounded(value: Any) -> Any:
    """A figure, an array or a tensor of them as JSON has it; words and None stay what they are."""
    if hasattr(value, "detach"):
        value = value.detach().cpu()
    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
        return array.tolist()
    return [float(f"{x:.{DIGITS}g}") for x in array.ravel().tolist()]


def compare(kept: Mapping[str, Any], found: Mapping[str, Any], rtol: float, atol: float) -> None:
    """Raises AssertionError where a figure is not the kept one, or is missing, or is new."""
    assert found.keys() == kept.keys(), f"figures {[*found]}, kept {[*kept]}"
    for name, value in found.items():
        if isinstance(value, list) and value and isinstance(value[0], float):
            np.testing.assert_allclose(value, kept[name], rtol, atol, err_msg=name)
        else:
            assert value == kept[name], name


def check(test: str, figures: Mapping[str, Any], rtol: float, atol: float, write: bool) -> None:
    """Compare the figures of a test with those that are kept; write: keep them instead."""
    file, found = path(test), {name: rounded(value) for name, value in figures.items()}
    if write:
        file.parent.mkdir(parents=True, exist_ok=True)
        rows = (f"{json.dumps(name)}: {json.dumps(value)}" for name, value in found.items())
        file.write_text("{\n" + ",\n".join(rows) + "\n}\n")
    assert file.exists(), f"no golden figures of {test}: pytest --write-golden writes them"
    compare(json.loads(file.read_text()), found, rtol, atol)
