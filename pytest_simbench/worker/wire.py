"""What crosses the boundary: arrays, as bytes with dtype and shape inside what execnet carries, and
texts of exceptions, made fit to travel and to be kept, whatever they hold."""

from __future__ import annotations

import socket
from typing import Any

import numpy as np

LONGEST = 2000
"""Characters of a message that are kept; the log holds more."""

LONGEST_LOGGED = 100_000
"""Characters of a message, or of a traceback, in the log."""


def pack(value: Any) -> Any:
    """Plain data from nested data with arrays, numpy scalars and tuples in it."""
    if isinstance(value, np.ndarray):
        array = np.asarray(value, order="C")
        return {"__array__": [array.dtype.str, list(array.shape), array.tobytes()]}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, dict):
        return {key: pack(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [pack(item) for item in value]
    return value


def unpack(value: Any) -> Any:
    """The inverse of `pack`; tuples come back as lists, arrays are writable."""
    if isinstance(value, dict):
        if "__array__" in value:
            dtype, shape, data = value["__array__"]
            return np.frombuffer(bytearray(data), dtype=dtype).reshape(shape)
        return {key: unpack(item) for key, item in value.items()}
    if isinstance(value, list):
        return [unpack(item) for item in value]
    return value


def frame(data: bytes) -> bytes:
    """Bytes as they go through a socket, their number first."""
    return len(data).to_bytes(4, "big") + data


def framed(connection: socket.socket) -> bytes | None:
    """The next bytes that came through a socket; None: there are none.

    A time-out holds until the first of them has come.
    """
    head = connection.recv(4, socket.MSG_WAITALL)
    length = int.from_bytes(head, "big") if len(head) == 4 else 0
    parts = []
    while length and (part := connection.recv(length, socket.MSG_WAITALL)):
        parts.append(part)
        length -= len(part)
    return b"".join(parts) or None


def readable(text: str, longest: int = LONGEST) -> str:
    """The text as plain Unicode, and how much of it was cut off."""
    text = str.encode(text, "utf-8", "backslashreplace").decode("utf-8")  # of any kind of text
    cut = len(text) - longest
    return text if cut <= 0 else f"{text[:longest]} ... ({cut} more characters)"


def told(error: BaseException, longest: int = LONGEST) -> str:
    """The message of an exception, or what keeps it from having one."""
    try:
        return readable(str(error), longest)
    except BaseException as another:
        return f"(its message cannot be read: {readable(type(another).__name__)})"


def named(error: BaseException) -> str:
    """Type and message of an exception."""
    name, message = readable(type(error).__name__), told(error)
    return f"{name}: {message}" if message else name


def shown(value: Any) -> str:
    """A value for a message on a wrong one; short, whatever it is."""
    try:
        return readable(repr(value))[:80]
    except BaseException:
        return f"a {readable(type(value).__name__)}"
