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

HEAD, CHUNK = 4, 1 << 16
"""Bytes of a message's length, and those that are read from a socket at once."""


def pack(value: Any) -> Any:
    """Plain data from nested data with arrays, numpy scalars and tuples in it."""
    if isinstance(value, np.ndarray):
        return {"__array__": [value.dtype.str, list(value.shape), value.tobytes()]}
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


class Frames:
    """Messages through a socket, each with its length before it."""

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self._timeout: float | None = None
        self._came = bytearray()

    def send(self, message: bytes) -> None:
        self._socket.sendall(len(message).to_bytes(HEAD, "big") + message)

    def receive(self, timeout: float | None = None) -> bytes | None:
        """The next message; None: an empty one, or there is no other side.

        Raises:
            TimeoutError: nothing came for `timeout` [s]; what had come is kept.
        """
        if timeout != self._timeout:  # a call of the kernel each time
            self._socket.settimeout(timeout)
            self._timeout = timeout
        came = self._came
        while len(came) < (end := HEAD + int.from_bytes(came[:HEAD], "big")):
            more = self._socket.recv(CHUNK)  # most messages at once
            if not more:
                return None
            came += more
        message = bytes(came[HEAD:end])
        del came[:end]
        return message or None

    def close(self) -> None:
        self._socket.close()


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
