"""What a process gives up, for good, before it runs a line of a student's code.

Limits of resources, capabilities, files (Landlock), system calls (seccomp), and the number of
threads, which a process above counts. Linux only; each call of the kernel's is named by its manual
page: setrlimit(2), capset(2), landlock(7), seccomp(2), seccomp_unotify(2).
"""

import contextlib
import ctypes
import errno
import functools
import os
import signal
import socket
import struct

THREADS = 64  # of one process; a library that counts the cores of a large machine may want these


def confine(memory: int, cpu: int, files: int | None, above: socket.socket) -> None:
    """Limit this process for good.

    memory: bytes beyond what it has now. cpu: seconds. files: what `allow_files` made. above: the
    process that counts threads, see `count_threads`; it is sent where they ask. Raises OSError
    where a wall does not stand.
    """
    import resource  # not where a notebook's check() imports this, on Windows

    with open("/proc/self/statm") as f:
        size = int(f.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    limits = {
        resource.RLIMIT_AS: size + memory,
        resource.RLIMIT_CPU: cpu,
        resource.RLIMIT_FSIZE: 1 << 20,
        resource.RLIMIT_CORE: 0,
        resource.RLIMIT_NOFILE: 64,
        resource.RLIMIT_MEMLOCK: 0,
    }
    for what, most in limits.items():
        resource.setrlimit(what, (most, most))
    _libc("capset", struct.pack("=Ii", 0x20080522, 0), bytes(24))  # version 3; none is left
    _libc("prctl", 38, 1, 0, 0, 0)  # PR_SET_NO_NEW_PRIVS: what both walls below ask for first
    _libc("prctl", 1, signal.SIGKILL, 0, 0, 0)  # PR_SET_PDEATHSIG: it ends with its parent
    counted = ask_for_threads(above)
    if files is not None:
        _libc("syscall", RESTRICT_SELF, files, 0)
        os.close(files)
    filter_calls(counted)


def _libc(name: str, *args) -> int:
    """A function of libc by name; integers pass as longs. Raises OSError."""
    result = _function(name)(*(ctypes.c_long(a) if isinstance(a, int) else a for a in args))
    if result < 0:
        raise OSError(ctypes.get_errno(), f"{name}: {os.strerror(ctypes.get_errno())}")
    return result


@functools.cache
def _function(name: str):
    function = getattr(ctypes.CDLL(None, use_errno=True), name)
    function.restype = ctypes.c_long
    return function


HUGE, COLLAPSE = 2 << 20, 25  # bytes of a huge page; MADV_COLLAPSE, of Linux 6.1 and later


def gather_memory() -> None:
    """Put this process's memory on huge pages, where the kernel can.

    A fork copies an entry for every page, and its end clears them: with 300 MB on pages of 4 kB
    both take longer than most answers.
    """
    with open("/proc/self/maps") as f:
        lines = [line.split() for line in f]
    for place, rights, _, _, _, *name in lines:
        if "w" in rights and name in ([], ["[heap]"]):
            start, end = (int(x, 16) for x in place.split("-"))
            for at in range(-(-start // HUGE) * HUGE, end - HUGE + 1, HUGE):
                with contextlib.suppress(OSError):
                    _libc("madvise", at, HUGE, COLLAPSE)


CREATE_RULESET, ADD_RULE, RESTRICT_SELF = 444, 445, 446
EVERY_ACCESS = (1 << 13) - 1  # all that Landlock's first version knows: execute, write, read ...
READ_FILE, READ_DIR = 1 << 2, 1 << 3


def has_landlock() -> bool:
    """Whether this kernel has Landlock (Linux 5.13, where switched on), which keeps files away."""
    with contextlib.suppress(OSError):
        return _libc("syscall", CREATE_RULESET, None, 0, 1) >= 1
    return False


def allow_files(readable: list[str]) -> int | None:
    """A file that stands for Landlock's rules: no file opens but those at or below the `readable`
    paths, to be read. Made once, for all processes to come; None where there is no Landlock."""
    if not has_landlock():
        return None
    handled = ctypes.c_uint64(EVERY_ACCESS)
    rules = _libc("syscall", CREATE_RULESET, ctypes.byref(handled), 8, 0)
    for path in filter(os.path.exists, readable):
        place = os.open(path, os.O_PATH | os.O_CLOEXEC)
        access = READ_FILE | (READ_DIR if os.path.isdir(path) else 0)
        rule = ctypes.create_string_buffer(struct.pack("=Qi", access, place), 12)
        _libc("syscall", ADD_RULE, rules, 1, rule, 0)  # 1: what lies beneath a path
        os.close(place)
    return rules


# Calls that are allowed, by their numbers on x86_64 and aarch64, -1 where there is none. They
# compute, take memory, read what is open, look at the clock, or end this process.
COLUMN = {"x86_64": 0, "aarch64": 1}
ARCHITECTURE = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}
PLAIN = {
    "read": (0, 63), "readv": (19, 65), "pread64": (17, 67), "recvfrom": (45, 207),
    "write": (1, 64), "writev": (20, 66), "sendto": (44, 206), "close": (3, 57),
    "lseek": (8, 62), "dup": (32, 23), "dup2": (33, -1), "dup3": (292, 24),
    "stat": (4, -1), "lstat": (6, -1), "fstat": (5, 80), "newfstatat": (262, 79),
    "statx": (332, 291), "access": (21, -1), "faccessat": (269, 48), "faccessat2": (439, 439),
    "readlink": (89, -1), "readlinkat": (267, 78), "getdents64": (217, 61), "getcwd": (79, 17),
    "mmap": (9, 222), "munmap": (11, 215), "mremap": (25, 216), "mprotect": (10, 226),
    "madvise": (28, 233), "brk": (12, 214),
    "rt_sigaction": (13, 134), "rt_sigprocmask": (14, 135), "rt_sigreturn": (15, 139),
    "sigaltstack": (131, 132), "restart_syscall": (219, 128),
    "poll": (7, -1), "ppoll": (271, 73), "select": (23, -1), "pselect6": (270, 72),
    "nanosleep": (35, 101), "clock_nanosleep": (230, 115), "pause": (34, -1), "alarm": (37, -1),
    "setitimer": (38, 103), "getitimer": (36, 102), "time": (201, -1), "times": (100, 153),
    "gettimeofday": (96, 169), "clock_gettime": (228, 113), "clock_getres": (229, 114),
    "sched_yield": (24, 124), "sched_getaffinity": (204, 123), "getcpu": (309, 168),
    "futex": (202, 98), "set_robust_list": (273, 99), "rseq": (334, 293),
    "getpid": (39, 172), "gettid": (186, 178), "getppid": (110, 173), "getpgrp": (111, -1),
    "getuid": (102, 174), "geteuid": (107, 175), "getgid": (104, 176), "getegid": (108, 177),
    "uname": (63, 160), "sysinfo": (99, 179), "getrusage": (98, 165), "getrlimit": (97, 163),
    "getrandom": (318, 278), "exit": (60, 93), "exit_group": (231, 94),
}  # fmt: skip
OPEN, OPENAT, FCNTL, IOCTL, PRCTL = (2, -1), (257, 56), (72, 25), (16, 29), (157, 167)
KILL, TGKILL, PRLIMIT, CLONE = (62, 129), (234, 131), (302, 261), (56, 220)
WRITING = 0x1 | 0x2 | 0x40 | 0x200 | 0x400  # O_WRONLY, O_RDWR, O_CREAT, O_TRUNC, O_APPEND
DUPLICATE = (0, 1, 2, 3, 1030)  # F_DUPFD, F_GETFD, F_SETFD, F_GETFL, F_DUPFD_CLOEXEC
TERMINAL = (0x5401, 0x5413, 0x5450, 0x5451)  # TCGETS (isatty), TIOCGWINSZ, FIONCLEX, FIOCLEX
NAMES = (15, 16, 0x53564D41)  # PR_SET_NAME, PR_GET_NAME, PR_SET_VMA (what memory is called)
THREAD = 0x3D0F00  # what pthread_create asks clone for: a thread of this process, nothing else
NEWER = 424  # from here on libc knows another way where a call does not exist, as for clone3

# A classic BPF program over struct seccomp_data: the call's number at 0, the architecture at 4,
# the low half of argument i at 16 + 8 i, its high half 4 behind.
LOAD, EQUAL, AT_LEAST, ANY_BIT, RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
ALLOW, ERRNO, NOTIFY = 0x7FFF0000, 0x00050000, 0x7FC00000
REFUSE = ERRNO | errno.EPERM


def _number(call: tuple[int, int]) -> int:
    return call[COLUMN[os.uname().machine]]


def _only(call: tuple[int, int], argument: int, values: tuple[int, ...]) -> list:
    """Lines that allow a call where the low half of an argument is one of `values`."""
    tests = [line for v in values for line in ((EQUAL, 0, 1, v), (RETURN, 0, 0, ALLOW))]
    return _where(call, [(LOAD, 0, 0, 16 + 8 * argument), *tests, (RETURN, 0, 0, REFUSE)])


def _where(call: tuple[int, int], lines: list) -> list:
    """Lines that judge one call; they end in a verdict."""
    return [(EQUAL, 0, len(lines), _number(call)), *lines] if _number(call) >= 0 else []


def filter_calls(threads: bool) -> None:
    """Allow the calls above and no other: seccomp. threads: whether new ones are counted."""
    before, after = allowed(threads)
    own = (os.getpid(),)  # not 0 or -1, which are many
    _seccomp(before + _code(_only(KILL, 0, own) + _only(TGKILL, 0, own)) + after, 0)


@functools.cache  # filled before the fork: all but a process's own number is the same for all
def allowed(threads: bool) -> tuple[bytes, bytes]:
    """The filter but for the lines on signals, which stand between these two pieces."""
    machine = os.uname().machine
    if machine not in COLUMN:
        raise OSError(f"seccomp: the calls of {machine} are not known here, only {[*COLUMN]}")
    program = [(LOAD, 0, 0, 4), (EQUAL, 1, 0, ARCHITECTURE[machine]), (RETURN, 0, 0, REFUSE)]
    program += [(LOAD, 0, 0, 0)]
    for call in PLAIN.values():
        program += _where(call, [(RETURN, 0, 0, ALLOW)])
    for call, flags in ((OPEN, 1), (OPENAT, 2)):
        verdicts = [(RETURN, 0, 0, REFUSE), (RETURN, 0, 0, ALLOW)]
        judged = [(LOAD, 0, 0, 16 + 8 * flags), (ANY_BIT, 0, 1, WRITING), *verdicts]
        program += _where(call, judged)
    program += _only(FCNTL, 1, DUPLICATE) + _only(IOCTL, 1, TERMINAL) + _only(PRCTL, 0, NAMES)
    mine = [(LOAD, 0, 0, 16), (EQUAL, 1, 0, 0), (RETURN, 0, 0, REFUSE)]
    reads = [line for half in (32, 36) for line in ((LOAD, 0, 0, half), *mine[1:])]  # no new limit
    program += _where(PRLIMIT, [*mine, *reads, (RETURN, 0, 0, ALLOW)])
    program += _only(CLONE, 0, (THREAD,) if threads else ())
    after = [(AT_LEAST, 0, 1, NEWER), (RETURN, 0, 0, ERRNO | errno.ENOSYS), (RETURN, 0, 0, REFUSE)]
    return _code(program), _code(after)


def _code(program: list) -> bytes:
    return b"".join(struct.pack("<HBBI", *line) for line in program)


def _seccomp(code: bytes, flags: int) -> int:
    buffer = ctypes.create_string_buffer(code, len(code))
    header = struct.pack("@HP", len(code) // 8, ctypes.addressof(buffer))
    number = {"x86_64": 317, "aarch64": 277}[os.uname().machine]
    return _libc("syscall", number, 1, flags, header)  # 1: SECCOMP_SET_MODE_FILTER


NEW_LISTENER = 8
RECEIVE, SEND = 0xC0502100, 0xC0182101  # SECCOMP_IOCTL_NOTIF_RECV and _SEND
GO_ON = 1  # SECCOMP_USER_NOTIF_FLAG_CONTINUE


def ask_for_threads(above: socket.socket) -> bool:
    """From now on each new thread is asked for, at a file that goes to the process `above`.

    False, and nothing is sent, where the kernel cannot (before Linux 5.5).
    """
    program = [(LOAD, 0, 0, 0), (EQUAL, 0, 1, _number(CLONE))]
    program += [(RETURN, 0, 0, NOTIFY), (RETURN, 0, 0, ALLOW)]
    try:
        listener = _seccomp(_code(program), NEW_LISTENER)
    except OSError:
        return False
    socket.send_fds(above, [b"t"], [listener])
    os.close(listener)
    return True


def count_threads(listener: int, pid: int) -> None:
    """Answer one question of process `pid`: a new thread, yes, unless it has THREADS."""
    import fcntl

    with contextlib.suppress(OSError):  # it is gone
        asked = bytearray(80)
        fcntl.ioctl(listener, RECEIVE, asked)
        many = len(os.listdir(f"/proc/{pid}/task")) >= THREADS
        verdict = (0, -errno.EAGAIN, 0) if many else (0, 0, GO_ON)
        fcntl.ioctl(listener, SEND, struct.pack("=8sqiI", bytes(asked[:8]), *verdict))
