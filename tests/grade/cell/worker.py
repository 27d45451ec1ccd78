"""The process where a student's code runs: source and inputs come in, values go out.

It judges nothing. Started as `python -I worker.py FD READABLE...`, best inside bubblewrap. It
imports the slow libraries once, and forks for every exercise; the fork confines itself before it
runs a line of the student's.
"""

import contextlib
import ctypes
import io
import os
import resource
import socket
import struct
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import answer
import wire


def confine(memory: int, cpu: int, readable: list[str]) -> None:
    """Limit this process for good.

    memory: bytes beyond what it has now. cpu: seconds. readable: paths.
    """
    with open("/proc/self/statm") as f:
        size = int(f.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    limits = {
        resource.RLIMIT_AS: size + memory,
        resource.RLIMIT_CPU: cpu,
        resource.RLIMIT_FSIZE: 1 << 20,
        resource.RLIMIT_CORE: 0,
        resource.RLIMIT_NOFILE: 64,
    }
    for what, most in limits.items():
        resource.setrlimit(what, (most, most))
    _prctl(38, 1)  # PR_SET_NO_NEW_PRIVS: what both walls below ask for first
    if has_landlock():
        close_files(readable)
    filter_calls()


def _call(number: int, *args) -> int:
    """A system call that libc has no name for. Raises OSError."""
    libc = ctypes.CDLL(None, use_errno=True)
    result = libc.syscall(ctypes.c_long(number), *args)
    if result < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return result


def _prctl(option: int, *args) -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(option, *args, *[0] * (4 - len(args))):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


CREATE_RULESET, ADD_RULE, RESTRICT_SELF = 444, 445, 446
EVERY_ACCESS = (1 << 13) - 1  # all that Landlock's first version knows: execute, write, read ...
READ_FILE, READ_DIR = 1 << 2, 1 << 3


def has_landlock() -> bool:
    """Whether this kernel has Landlock (Linux 5.13, where switched on), which keeps files away."""
    with contextlib.suppress(OSError):
        return _call(CREATE_RULESET, None, ctypes.c_size_t(0), 1) >= 1
    return False


def close_files(readable: list[str]) -> None:
    """No file opens any more but those at or below the `readable` paths, to be read: Landlock."""
    handled = ctypes.c_uint64(EVERY_ACCESS)
    rules = _call(CREATE_RULESET, ctypes.byref(handled), ctypes.c_size_t(8), 0)
    for path in filter(os.path.exists, readable):
        place = os.open(path, os.O_PATH | os.O_CLOEXEC)
        access = READ_FILE | (READ_DIR if os.path.isdir(path) else 0)
        rule = ctypes.create_string_buffer(struct.pack("=Qi", access, place), 12)
        _call(ADD_RULE, rules, 1, rule, 0)  # 1: what lies beneath a path
        os.close(place)
    _call(RESTRICT_SELF, rules, 0)
    os.close(rules)


# A classic BPF program over struct seccomp_data: the call's number at 0, the architecture at 4,
# argument i at 16 + 8 i.
LOAD, EQUAL, ANY_BIT, RETURN = 0x20, 0x15, 0x45, 0x06
ALLOW, ERRNO = 0x7FFF0000, 0x00050000
EPERM, ENOSYS = 1, 38
X86_64 = 0xC000003E
DENIED = {
    "fork": 57, "vfork": 58, "execve": 59, "execveat": 322, "socket": 41, "socketpair": 53,
    "connect": 42, "bind": 49, "ptrace": 101, "process_vm_readv": 310, "process_vm_writev": 311,
    "setsid": 112, "creat": 85, "truncate": 76, "rename": 82, "renameat": 264, "renameat2": 316,
    "unlink": 87, "unlinkat": 263, "mkdir": 83, "mkdirat": 258, "rmdir": 84, "symlink": 88,
    "symlinkat": 266, "link": 86, "linkat": 265, "chmod": 90, "fchmod": 91, "fchmodat": 268,
    "chown": 92, "mount": 165, "unshare": 272, "setns": 308, "bpf": 321, "keyctl": 250,
    "memfd_create": 319, "io_uring_setup": 425, "io_uring_enter": 426, "pidfd_open": 434,
    "pidfd_send_signal": 424, "openat2": 437, "fchmodat2": 452, "setpriority": 141,
    "rt_sigqueueinfo": 129, "rt_tgsigqueueinfo": 297, "setrlimit": 160, "tkill": 200,
}  # fmt: skip
KILL, TGKILL, PRLIMIT, CLONE, CLONE3, OPEN, OPENAT = 62, 234, 302, 56, 435, 2, 257
CLONE_THREAD = 0x10000
WRITING = 0x1 | 0x2 | 0x40 | 0x200 | 0x400  # O_WRONLY, O_RDWR, O_CREAT, O_TRUNC, O_APPEND


def filter_calls() -> None:
    """No new process, no signal to another, no socket, no file opened for writing: seccomp."""
    program = [(LOAD, 0, 0, 4), (EQUAL, 1, 0, X86_64), (RETURN, 0, 0, ERRNO | EPERM)]
    program += [(LOAD, 0, 0, 0)]
    # the x32 table of calls
    program += [(ANY_BIT, 0, 1, 0x40000000), (RETURN, 0, 0, ERRNO | ENOSYS)]
    for number in DENIED.values():
        program += [(EQUAL, 0, 1, number), (RETURN, 0, 0, ERRNO | EPERM)]
    # glibc falls back to clone, whose flags a filter can read, where clone3 does not exist.
    program += [(EQUAL, 0, 1, CLONE3), (RETURN, 0, 0, ERRNO | ENOSYS)]

    def judged(number, argument, jump, constant, allowed):
        """Deny call `number` unless `jump` on the low half of its argument says `allowed`."""
        verdict = [ALLOW, ERRNO | EPERM] if allowed else [ERRNO | EPERM, ALLOW]
        return [
            (EQUAL, 0, 4, number),
            (LOAD, 0, 0, 16 + 8 * argument),
            (jump, 0, 1, constant),
            *((RETURN, 0, 0, v) for v in verdict),
        ]

    program += judged(CLONE, 0, ANY_BIT, CLONE_THREAD, True)
    program += judged(OPEN, 1, ANY_BIT, WRITING, False)
    program += judged(OPENAT, 2, ANY_BIT, WRITING, False)
    for number in (KILL, TGKILL):
        program += judged(number, 0, EQUAL, os.getpid(), True)
    program += judged(PRLIMIT, 2, EQUAL, 0, True)  # no new limit: only to be read
    program += [(RETURN, 0, 0, ALLOW)]

    code = b"".join(struct.pack("<HBBI", *line) for line in program)
    buffer = ctypes.create_string_buffer(code, len(code))
    header = struct.pack("@HP", len(program), ctypes.addressof(buffer))
    _prctl(22, 2, header)  # PR_SET_SECCOMP, SECCOMP_MODE_FILTER


def run(job: dict, channel) -> None:
    """Define the student's names and call the probe on every input the judge sends."""

    def say(value):
        wire.send(channel, wire.encode(value))

    try:
        cells = answer.define(job)
        exec(compile(job["probe"], "the check", "exec"), cells.names)
    except BaseException as e:
        say(wire.Raised(type(e).__name__, str(e)[:1000]))
        return
    say(None)
    below = job["below"]
    while True:
        try:
            request = wire.receive(channel)
        except EOFError:  # the judge has hung up
            return
        value, changed, e = answer.ask(cells.names["probe"], request, BaseException)
        if below and isinstance(e, NameError | AttributeError):
            cells.fill(below)
            below = []
            value, changed, e = answer.ask(cells.names["probe"], request, BaseException)
        if e is not None:
            value = answer.explained(value, e, cells.why)
        say([value, changed])


def main(fd: int, readable: list[str]) -> None:
    """Serve exercises until the judge hangs up. readable: paths that a student's code may read.

    For each it forks a process with a channel of its own, whose other end goes to the judge; on
    `control`, which that process does not have, it says when that process has ended.
    """
    control = socket.socket(fileno=fd)
    exec(answer.PREAMBLE, space := {})
    import gymnasium  # noqa: F401 (imported before the fork, for speed)
    import pybullet  # noqa: F401

    space["torch"].set_num_threads(1)
    sys.meta_path[:0] = [answer.Hidden(), answer.Drawing()]
    wire.send(control, b"ready")
    while True:
        try:
            job = wire.decode(wire.receive(control))
        except EOFError:
            return
        theirs, ours = socket.socketpair()
        socket.send_fds(control, [b"."], [theirs.fileno()])
        pid = os.fork()
        if pid == 0:
            control.close()
            theirs.close()
            serve(job, ours, readable)
        theirs.close()
        ours.close()
        os.waitpid(pid, 0)
        wire.send(control, b"ended")


def serve(job: dict, channel, readable: list[str]) -> None:
    """One exercise, in a process of its own. Never returns."""
    try:
        os.chdir("/")
        sys.stdin = io.StringIO()
        confine(job["memory"], job["cpu"], readable)
    except BaseException as e:  # never run a stranger's code unconfined
        wire.send(channel, wire.encode(f"unconfined: {e}"))
        os._exit(1)
    try:
        run(job, channel)
    finally:
        os._exit(0)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2:])
