"""The rules of the house: which way imports go, and what may see the simulator's state."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = sorted((ROOT / "lbw_minimal").glob("*.py"))


def imported(path):
    """Top-level names of all modules a file imports, inside functions too."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield (node.module or "").split(".")[0]


@pytest.mark.parametrize("path", PACKAGE, ids=lambda p: p.name)
def test_the_method_imports_no_simulator(path):
    assert not {"pybullet", "pybullet_data", "pybullet_utils", "tasks", "meshcat"} & set(
        imported(path)
    )


@pytest.mark.parametrize("path", PACKAGE, ids=lambda p: p.name)
def test_the_method_names_nothing_of_the_simulators_state(path):
    """Success may be logged, by `info["is_success"]`; positions, poses and joints may not be
    touched."""
    words = (
        "true_pixels",
        "object_position",
        "target_position",
        "tip_pose",
        "unwrapped",
        "waypoints",
    )
    assert not [w for w in words if w in path.read_text()]


@pytest.mark.parametrize(
    "path", [*PACKAGE, *sorted((ROOT / "tasks").glob("*.py"))], ids=lambda p: p.name
)
def test_nothing_is_unpickled(path):
    text = path.read_text()
    assert not [w for w in ("import pickle", "torch.load(", "allow_pickle=True") if w in text]
