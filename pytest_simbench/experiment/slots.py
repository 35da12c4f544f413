"""The queue of a machine: repetitions wait in it for a slot, those of all processes of a run.

With `--sim-jobs 4 -n 6` six tests run at once and ask for repetitions, and four repetitions run. So
the last repetitions of a test leave no core idle. A free slot goes to the longest repetition that
waits, by the mean of those of its test that ended; a test of which none has ended comes first. What
no test has asked for yet (`prefetch`) waits until nobody else does.

A repetition holds its slot as long as its connection, so a process that ends in whatever way gives
its slots back.
"""

from __future__ import annotations

import selectors
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from hashlib import blake2b
from uuid import uuid4

from pytest_simbench.client.errors import ExecutorError

LOOK_PERIOD = 0.25
"""Between two looks of a repetition that waits whether the run has ended [s]."""

KEY = 16
"""Of the name of a test, as it is sent [bytes]; before it stands one of these."""

NOW, LATER = b"n", b"l"


class Slots:
    """Gives so many slots out, in a thread of the run's first process, until `close`.

    Attributes:
        address: for `slot`.
    """

    def __init__(self, number: int) -> None:
        self.number = number
        self.address = f"simbench-slots-{uuid4().hex}"
        self._waiting: dict[socket.socket, bytes] = {}
        self._held: dict[socket.socket, tuple[bytes, float]] = {}
        self._ended: dict[bytes, tuple[int, float]] = {}
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listener.bind(f"\0{self.address}")  # no file, so none is left behind
        self._listener.listen(socket.SOMAXCONN)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="simbench-slots", daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        with selectors.DefaultSelector() as selector:
            selector.register(self._listener, selectors.EVENT_READ)
            while not self._closing.is_set():
                for key, _ in selector.select():
                    if key.fileobj is self._listener:
                        selector.register(self._listener.accept()[0], selectors.EVENT_READ)
                    else:
                        assert isinstance(key.fileobj, socket.socket)
                        self._hear(key.fileobj, selector)
                self._give()
            for connection in (*self._waiting, *self._held, self._listener):
                connection.close()

    def _hear(self, connection: socket.socket, selector: selectors.BaseSelector) -> None:
        """A repetition begins to wait, or has ended."""
        key = b""
        with suppress(OSError):
            key = connection.recv(1 + KEY)
        if key:
            self._waiting[connection] = key
            return
        self._waiting.pop(connection, None)
        if connection in self._held:
            key, began = self._held.pop(connection)
            number, seconds = self._ended.get(key, (0, 0.0))
            self._ended[key] = number + 1, seconds + time.monotonic() - began
        selector.unregister(connection)
        connection.close()

    def _give(self) -> None:
        while self._waiting and len(self._held) < self.number:
            connection = max(self._waiting, key=lambda waits: self._rank(self._waiting[waits]))
            self._held[connection] = self._waiting.pop(connection), time.monotonic()
            with suppress(OSError):  # it has left, and is heard of next
                connection.send(b"1")

    def _rank(self, key: bytes) -> tuple[bool, float]:
        """Whether its test waits for it, and the mean time of the repetitions of that test [s]."""
        number, seconds = self._ended.get(key, (0, 0.0))
        return key.startswith(NOW), seconds / number if number else float("inf")

    def close(self) -> None:
        """Give no slot any more."""
        self._closing.set()
        with suppress(OSError), socket.socket(socket.AF_UNIX) as last:
            last.connect(f"\0{self.address}")
        self._thread.join(1.0)


def key_of(test: str) -> bytes:
    """The name of a test, as it is sent."""
    return blake2b(test.encode(), digest_size=KEY).digest()


@contextmanager
def slot(
    address: str, test: str, stop: Callable[[], bool], *, later: bool = False
) -> Iterator[bool]:
    """Wait for a slot, and hold it in this block.

    Args:
        test: whose repetition asks for it.
        stop: whether to wait no longer.
        later: after all that are asked for without it.

    Yields:
        Whether there is one; there is none when stopped.

    Raises:
        ExecutorError: the slots are gone.
    """
    gone = ExecutorError("the first process of the run is gone; --sim-resume completes the run")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        try:
            connection.connect(f"\0{address}")
            connection.send((LATER if later else NOW) + key_of(test))
        except OSError:
            raise gone from None
        connection.settimeout(LOOK_PERIOD)
        granted = b""
        while not (granted or stop()):
            try:
                granted = connection.recv(1)
            except TimeoutError:
                continue
            except OSError:  # it was accepted by nobody any more
                raise gone from None
            if not granted:
                raise gone
        yield bool(granted)
