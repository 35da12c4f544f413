"""Arrays and texts of exceptions survive the wire, whatever they hold."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from pytest_simbench.worker import wire
from pytest_simbench.worker.wire import LONGEST, LONGEST_LOGGED, named, pack, readable, told, unpack

arrays = npst.arrays(
    st.sampled_from([np.float64, np.int64, np.uint8, np.bool_]),
    npst.array_shapes(min_dims=0, max_dims=3, min_side=0),
)


@given(arrays)
def test_arrays_come_back(array: np.ndarray) -> None:
    there = unpack(pack({"a": [array, {"b": array}]}))
    for back in (there["a"][0], there["a"][1]["b"]):
        assert back.dtype == array.dtype
        assert back.shape == array.shape
        assert np.array_equal(back, array, equal_nan=array.dtype.kind == "f")


def test_what_the_wire_carries() -> None:
    array = np.arange(6.0).reshape(2, 3).T  # not in C's order
    packed = pack(array)
    assert packed == {"__array__": ["<f8", [3, 2], np.ascontiguousarray(array).tobytes()]}
    back = unpack(packed)
    assert np.array_equal(back, array)
    back[0, 0] = 7.0  # it may be written to
    plain = ["a", None, 1, {"b": [2.5, 2]}]
    assert pack(["a", None, 1, {"b": (np.float64(2.5), np.int32(2))}]) == plain
    assert unpack({"a": [1, {"b": None}]}) == {"a": [1, {"b": None}]}


@pytest.fixture
def two_ends() -> Iterator[tuple[socket.socket, wire.Frames]]:
    """Of a socket: one that sends bytes, one that reads messages."""
    sender, receiver = socket.socketpair()
    with sender, receiver:
        yield sender, wire.Frames(receiver)


def test_messages_come_whole_and_in_order(two_ends: tuple[socket.socket, wire.Frames]) -> None:
    sender, reader = two_ends
    sent = [b"a", bytes(range(256)) * (wire.CHUNK // 256 + 1), b"\0\0\0\1", b"x" * wire.CHUNK]
    thread = threading.Thread(target=lambda: [*map(wire.Frames(sender).send, sent)])
    thread.start()
    assert [reader.receive(5.0) for _ in sent] == sent
    thread.join()


@given(st.lists(st.binary(max_size=9), min_size=1, max_size=4), st.data())
def test_however_the_bytes_are_cut(messages: list[bytes], data: st.DataObject) -> None:
    sender, receiver = socket.socketpair()
    with sender, receiver:
        raw = b"".join(len(message).to_bytes(4, "big") + message for message in messages)
        cuts = sorted(data.draw(st.lists(st.integers(0, len(raw)), max_size=5)))
        reader, found = wire.Frames(receiver), []
        for begin, end in pairwise([0, *cuts, len(raw)]):
            sender.sendall(raw[begin:end])
            try:
                while len(found) < len(messages):
                    found.append(reader.receive(0.0))
            except BlockingIOError:  # what is not whole is kept
                continue
    assert found == [message or None for message in messages]


def test_no_message_in_time_and_no_other_side(two_ends: tuple[socket.socket, wire.Frames]) -> None:
    sender, reader = two_ends
    sender.sendall(b"\0\0\0\2a")
    with pytest.raises(TimeoutError):
        reader.receive(0.01)
    sender.close()
    assert reader.receive() is None


def test_how_much_is_kept() -> None:
    assert (LONGEST, LONGEST_LOGGED) == (2000, 100_000)
    assert readable("x" * 2000) == "x" * 2000
    assert readable("x" * 2001) == "x" * 2000 + " ... (1 more characters)"
    assert readable("abcdef", 4) == "abcd ... (2 more characters)"
    assert told(ValueError("abcdef"), 4) == "abcd ... (2 more characters)"


def test_half_a_character_is_written_out() -> None:
    assert readable("a\ud800b") == "a\\ud800b"
    assert readable("\u00e4\u2713") == "\u00e4\u2713"


class Mute(Exception):
    def __str__(self) -> str:
        raise RuntimeError("no text")


@pytest.mark.parametrize(
    ("error", "message", "name"),
    [
        (ValueError("so"), "so", "ValueError: so"),
        (ValueError(), "", "ValueError"),
        (
            Mute(),
            "(its message cannot be read: RuntimeError)",
            "Mute: (its message cannot be read: RuntimeError)",
        ),
    ],
)
def test_type_and_message(error: Exception, message: str, name: str) -> None:
    assert (told(error), named(error)) == (message, name)
