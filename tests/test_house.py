"""The rules of the house: which way imports go, and what may see the simulator's state."""

import ast
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

from lbw_minimal import __version__

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = sorted((ROOT / "lbw_minimal").rglob("*.py"))
CODE = [*PACKAGE, *sorted((ROOT / "tasks").rglob("*.py"))]
FILE = 330  # lines, one sitting
FUNCTION = 60  # lines, a screen
LINE = 100  # characters, what a projector shows
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
CALLED = ("__init__", "__call__", "__len__")  # public in spite of their names


def against(rule, paths=CODE):
    """What breaks a rule, by file: rule(path) gives what does so there. One test asks all files of
    a rule: a test for each file takes longer than its question."""
    return {str(p.relative_to(ROOT)): broken for p in paths if (broken := list(rule(p)))}


@pytest.fixture(scope="module")
def nodes():
    """The nodes of each file's syntax tree, its module first."""
    return {path: list(ast.walk(ast.parse(path.read_text()))) for path in CODE}


def imported(nodes):
    """Top-level names of all modules a file imports, inside functions too."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield (node.module or "").split(".")[0]


def test_types_are_as_they_are_said_to_be():
    """Without its cache mypy takes 14 s of one core: another worker goes on meanwhile."""
    said = subprocess.run([sys.executable, "-m", "mypy"], cwd=ROOT, capture_output=True, text=True)
    assert said.returncode == 0, said.stdout + said.stderr


def test_the_method_imports_no_simulator(nodes):
    simulator = {"pybullet", "pybullet_data", "pybullet_utils", "tasks", "meshcat"}
    assert not against(lambda path: simulator & set(imported(nodes[path])), PACKAGE)


def test_the_method_names_nothing_of_the_simulators_state():
    """Success may be logged, by `info["is_success"]`; positions, poses, joints are off limits."""
    words = ("true_pixels", "true_state", "object_position", "target_position", "tip_pose")
    words += ("unwrapped", "waypoints")
    assert not against(lambda path: [w for w in words if w in path.read_text()], PACKAGE)


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


def test_nothing_is_unpickled():
    words = ("import pickle", "torch.load(", "allow_pickle=True")
    assert not against(lambda path: [w for w in words if w in path.read_text()])


def test_a_file_is_one_sitting_and_fits_a_projector():
    files = {path: path.read_text().splitlines() for path in CODE}
    assert not against(lambda path: files[path][FILE:])
    assert not against(lambda path: [n for n, x in enumerate(files[path], 1) if len(x) > LINE])


def test_a_function_fits_on_a_screen(nodes):
    def long(path):
        functions = [n for n in nodes[path] if isinstance(n, FUNCTIONS)]
        return [f.name for f in functions if f.end_lineno - f.lineno >= FUNCTION]

    assert not against(long)


def without_encoding(nodes):
    """Calls that read or write text in whatever encoding the system has: not UTF-8 on Windows."""
    for node in nodes:
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        words = [a.value for a in node.args if isinstance(a, ast.Constant)]
        modes = [w for w in words if isinstance(w, str) and re.fullmatch("[rwaxbt+]{1,3}", w)]
        opens = name in ("open", "fdopen") and not any("b" in mode for mode in modes)
        opens &= getattr(getattr(node.func, "value", None), "id", "") not in ("os", "av")
        if (opens or name in ("read_text", "write_text")) and not any(
            k.arg == "encoding" for k in node.keywords
        ):
            yield f"{name}, line {node.lineno}"


def test_text_is_read_and_written_in_utf_8_everywhere(nodes):
    assert not against(lambda path: without_encoding(nodes[path]))


@pytest.mark.parametrize(
    ("code", "named"),
    [
        ("p.read_text()", False),
        ("p.read_text(encoding='utf-8')", True),
        ("p.write_text(text)", False),
        ("open(p)", False),
        ("open(p, 'rb')", True),
        ("p.open('a')", False),
        ("os.open(p, 0)", True),
        ("av.open(p)", True),
    ],
)
def test_a_missing_encoding_is_found(code, named):
    assert (not list(without_encoding(ast.walk(ast.parse(code))))) == named


def reasons(code):
    """Why tests are skipped, skip by skip; None where no reason is given."""
    for node in ast.walk(ast.parse(code)):
        bare = [d for d in getattr(node, "decorator_list", ()) if isinstance(d, ast.Attribute)]
        yield from (None for d in bare if d.attr == "skip")
        name = getattr(getattr(node, "func", None), "attr", "")
        if name in ("skip", "skipif", "importorskip"):
            given = {k.arg: k.value for k in node.keywords}
            if name == "skip" and node.args:
                given["reason"] = node.args[0]
            yield getattr(given.get("reason"), "value", None)


def test_who_skips_a_test_says_what_it_needs():
    def silent(path):
        found = reasons(text) if "skip" in (text := path.read_text()) else ()
        return [reason for reason in found if not (reason or "").startswith("needs ")]

    assert not against(silent, sorted((ROOT / "tests").rglob("*.py")))


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("@pytest.mark.skip\ndef test(): ...", [None]),
        ("@pytest.mark.skip()\ndef test(): ...", [None]),
        ("@pytest.mark.skipif(True, reason='needs Linux')\ndef test(): ...", ["needs Linux"]),
        ("pytest.skip('needs Ray')", ["needs Ray"]),
        ("pytest.importorskip('ray')", [None]),
        ("check_env(env, skip_render_check=True)", []),
    ],
)
def test_a_skip_without_a_reason_is_found(code, said):
    assert list(reasons(code)) == said


SYSTEM = {"resource", "fcntl", "pwd", "grp", "termios", "pty", "msvcrt", "winreg"}


def test_no_file_needs_a_module_that_some_system_lacks(nodes):
    """Where one is used, it is imported there, and its absence is caught."""

    def needed(path):
        tried = {n for t in nodes[path] if isinstance(t, ast.Try) for n in ast.walk(t)}
        imports = [n for n in nodes[path] if isinstance(n, ast.Import) and n not in tried]
        return SYSTEM & {alias.name for node in imports for alias in node.names}

    assert not against(needed)


def blocks():
    """The requirements by the titles of their blocks in requirements.txt."""
    text = (ROOT / "requirements.txt").read_text()
    parts = re.split(r"^# (The kit|The course|Its tests)\b.*$", text, flags=re.MULTILINE)
    lines = [re.sub(r"^#.*$", "", part, flags=re.MULTILINE).split("\n") for part in parts[2::2]]
    rows = [{str(Requirement(line)) for line in some if line.strip()} for some in lines]
    return dict(zip(parts[1::2], rows, strict=True))


def test_the_package_requires_what_requirements_txt_says():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    more = project["optional-dependencies"]
    wanted = {"The kit": project["dependencies"], "The course": more["course"],
              "Its tests": more["test"]}  # fmt: skip
    assert blocks() == {name: {str(Requirement(r)) for r in some} for name, some in wanted.items()}


def test_every_package_of_the_kit_is_installed():
    """A folder with an __init__.py that is missing from the list is missing from the wheel."""
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    inits = [p for name in ("lbw_minimal", "tasks") for p in (ROOT / name).rglob("__init__.py")]
    there = {".".join(folder.relative_to(ROOT).parts) for folder in (p.parent for p in inits)}
    assert there | {"solutions.weights"} == set(listed)


def test_the_lock_has_a_version_in_range_of_everything_required():
    lock = [line for line in (ROOT / "requirements-lock.txt").read_text().splitlines()
            if not line.startswith("#")]  # fmt: skip
    pins = {}
    for pin in map(Requirement, lock):
        (version,) = pin.specifier
        assert version.operator == "=="
        pins[pin.name.lower()] = version.version
    for some in blocks().values():
        for needed in map(Requirement, some):
            assert needed.specifier.contains(pins[needed.name.lower()]), needed


def test_the_version_is_everywhere_the_same():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    newest = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)[1]
    assert citation["version"] == newest == __version__


def test_the_workflow_is_yaml_and_tests_every_system():
    text = (ROOT / ".github" / "workflows" / "check.yml").read_text()
    jobs = yaml.safe_load(text)["jobs"]
    systems = {job["runs-on"] for job in jobs.values()}
    systems |= set(jobs["students"]["strategy"]["matrix"]["system"])
    assert {re.sub("-.*", "", s) for s in systems if "{" not in s} == {"ubuntu", "macos", "windows"}


@pytest.mark.skipif(not shutil.which("make"), reason="needs make")
def test_an_index_of_pytorchs_gives_torch_alone_and_the_lock_holds():
    """It need not have the lock's versions of what torch depends on: pip then gives up."""
    line = ["make", "-n", "-W", "requirements.txt", "install"]
    line += ["TORCH_INDEX=file:///builds", "LOCK=-c lock.txt"]
    shown = subprocess.run(line, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    (asks,) = (line for line in shown.splitlines() if "--index-url" in line)
    assert {"--no-deps", "lock.txt", "torch"} < set(asks.split())


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


def test_every_public_function_has_types(nodes):
    def bare(path):
        functions = public(nodes[path][0].body)
        return [f.name for f in functions if not is_annotated(f)]

    assert not against(bare)


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
