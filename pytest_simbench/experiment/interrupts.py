"""Ctrl-C ends a repetition once; what else is pressed waits until its record is kept."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGALRM", "SIGTERM") if hasattr(signal, name)
)
"""Those whose handlers raise: Ctrl-C's, that of a test's time-out, and what somebody else set."""


class Interrupts:
    """A block in which a signal's handler may raise one exception, and none after `hold`.

    Signals that come later are handled when the block ends. Python delivers signals to the main
    thread alone: in others, and for signals without a Python handler, this does nothing.
    """

    def __init__(self) -> None:
        self._held = False
        self._before: dict[int, Callable[[int, FrameType | None], Any]] = {}
        self._waiting: list[int] = []

    def hold(self) -> None:
        """From here on nothing interrupts until the block ends."""
        self._held = True

    def forget(self) -> None:
        """What came since `hold` is not handled."""
        self._waiting.clear()

    def __enter__(self) -> Interrupts:
        if threading.current_thread() is threading.main_thread():
            for number in SIGNALS:
                handler = signal.getsignal(number)
                if callable(handler):
                    self._before[number] = handler
                    signal.signal(number, self._handle)
        return self

    def __exit__(self, *error: object) -> None:
        self._held = True
        for number, handler in self._before.items():
            signal.signal(number, handler)
        # One interrupt is as good as two: what already raised is on its way out.
        if self._waiting and error[0] is None:
            signal.raise_signal(self._waiting[0])

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self._held:
            self._waiting.append(number)
            return
        self._held = True
        self._before[number](number, frame)
        self._held = False  # it raised nothing
