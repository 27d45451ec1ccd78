"""Values as bytes, between the judge and the process where a student's code runs.

Numbers, strings, None, lists, tuples, dicts, numpy arrays and torch tensors pass, and what is one
of these by another name, such as a namedtuple. Anything else arrives as `Other`, its type's name.
Nothing is unpickled: bytes from a hostile process become plain values or `Garbage`.
"""

import json
import math
import struct
from array import array
from collections import deque
from decimal import Decimal
from fractions import Fraction

import numpy as np

MOST = 64 << 20  # bytes of one message
ANSWER = 4 << 20  # bytes of an answer; the longest right one has 6,000
DEEPEST = 20  # levels of lists in lists
LARGEST = 1 << 63  # ints from here on are no numbers to numpy
DTYPES = {
    f"{kind}{size}"
    for kind, sizes in {"f": (2, 4, 8), "i": (1, 2, 4, 8), "u": (1, 2, 4, 8)}.items()
    for size in sizes
} | {"b1", "c8", "c16"}
LONG = {"g": "f8", "G": "c16"}  # of as many bits as a processor likes
RAISED = {"raised": 100, "text": 1000, "line": 200}  # characters of each
KEYS = (str, int, bool, type(None))  # of a dict; numbers of other kinds can share one hash


class Garbage(ValueError):
    """Bytes that no `encode` wrote."""


class Other(str):
    """A value that cannot pass, by the name of its type."""


class Raised(str):
    """What the student's code raised, by the name of its type; `.text` is its message, and `.line`
    the line of the student's code that it came from, if it came from one."""

    def __new__(cls, name, text="", line=""):
        self = super().__new__(cls, name)
        self.text, self.line = text, line
        return self

    def in_full(self) -> str:
        """All of it, on one line."""
        said = f"{self}: {self.text}" if self.text else f"{self}"
        return f"{said} ({self.line})" if self.line else said


def as_numbers(x: np.ndarray) -> np.ndarray:
    """An array of objects as one of numbers, if they are."""
    try:
        return x.astype(float)
    except (TypeError, ValueError, OverflowError):
        return x


def encode(value) -> bytes:
    """Header (JSON) and buffers (raw) of a value."""
    buffers = []

    def pack(x, deep):
        if deep > DEEPEST:
            return {"other": "a list of lists without end"}
        kind = type(x)
        if x is None or kind is bool:
            return {"v": x}
        if isinstance(x, str) and kind is not Other and kind is not Raised:
            return {"v": str.__str__(x)}  # of np.str_ and the like, too
        if kind is int or (isinstance(x, int) and not isinstance(x, np.generic)):
            return {"int": str(int(x))} if abs(x) < LARGEST else {"other": "a huge int"}
        if isinstance(x, Fraction | Decimal | float) and not isinstance(x, np.generic):
            x, kind = float(x), float
        if kind is float:
            return {"float": x.hex() if math.isfinite(x) else repr(x)}
        if isinstance(x, tuple):  # a namedtuple, too
            return {"tuple": [pack(item, deep + 1) for item in tuple(x)]}
        if isinstance(x, list | range | deque):
            return {"list": [pack(item, deep + 1) for item in list(x)]}
        if isinstance(x, dict):
            return {"dict": [[pack(k, deep + 1), pack(v, deep + 1)] for k, v in dict(x).items()]}
        if kind is Raised:
            return {"raised": str(x), "text": x.text, "line": x.line}
        if kind is Other:
            return {"other": str(x)}
        tensor = kind.__module__.split(".")[0] == "torch" and hasattr(x, "detach")
        if tensor:
            if x.device.type != "cpu":
                return {"other": f"a tensor on {x.device}"}
            x = x.detach().resolve_conj().resolve_neg().numpy()
        if isinstance(x, np.generic | complex):
            x, tensor = np.asarray(x), "scalar"
        if isinstance(x, array):
            x = np.asarray(x)
        if hasattr(x, "__array__") and type(x) is not np.ndarray and not isinstance(x, type):
            x = np.asarray(x)  # another library's array
        if type(x) is np.ndarray and x.dtype == object:
            x = as_numbers(x)
        if type(x) is np.ndarray and x.dtype.char in LONG:
            x = x.astype(LONG[x.dtype.char])
        if type(x) is np.ndarray and x.dtype.str[1:] in DTYPES:
            # A fresh contiguous copy, so that views and odd strides pass.
            x = np.array(x, order="C", dtype=x.dtype.newbyteorder("="))
            buffers.append(x.tobytes())
            return {"array": x.dtype.str[1:], "shape": list(x.shape), "kind": tensor}
        return {"other": kind.__name__}

    header = json.dumps(pack(value, 0)).encode()
    return b"".join([struct.pack("<Q", len(header)), header, *buffers])


def decode(data: bytes, tensor=None):
    """The value of `encode`'s bytes. tensor: makes a tensor of an array; else it stays an array.

    Raises Garbage.
    """
    try:
        (n,) = struct.unpack_from("<Q", data)
        header = json.loads(data[8 : 8 + n])
        place = 8 + n

        def unpack(x, deep):
            nonlocal place
            if deep > DEEPEST + 1:
                raise Garbage("too deep")
            if "v" in x:
                if not (x["v"] is None or isinstance(x["v"], bool | str)):
                    raise Garbage("not a plain value")
                return x["v"]
            if "int" in x:
                if len(x["int"]) > 20 or abs(int(x["int"])) >= LARGEST:
                    raise Garbage("a huge int")
                return int(x["int"])
            if "float" in x:
                return float.fromhex(x["float"])
            if "list" in x:
                return [unpack(item, deep + 1) for item in x["list"]]
            if "tuple" in x:
                return tuple(unpack(item, deep + 1) for item in x["tuple"])
            if "dict" in x:
                pairs = [(unpack(k, deep + 1), unpack(v, deep + 1)) for k, v in x["dict"]]
                return {k if type(k) in KEYS else Other(type(k).__name__): v for k, v in pairs}
            if "raised" in x:
                return Raised(*(_text(x[part], most) for part, most in RAISED.items()))
            if "array" in x:
                sizes = all(type(k) is int and 0 <= k < LARGEST for k in x["shape"])
                if len(x["shape"]) > 8 or x["array"] not in DTYPES or not sizes:
                    raise Garbage("no such array")
                dtype = np.dtype(x["array"])
                size = math.prod(x["shape"]) * dtype.itemsize
                if place + size > len(data):
                    raise Garbage("an array longer than its bytes")
                flat = np.frombuffer(data, dtype, math.prod(x["shape"]), place)
                array = flat.reshape(x["shape"]).copy()
                place += size
                if x["kind"] == "scalar" and array.ndim == 0:
                    return array[()]
                return tensor(array) if x["kind"] is True and tensor else array
            return Other(_text(x["other"], 100))

        return unpack(header, 0)
    except Garbage:
        raise
    except (
        struct.error,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        RecursionError,
        OverflowError,
    ) as e:
        raise Garbage(str(e)) from None


def _text(x, most: int) -> str:
    """Text that can be written; a lone surrogate cannot."""
    return str(x)[:most].encode(errors="backslashreplace").decode()


def send(channel, data: bytes) -> None:
    channel.sendall(struct.pack("<Q", len(data)) + data)


def receive(channel) -> bytes:
    """One message. Raises EOFError where the other side is gone, Garbage where it is too long."""

    def exactly(n):
        parts = []
        while n:
            part = channel.recv(min(n, 1 << 20))
            if not part:
                raise EOFError
            parts.append(part)
            n -= len(part)
        return b"".join(parts)

    (n,) = struct.unpack("<Q", exactly(8))
    if n > MOST:
        raise Garbage("a message too long")
    return exactly(n)
