"""Jobs on many machines: Ray runs them, starts them again, and knows where there is room.

A job is a call of a function with plain values. What it returns comes back through Ray, files as
bytes: the machines need no common folder. A local cluster reads the kit's files where they are, to
another they travel; each node needs Python with requirements.txt and requirements-cluster.txt
installed. Nothing here needs torch, which takes a process a second to import.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
CODE = ("lbw_minimal", "notebooks", "tasks", "tests")  # of the kit, with the videos: 8 MB
KIT = (*CODE, "solutions")  # with the weights: 30 MB
LEAN = Path(__file__).with_name("lean")  # for the path of Ray's processes: see what lies there
INTERRUPTED = 130  # exit code: 128 and the signal's number
RETRIES = 3  # new starts of a job whose worker or node was lost
# Python that dies with its parent (prctl 1, PR_SET_PDEATHSIG): nobody would end it on a lost node.
MORTAL = (
    "import ctypes, os, sys; ctypes.CDLL(None).prctl(1, 9); "
    "os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"
)
Files = dict[str, bytes]  # by their names in a folder


class Refused(Exception):
    """A node will not do such jobs; the message says why. The job goes to another node."""


def connect(kit: tuple[str, ...] = KIT) -> Any:
    """Ray, connected to the cluster that runs here or at RAY_ADDRESS, else to a local one.

    kit: what of the kit goes to a cluster that runs. Raises InputError without Ray, and where it
    does not start, as on a machine with far too much to do.
    """
    ray = _ray()
    if not ray.is_initialized():
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        os.environ.setdefault("RAY_OVERRIDE_RUNTIME_ENV_DEFAULT_EXCLUDES", "")  # ours say it all
        others = [f"/{path.name}" for path in ROOT.iterdir() if path.name not in kit]
        there: dict[str, Any] = {"working_dir": str(ROOT), "excludes": others}
        there["py_modules"] = [str(LEAN / "rfc3987_syntax")]
        quiet: dict[str, Any] = {"logging_level": "warning", "log_to_driver": False}
        try:
            ray.init(address="auto", runtime_env=there, **quiet)
        except ConnectionError:
            with on_path(LEAN, ROOT):  # a local one finds the kit where it is
                try:
                    ray.init(address="local", include_dashboard=False, **quiet)
                except Exception as e:  # Ray raises no narrower one
                    raise _error(f"Ray does not start here: {e}") from e
    return ray


def ahead(kit: tuple[str, ...], rest: Callable[[], Any]) -> None:
    """Connect, and do the `rest` meanwhile: Ray starts in the main thread alone, and mostly waits.

    What fails is left for the next `connect` to say, and for who needs the rest.
    """
    try:
        with contextlib.suppress(Exception), ThreadPoolExecutor(1) as aside:
            _ray()
            aside.submit(rest)
            connect(kit)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)


def _ray() -> Any:
    """Ray's module. Raises InputError where there is none."""
    sys.path.insert(0, str(LEAN))
    try:
        import ray
    except ImportError:
        why = "Ray is not installed; pip install -r requirements-cluster.txt does it."
        raise _error(why) from None
    finally:
        sys.path.remove(str(LEAN))
    return ray


def _error(why: str) -> Exception:
    """An InputError; its module imports torch."""
    from lbw_minimal.training import InputError

    return InputError(f"--ray: {why}")


@contextlib.contextmanager
def on_path(*folders: Path) -> Iterator[None]:
    """Folders that Python programs started in this block look into first."""
    before = os.environ.get("PYTHONPATH")
    path = [*map(str, folders), *filter(None, [before])]
    os.environ["PYTHONPATH"] = os.pathsep.join(path)
    try:
        yield
    finally:
        del os.environ["PYTHONPATH"]
        os.environ |= {"PYTHONPATH": before} if before else {}


def leave() -> None:
    """Disconnect, if this process is connected, and end a local cluster."""
    if ray := sys.modules.get("ray"):
        ray.shutdown()


def spread(
    function: Callable, jobs: Iterable[tuple[Any, tuple, int]], kit: tuple[str, ...] = KIT
) -> Iterator[tuple[Any, Any]]:
    """function(*arguments) for each (name, arguments, bytes of memory) of `jobs`, a core each.

    kit: see `connect`. Yields (name, result) in the order in which they end; the result is an
    exception where the function raised one or its worker was lost too often. Raises InputError if
    all nodes refuse.
    """
    ray = connect(kit)
    task = ray.remote(num_cpus=1, max_retries=RETRIES)(attempt)
    refused: dict[str, str] = {}  # by node

    def start(arguments, memory):
        there = {"ray.io/node-id": f"!in({','.join(refused)})"} if refused else None
        return task.options(memory=memory, label_selector=there).remote(function, arguments)

    waiting = {start(*job): (name, *job) for name, *job in jobs}
    while waiting:
        ref = ray.wait(list(waiting))[0][0]
        name, *job = waiting.pop(ref)
        try:
            result, node, why = ray.get(ref)
        except ray.exceptions.RayError as error:
            yield name, getattr(error, "cause", None) or error
            continue
        if not node:
            yield name, result
            continue
        if node not in refused:
            print(why, file=sys.stderr)
        refused[node] = why
        able = (n["NodeID"] for n in ray.nodes() if n["Alive"] and n["Resources"].get("CPU"))
        if refused.keys() >= set(able):
            raise _error(f"no node takes these jobs. {'. '.join(refused.values())}")
        waiting[start(*job)] = (name, *job)


def attempt(function: Callable, arguments: tuple) -> tuple[Any, str, str]:
    """On a node: the function's result; or, of a node that refuses, its id and why."""
    import ray

    try:
        return function(*arguments), "", ""
    except Refused as why:
        context = ray.get_runtime_context()
        return None, context.get_node_id(), f"node {ray.util.get_node_ip_address()}: {why}"


def python(line: list[str], folders: dict[str, Files], result: str) -> tuple[int, str, Files]:
    """On a node: run Python with the arguments `line` in a folder that holds only `folders`.

    Returns the exit code, what it printed, and the files of its folder `result`.
    """
    with TemporaryDirectory() as here:
        for name, files in folders.items():
            unpack(files, Path(here) / name)
        done = subprocess.run(
            [sys.executable, "-c", MORTAL, *line], cwd=here, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        )  # fmt: skip
        return done.returncode, done.stdout.decode(errors="replace"), pack(Path(here) / result)


def pack(folder: Path, pattern: str = "*") -> Files:
    """The files in a folder; none if there is no such folder."""
    return {path.name: path.read_bytes() for path in folder.glob(pattern) if path.is_file()}


def unpack(files: Files, folder: Path) -> None:
    """Write files into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in files.items():
        (folder / name).write_bytes(data)
