"""The two messages that go to Gazebo's services, in protobuf's wire format.

So the worker needs neither protobuf nor Gazebo's package of messages in the system's Python
(protobuf.dev/programming-guides/encoding).
"""

from __future__ import annotations

BOOLEAN = "gz.msgs.Boolean"
"""Type of the answer of the service `control`."""

STRING_DATA = 2
"""Number of the field `data` of gz.msgs.StringMsg."""

VARINT, I64, LEN, I32 = 0, 1, 2, 5
"""Wire types."""


def reset_request() -> bytes:
    """A gz.msgs.WorldControl whose field `reset` (5) is a gz.msgs.WorldReset with `all` (2)."""
    everything = bytes([2 << 3 | VARINT, 1])
    return bytes([5 << 3 | LEN, len(everything)]) + everything


def text_of(message: bytes) -> str:
    """The text in a gz.msgs.StringMsg; empty if it has none.

    Raises:
        ValueError: it is no message.
    """
    at, text = 0, b""
    while at < len(message):
        key, at = _varint(message, at)
        kind = key & 7
        if kind == VARINT:
            _, at = _varint(message, at)
            continue
        if kind == LEN:
            size, at = _varint(message, at)
        elif kind in (I32, I64):
            size = 4 if kind == I32 else 8
        else:
            raise ValueError(f"no wire type of protobuf: {kind}")
        if key == STRING_DATA << 3 | LEN:
            text = message[at : at + size]
        at += size
    if at > len(message):
        raise ValueError("the message ends too early")
    return text.decode()


def _varint(message: bytes, at: int) -> tuple[int, int]:
    """A number that begins at `at`, and where it ends."""
    value = shift = 0
    while True:
        if at >= len(message):
            raise ValueError("the message ends too early")
        byte = message[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at
