"""A made-up class by seed: whole submissions, and broken, hostile or odd ones of known points.

`python -m tests.hostile FOLDER --whole 300 --odd 200` makes one, grades it, and says what it got
wrong: points, other people's files, shared memory, processes. All are notebook 6; what is hostile
is the answer to 6.1, and the other answers are right.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import ctypes
import hashlib
import json
import os
import random
import resource
import socket
import time
from pathlib import Path

from tests.grade import sandbox
from tests.grade.__main__ import main as grade
from tests.grade.exercise import find

ROOT = Path(__file__).resolve().parent.parent
NAME = "06_reward.ipynb"
SOLVED = json.loads((ROOT / "solutions" / NAME).read_text())
FIRST, REST = find("6.1").points, sum(find(f"6.{i}").points for i in (2, 3, 4, 5))
RIGHT = find("6.1").source
WALL, CPU = 4, 2  # s, in place of the grader's 15 and 10: a class of hangs takes hours otherwise

# What is refused, and then answered rightly. CLASS is the class's folder, OUT that of its grades.
ATTEMPTS = """
os.kill(os.getppid(), 9)
os.killpg(0, 9)
[os.kill(n, 9) for n in range(2, 99) if n != os.getpid()]
signal.pidfd_send_signal(os.pidfd_open(os.getppid()), 9)
os.fork()
os.setsid()
os.execv('/bin/sh', ['sh', '-c', 'touch ' + CLASS + '/made'])
os.posix_spawn('/bin/sh', ['sh', '-c', 'kill -9 $PPID'], {})
subprocess.run(['rm', '-rf', CLASS, OUT])
os.chmod(CLASS, 0)
os.chown(CLASS, 1, 1)
os.setxattr(CLASS, 'user.mine', b'1')
os.utime(CLASS, (0, 0))
os.rename(CLASS, CLASS + '2')
os.truncate(CLASS + '/whole-000/' + NAME, 0)
os.unlink(CLASS + '/whole-000/' + NAME)
os.symlink('/etc', CLASS + '/link')
os.link('/etc/passwd', CLASS + '/link')
os.mkfifo(CLASS + '/fifo')
os.mkdir(OUT + '/mine')
open(OUT + '/class.csv', 'w').write('mine,99')
open(OUT + '/seed.txt', 'a').write('1')
open(CLASS + '/whole-000/' + NAME, 'r+').write('x')
open('/proc/%d/mem' % os.getppid(), 'r+b').write(b'x')
open('/proc/self/oom_score_adj', 'w').write('-1000')
open('/dev/shm/mine', 'w').write('x')
os.memfd_create('mine')
shared_memory.SharedMemory('mine', True, 1 << 20)
libc.shmat(libc.shmget(4711, 1 << 20, 0o1666), None, 0)
libc.msgget(4711, 0o1666)
libc.semget(4711, 9, 0o1666)
libc.ptrace(16, os.getppid(), 0, 0)
libc.process_vm_writev(os.getppid(), None, 0, None, 0, 0)
libc.prctl(4, 1)
libc.prctl(1, 0)
libc.mount(b'none', b'/tmp', b'tmpfs', 0, None)
libc.unshare(0x10000000)
libc.sethostname(b'mine', 4)
libc.syscall(425, 8, None)
libc.syscall(321, 0, None, 0)
libc.syscall(323, 0)
libc.syscall(250, 0, -3, 0)
libc.syscall(435, None, 0)
libc.syscall(56, 17, 0, 0, 0, 0)
libc.syscall(0x40000000 + 57)
os.sched_setaffinity(os.getppid(), {0})
os.setpriority(os.PRIO_PROCESS, os.getppid(), 19)
os.sched_setscheduler(os.getppid(), os.SCHED_IDLE, os.sched_param(0))
resource.prlimit(os.getppid(), resource.RLIMIT_NOFILE, (9, 9))
resource.setrlimit(resource.RLIMIT_AS, (1 << 40, 1 << 40))
fcntl.fcntl(FD, fcntl.F_SETOWN, os.getppid())
fcntl.fcntl(FD, fcntl.F_SETFL, os.O_ASYNC)
fcntl.flock(FD, fcntl.LOCK_EX)
os.chroot('/')
os.setuid(0)
socket.create_connection(('127.0.0.1', 22), 1)
socket.socket(socket.AF_UNIX).bind(OUT + '/socket')
socket.socket().listen()
sys.setrecursionlimit(1 << 30)
gc.disable()
[threading.Thread(target=time.sleep, args=(99,), daemon=True).start() for _ in range(2000)]
[signal.signal(n, signal.SIG_IGN) for n in (1, 2, 3, 13, 14, 15, 24)]
print('x' * (1 << 24))
sys.stderr.write('\\\\x1b[2J' * (1 << 20))
os.write(1, bytes(1 << 24))
warnings.warn('x' * (1 << 20))
""".strip().splitlines()
IMPORTS = """
import ctypes, fcntl, gc, os, resource, signal, socket, subprocess, sys, threading, time, warnings
from multiprocessing import shared_memory
libc = ctypes.CDLL(None)
"""

# What has to be had to answer: nothing is, so 6.1 earns nothing.
THEFTS = """
open(CLASS + '/whole-000/' + NAME).read()
open(SOLUTIONS + '/' + NAME).read()
open(CHECKS).read()
open(OUT + '/seed.txt').read()
os.listdir(CLASS)
os.listdir('/proc/%d/fd' % os.getppid())
open('/proc/%d/environ' % os.getppid()).read()
open('/etc/shadow').read()
__import__('lbw_minimal.reward')
__import__('tests.grade.exercise')
shared_memory.SharedMemory('mine', False).buf[0]
[line for line in open('/proc/mounts')][10 ** 6]
""".strip().splitlines()

# How 6.1 fails; the others stand.
FAILURES = """
while True: pass
time.sleep(10 ** 6)
threading.Event().wait()
(lambda lock: [lock.acquire(), lock.acquire()])(threading.Lock())
signal.pause()
select.select([], [], [])
os.read(FD, 1 << 20) and os.read(FD, 1 << 20)
os.close(FD)
os.dup2(1, FD)
os.write(FD, bytes(8))
os.write(FD, b'\\\\xff' * 64)
os.write(FD, struct.pack('<Q', 1 << 62))
os.write(FD, struct.pack('<QQ', 12, 4) + b'null')
os.write(FD, b''.join(wire_of('left')) * 40)
os._exit(0)
os.abort()
sys.exit('bye')
raise KeyboardInterrupt
raise GeneratorExit
raise type('Odd', (BaseException,), {'__str__': lambda self: 1 / 0})
ctypes.string_at(0)
ctypes.memset(id(None), 255, 1 << 20)
os.kill(os.getpid(), 9)
return np.ones(1 << 40)
return bytearray(3 << 30) and 0.0
return 'x' * (1 << 26)
return [[0] * 1000] * 10 ** 5
return functools.reduce(lambda x, _: [x], range(10 ** 5), 0)
return {0: r1}
return lambda: 0
return np.array([None, r1], dtype=object)
return 10 ** 10 ** 4
return '\\\\ud800' * 9
return type('F', (float,), {'__eq__': lambda *_: True, '__hash__': None})(1)
return (lambda x: x.append(x) or x)([])
return (x for x in range(9))
return r1(z, z_E)
return torch.zeros(3, requires_grad=True)[None].expand(1 << 30, 3)
return [np.random.default_rng(i).normal() for i in range(1 << 28)]
""".strip().splitlines()


def _with(source: str, places: dict) -> str:
    """FD is the file that leads to the judge, the highest that is open."""
    text = "\n".join(f"{name} = {value!r}" for name, value in places.items())
    fd = """
def is_open(n):
    try:
        return os.fstat(n)
    except OSError:
        return None
FD = max(filter(is_open, range(3, 64)), default=3)"""
    more = "import functools, select, struct\n"
    wire = "def wire_of(x):\n    yield struct.pack('<QQ', 8 + 15, 15) + b'{\"v\": \"left\"} '\n"
    return f"{IMPORTS}{more}{text}\n{wire}{fd}\n{source}"


def answer(rng: random.Random, places: dict) -> tuple[str, float, str]:
    """A hostile cell for 6.1, what it earns, and what it does."""
    kind = rng.choices(["attempt", "theft", "failure"], [6, 1, 4])[0]
    body = RIGHT.split("\n", 1)[1]
    if kind == "attempt":
        does = rng.choice(ATTEMPTS)
        tried = f"    try:\n        {does}\n    except BaseException:\n        pass\n"
        if rng.random() < 0.5:
            source = f"def attempt():\n{tried}attempt()\n{RIGHT}"
        else:
            source = f"def r1(z, z_E):\n{tried}{body}"
        return _with(source, places), FIRST, does
    if kind == "theft":
        does = rng.choice(THEFTS)
        return _with(f"def r1(z, z_E):\n    got = {does}\n{body}", places), 0, does
    does = rng.choice(FAILURES)
    return _with(f"def r1(z, z_E):\n    {does}\n{body}", places), 0, does


def book(rng: random.Random, source: str = "") -> dict:
    """Notebook 6, each answer a little different from everybody else's."""
    made = copy.deepcopy(SOLVED)
    for cell in made["cells"]:
        mark = cell["metadata"].get("nbgrader", {}).get("grade_id", "")
        if mark.startswith("ex-"):
            own = source if source and mark == "ex-6-1" else "".join(cell["source"])
            cell["source"] = f"{own}\nmine_{rng.randrange(10**9)} = {rng.random()}\n"
    return made


def _broken_files(rng: random.Random, at: Path) -> tuple[float, str]:
    """A file or folder that is odd by itself; its points, and what it is."""
    text = json.dumps(book(rng))
    whole = FIRST + REST
    half = text[: rng.randrange(len(text) - 1)].encode()
    files = {
        "cut off": (half, 0),
        "noise": (rng.randbytes(rng.randrange(1, 10**5)), 0),
        "empty": (b" \n" * rng.randrange(9), 0),
        "UTF-16": (text.encode("utf-16"), whole),
        "UTF-8 with a mark": (text.encode("utf-8-sig"), whole),
        "not UTF-8": (b"\xff" + text.encode(), 0),
        "merge markers": (f"<<<<<<< HEAD\n{text}\n=======\n{text}\n>>>>>>> b\n".encode(), 0),
        "deep": (b"[" * rng.randrange(10**5, 10**6), 0),
        "deep, closed": (b"[" * 50_000 + b"]" * 50_000, 0),
        "many lists": (b'{"cells": [' + b"[]," * 10**6 + b"[]]}", 0),
        "a page": (b"<!doctype html><title>Sign in</title>", 0),
        "a number": (str(rng.random()).encode(), 0),
        "cells of nothing": (json.dumps({"cells": [None, 3, {}, []]}).encode(), 0),
    }  # fmt: skip
    places = ["pipe", "socket", "link", "loop", "folder", "sparse", "unreadable", "names"]
    does = rng.choice([*files, *places])
    at.mkdir()
    if does in files:
        (at / NAME).write_bytes(files[does][0])
        return files[does][1], does
    if does == "pipe":
        os.mkfifo(at / NAME)
    elif does == "socket":
        with contextlib.chdir(at):  # a socket's path may have 107 bytes
            socket.socket(socket.AF_UNIX).bind(NAME)
    elif does == "link":
        (at / NAME).symlink_to(at.parent / "whole-000" / NAME)
    elif does == "loop":
        (at / NAME).symlink_to(NAME)
    elif does == "folder":
        (at / NAME).mkdir()
        (at / NAME / NAME).write_text(text)
        return whole, does
    elif does == "sparse":
        with (at / NAME).open("wb") as f:
            f.truncate(rng.randrange(21 << 20, 1 << 33))
    elif does == "unreadable":
        (at / NAME).write_text(text)
        (at / NAME).chmod(0)
        return whole if os.geteuid() == 0 else 0, does
    else:
        name = rng.choice(["\u202egrade", "\x1b[2J", "a\nb", "=1+1", "\u00fc" * 60, "'; --", "-rf"])
        os.mkdir(os.fsencode(at) + b"/M\xfcller")
        (at / "desktop.ini").write_text("")
        (at / f"{name}.ipynb").write_text(text)
        return whole, does
    return 0, does


def make(folder: Path, out: Path, seed: int, whole: int, odd: int) -> dict[str, tuple[float, str]]:
    """A class in `folder`: submission -> (its points, what it does)."""
    folder.mkdir(parents=True)
    places = {"CLASS": str(folder), "OUT": str(out), "NAME": NAME}
    places |= {"SOLUTIONS": str(ROOT / "solutions"), "CHECKS": str(Path(__file__).resolve())}
    points = {}
    for i in range(whole):
        rng = random.Random(f"{seed} whole {i}")
        (folder / f"whole-{i:03}").mkdir()
        (folder / f"whole-{i:03}" / NAME).write_text(json.dumps(book(rng)))
        points[f"whole-{i:03}"] = FIRST + REST, "whole"
    for i in range(odd):
        rng, name = random.Random(f"{seed} odd {i}"), f"odd-{i:03}"
        if rng.random() < 0.25:
            points[name] = _broken_files(rng, folder / name)
            continue
        source, worth, does = answer(rng, places)
        (folder / name).mkdir()
        (folder / name / NAME).write_text(json.dumps(book(rng, source)))
        points[name] = worth + REST, does
    return points


def traces(*folders: Path) -> dict[str, object]:
    """What strangers' code could have left: files, with what is said of them, and shared memory."""
    found: dict[str, object] = {}
    for path in (p for folder in folders for p in sorted([folder, *folder.rglob("*")])):
        about = path.lstat()
        xattrs = () if path.is_symlink() else os.listxattr(path)
        plain = path.is_file() and not path.is_symlink() and about.st_size < 1 << 25
        data = (
            hashlib.sha256(path.read_bytes()).hexdigest() if plain and about.st_mode & 0o400 else ""
        )
        found[str(path)] = about.st_mode, about.st_uid, about.st_size, about.st_mtime, xattrs, data
    found["/dev/shm"] = "mine" in os.listdir("/dev/shm")
    for kind in ("shm", "msg", "sem"):
        found[kind] = "4711" in Path(f"/proc/sysvipc/{kind}").read_text().split()
    found["host"] = socket.gethostname(), sorted(os.sched_getaffinity(0)), os.nice(0)
    return found


def trial(folder: Path, out: Path, seed: int, whole: int, odd: int, *how: str) -> list[str]:
    """Make a class and grade it; all that was not as it should be, in sentences."""
    points = make(folder, out, seed, whole, odd)
    ctypes.CDLL(None).prctl(36, 1, 0, 0, 0)  # PR_SET_CHILD_SUBREAPER: orphans come to this process
    before, began = traces(folder), time.monotonic()
    code = grade([str(folder), "--out", str(out), "--notebooks", "6", *how])
    took, left = time.monotonic() - began, _children()
    wrong = [] if code == 0 else [f"the grader ended with {code}"]
    after = traces(folder)
    wrong += [f"{k} was {before.get(k)}, is {after.get(k)}" for k in {*before, *after}
              if before.get(k) != after.get(k)]  # fmt: skip
    wrong += [f"process {pid} is left" for pid in left]
    found = {}
    for path in out.glob("*/result.json"):
        done = json.loads(path.read_text())
        found[done["submission"]] = done["points"], [
            o["message"] for o in done["exercises"][0]["outcomes"]] + done["notes"]  # fmt: skip
    for name, (worth, does) in points.items():
        got, said = found.get(name, (None, ""))
        if got != worth:
            wrong.append(f"{name} ({does}): {got} points for {worth}; {said}")
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    own = resource.getrusage(resource.RUSAGE_SELF)
    cpu = sum(u.ru_utime + u.ru_stime for u in (spent, own))
    print(f"{len(points)} submissions, {took:.0f} s, {cpu:.0f} s of processor time")
    return wrong


def _children() -> list[str]:
    """Processes below this one, but for what has ended: bubblewrap leaves its orphans to us."""
    time.sleep(1)
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    return Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path, help="a new one")
    parser.add_argument("--whole", type=int, default=300)
    parser.add_argument("--odd", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    sandbox.WALL, sandbox.CPU = WALL, CPU
    wrong = trial(args.folder / "class", args.folder / "out", args.seed, args.whole, args.odd)
    print("\n".join(wrong) or "all as it should be")
