"""The process where a student's code runs: source and inputs come in, values go out.

It judges nothing. Started as `python -I worker.py FD READABLE...`, best inside bubblewrap. It
imports the slow libraries once, and forks for every exercise of every submission; the fork confines
itself before it runs a line of the student's. This process runs none, and ends the fork when the
judge has seen enough of it.
"""

import gc
import importlib
import io
import os
import select
import signal
import socket
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import answer
import walls
import wire

# What answers import, and what is slow to import or read on demand: all before the fork.
USED = ("cv2", "fcntl", "gymnasium", "numpy.ma", "numpy.random", "pybullet", "resource")

del sys.modules["wire"]  # a cell that patches what it finds there patches nothing of ours


def run(job: dict | None, channel) -> None:
    """Do one job, and others of the same student that the judge sends after an empty message."""
    while job:
        job = define_and_answer(job, channel)


def define_and_answer(job: dict, channel) -> dict | None:
    """Define the student's names and call the probe on every input the judge sends.

    Returns the next job, None where the judge has hung up.
    """

    def say(value, changed=None):
        data = wire.encode(value if changed is None else [value, changed])
        if len(data) > wire.ANSWER:
            data = wire.encode([wire.Other(f"a value above {wire.ANSWER >> 20} MB"), False])
        wire.send(channel, data)

    try:
        cells = answer.define(job)
        watched = answer.watch(cells.names, job)
    except BaseException as e:
        say(answer.raised(e))
        return None
    say(None)
    below = job["below"]
    while True:
        try:
            request = wire.receive(channel)
        except EOFError:  # the judge has hung up
            return None
        if not request:
            return wire.decode(wire.receive(channel))
        value, changed, e = answer.ask(cells.names["probe"], watched, request, BaseException)
        if below and isinstance(e, NameError | AttributeError):
            cells.fill(below)
            below = []
            value, changed, e = answer.ask(cells.names["probe"], watched, request, BaseException)
        if e is not None:
            value = answer.explained(value, e, cells.why)
        say(value, changed)


def main(fd: int, readable: list[str]) -> None:
    """Serve exercises until the judge hangs up. readable: paths that a student's code may read.

    For each it forks a process with a channel of its own, whose other end goes to the judge. On
    `control`, which that process does not have, the judge asks for its end, and hears of it.
    """
    control = socket.socket(fileno=fd)
    gc.disable()  # it would look at all that is loaded again and again, and find nothing to free
    exec(answer.PREAMBLE, space := {})
    for name in USED:
        importlib.import_module(name)
    space["torch"].set_num_threads(1)
    sys.meta_path[:0] = [answer.Hidden(), answer.Drawing()]
    files = walls.allow_files(readable)
    for threads in (True, False):
        walls.allowed(threads)
    gc.freeze()  # or each fork's collector would write to, and so copy, all that is loaded here
    gc.enable()
    walls.gather_memory()
    wire.send(control, b"ready")
    while True:
        try:
            job = wire.decode(wire.receive(control))
        except EOFError:
            return
        for source, course in (*job["helpers"], *job["below"]):
            if course:
                answer.learn(source)
        theirs, ours = socket.socketpair()
        below, above = socket.socketpair()
        socket.send_fds(control, [b"."], [theirs.fileno()])
        pid = os.fork()
        if pid == 0:
            for other in (control, theirs, below):
                other.close()
            serve(job, ours, above, files)
        for other in (theirs, ours, above):
            other.close()
        attend(control, below, pid)
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        wire.send(control, b"ended")


def attend(control, below, pid: int) -> None:
    """Count the threads of the fork `pid` until the judge sends a word, or is gone."""
    waiting, listener = select.poll(), None
    for source in (control, below):
        waiting.register(source, select.POLLIN)
    try:
        while True:
            for place, event in waiting.poll():
                if place == control.fileno():
                    control.recv(8)  # an empty message
                    return
                if place == listener and event & select.POLLIN:
                    walls.count_threads(listener, pid)
                    continue
                waiting.unregister(place)  # below speaks once, before the student's first line
                if place == below.fileno():
                    listener = next(iter(socket.recv_fds(below, 1, 1)[1]), None)
                    if listener is not None:
                        waiting.register(listener, select.POLLIN)
    finally:
        below.close()
        if listener is not None:
            os.close(listener)


def serve(job: dict, channel, above, files: int | None) -> None:
    """One exercise, in a process of its own, with Landlock's rules in `files`. Never returns."""
    try:
        os.chdir("/")
        sys.stdin = io.StringIO()
        silence = os.open(os.devnull, os.O_RDWR)
        for place in (0, 1, 2):
            os.dup2(silence, place)
        first = 3
        rules = [] if files is None else [files]
        for kept in sorted((channel.fileno(), above.fileno(), *rules)):
            os.closerange(first, kept)
            first = kept + 1
        os.closerange(first, 1 << 20)
        walls.confine(job["memory"], job["cpu"], files, above)
        above.close()
    except BaseException as e:  # never run a stranger's code unconfined
        wire.send(channel, wire.encode(f"unconfined: {e}"))
        os._exit(1)
    wire.send(channel, wire.encode("confined"))
    try:
        run(job, channel)
    finally:
        os._exit(0)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2:])
