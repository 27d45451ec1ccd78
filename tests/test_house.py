"""The rules of the house: which way imports go, and what may see the simulator's state."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = sorted((ROOT / "lbw_minimal").glob("*.py"))
CODE = [*PACKAGE, *sorted((ROOT / "tasks").rglob("*.py"))]
FILE = 330  # lines, one sitting
FUNCTION = 60  # lines, a screen
LINE = 100  # characters, what a projector shows
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
CALLED = ("__init__", "__call__", "__len__")  # public in spite of their names

every_file = pytest.mark.parametrize("path", CODE, ids=lambda p: str(p.relative_to(ROOT)))


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
    """Success may be logged, by `info["is_success"]`; positions, poses, joints are off limits."""
    words = ("true_pixels", "true_state", "object_position", "target_position", "tip_pose")
    words += ("unwrapped", "waypoints")
    assert not [w for w in words if w in path.read_text()]


def test_only_the_classifier_reward_sees_the_robots_expert_videos():
    """LbW and AVID-m learn from the human. Who films the robot's expert says so by this name."""
    code = [*CODE, *sorted((ROOT / "solutions").glob("*.py"))]
    users = {str(p.relative_to(ROOT)) for p in code if "robot_experts" in p.read_text()}
    assert users == {"tasks/__init__.py", "tasks/commands/record.py", "tasks/commands/run.py"}
    of_experts = {
        str(p.relative_to(ROOT))
        for p in code
        if "expert_takes" in p.read_text() and p.parent.name != "world"
    }
    assert of_experts == {"tasks/__init__.py", "tasks/commands/record.py"}


@every_file
def test_nothing_is_unpickled(path):
    text = path.read_text()
    assert not [w for w in ("import pickle", "torch.load(", "allow_pickle=True") if w in text]


@every_file
def test_a_file_is_one_sitting_and_fits_a_projector(path):
    lines = path.read_text().splitlines()
    assert len(lines) <= FILE
    assert not [n for n, line in enumerate(lines, 1) if len(line) > LINE]


@every_file
def test_a_function_fits_on_a_screen(path):
    functions = [n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, FUNCTIONS)]
    assert not [f.name for f in functions if f.end_lineno - f.lineno >= FUNCTION]


def public(body):
    """The functions and methods of a module or class that others may call."""
    for node in body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from public(node.body)
        elif isinstance(node, FUNCTIONS) and (node.name[0] != "_" or node.name in CALLED):
            yield node


def is_annotated(function):
    a = function.args
    given = [*a.posonlyargs, *a.args, *a.kwonlyargs, *(x for x in (a.vararg, a.kwarg) if x)]
    typed = all(x.annotation or x.arg in ("self", "cls") for x in given)
    return typed and (function.returns is not None or function.name == "__init__")


@every_file
def test_every_public_function_has_types(path):
    functions = public(ast.parse(path.read_text()).body)
    assert not [f.name for f in functions if not is_annotated(f)]


@pytest.mark.parametrize(
    ("code", "typed"),
    [
        ("def f(x: int) -> int: ...", True),
        ("def f(x) -> int: ...", False),
        ("def f(x: int): ...", False),
        ("def f(*, x) -> int: ...", False),
        ("def f(**x) -> int: ...", False),
        ("class A:\n    def __init__(self, x: int): ...", True),
        ("class A:\n    def f(self, x): ...", False),
        ("class _A:\n    def f(self, x): ...", True),
        ("def _f(x): ...", True),
    ],
)
def test_missing_types_are_found(code, typed):
    assert all(map(is_annotated, public(ast.parse(code).body))) == typed
