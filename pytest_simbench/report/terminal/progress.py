"""How far the run is: one line rewritten in place on a terminal, plain lines in a log.

Imported by the plugin while tests run, so it uses the standard library only. Every method may be
called from any thread: with parallel repetitions, each thread reports the repetition it began.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from pytest_simbench.ground.text import in_one_line

REDRAW_SECONDS = 0.1
"""A terminal line is redrawn at most this often: faster than the eye follows costs only CPU."""

LOG_SECONDS = 10.0
"""A log gets a line of a repetition that ended at most this often, and one of a test's last."""

HEARTBEAT_SECONDS = 30.0
"""A log gets a line at least this often while something reports; CI systems stop silent jobs."""


@dataclass
class _Repetition:
    """One repetition under way."""

    number: int
    began: float
    node: str
    phase: str = ""
    done: int = 0
    total: int = 0
    noun: str = ""

    def describe(self) -> str:
        """Node, phase and count, for instance `on lab1  place  9/15 cubes`."""
        return "  ".join(part for part in (self.place, self.phase, self.counted) if part)

    @property
    def counted(self) -> str:
        """What is done of how many, for instance `9/15 cubes`."""
        return f"{self.done}/{self.total} {self.noun}".rstrip() if self.total else ""

    @property
    def place(self) -> str:
        """Where it runs, unless that is this machine."""
        return f"on {self.node}" if self.node else ""


@dataclass
class _Test:
    """One test under way; `seconds` are those of its finished repetitions.

    Its `repetitions` are the last of those up to number `last`: the others ran before.
    """

    id: str
    repetitions: int
    last: int
    active: dict[int, _Repetition] = field(default_factory=dict)  # by thread
    seconds: list[float] = field(default_factory=list)
    failed: int = 0
    jobs: int = 1

    @property
    def done(self) -> int:
        """Repetitions that ended, those before these among them."""
        return self.last - self.repetitions + len(self.seconds)

    def left(self, now: float) -> float | None:
        """Estimated wall seconds until the last repetition ends, or None before the first has."""
        if not self.seconds:
            return None
        mean = sum(self.seconds) / len(self.seconds)
        waiting = max(0, self.repetitions - len(self.seconds) - len(self.active))
        running = [max(0.0, mean - (now - item.began)) for item in self.active.values()]
        # Parallel repetitions overlap, but never does the run end before its longest one.
        return max([(waiting * mean + sum(running)) / self.jobs, *running])


class Progress:
    """The live line of the running test.

    On a terminal the line is rewritten in place, cut to the width; call `clear` before anything
    else is printed. In a log (`is_tty` false) there is a line of a finished repetition every
    `LOG_SECONDS` at most and of the test's last one, and one every `HEARTBEAT_SECONDS` while a
    longer one reports.

    Args:
        write: prints text as it is, without a line end of its own, and flushes. The caller sees to
            it that the cursor stands at the start of a line when a test starts.
        is_tty: whether `write` reaches a terminal.
        width: columns of the terminal.
        clock: monotonic seconds.
    """

    def __init__(
        self,
        write: Callable[[str], None],
        is_tty: bool,
        width: int = 80,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._write = write
        self._is_tty = is_tty
        self._columns = max(1, width - 1)  # the last column would wrap on some terminals
        self._clock = clock
        self._lock = threading.RLock()
        self._test: _Test | None = None
        self._shown = 0
        self._last = float("-inf")

    def start_test(self, test_id: str, repetitions: int, last: int | None = None) -> None:
        """A test begins, or goes on, that will now run so many repetitions; `last` is the number of
        the last of them, where others ran before."""
        with self._lock:
            self._test = _Test(in_one_line(test_id), repetitions, last or repetitions)
            self._last = self._clock() if not self._is_tty else float("-inf")
            self._update(force=self._is_tty)

    def repetition(self, number: int, seed: int, node: str = "") -> None:
        """The calling thread begins repetition `number`, counted from 1, with that seed; on the
        node of that name, where it is not this machine. Told again when it moves to another."""
        with self._lock:
            if self._test is None:
                return
            self._test.active[threading.get_ident()] = _Repetition(
                number, self._clock(), in_one_line(node)
            )
            self._test.jobs = max(self._test.jobs, len(self._test.active))
            self._update()

    def phase(self, name: str) -> None:
        """The calling thread's repetition is now doing this: launch, load, pick, settle, ..."""
        if not self._is_tty:
            self._tell()  # a log that is due says what took so long, not what begins
        self._tell(phase=in_one_line(name))

    def count(self, done: int, total: int, noun: str = "") -> None:
        """The calling thread's repetition has done so many of its things, for instance cubes."""
        self._tell(done=done, total=total, noun=in_one_line(noun))

    def _tell(self, **told: object) -> None:
        with self._lock:
            current = self._current()
            if current is not None:
                vars(current).update(told)
                self._update()

    def end_repetition(self, status: str, seconds: float) -> None:
        """The calling thread's repetition ended: ok, failed or interrupted, after wall seconds."""
        with self._lock:
            test, current = self._test, self._current()
            if test is None or current is None:
                return
            test.active = {key: item for key, item in test.active.items() if item is not current}
            test.seconds.append(seconds)
            test.failed += status != "ok"
            last = len(test.seconds) == test.repetitions
            if self._is_tty:
                self._update(force=last)
            elif last or self._clock() - self._last >= LOG_SECONDS:
                self._log(test, current, f"{in_one_line(status)} after {seconds:.1f} s")

    def end_test(self) -> None:
        """The test is over: its line goes away."""
        with self._lock:
            self.clear()
            self._test = None

    def clear(self) -> None:
        """Erase the line from a terminal, so that something else can be printed in its place."""
        with self._lock:
            if self._shown:
                self._write("\r" + " " * self._shown + "\r")
                self._shown = 0

    def line(self) -> str:
        """The present line as text, in the longest form that fits the width."""
        with self._lock:
            if self._test is None:
                return ""
            full, short = self._forms(self._test)
            if len(full) <= self._columns or not self._is_tty:
                return full
            if len(short) <= self._columns:
                return short
            return (short[: max(0, self._columns - 3)] + "...")[: self._columns]

    def _current(self) -> _Repetition | None:
        """The repetition of the calling thread; a helper thread of the only one reports for it."""
        if self._test is None:
            return None
        active = self._test.active
        only = next(iter(active.values())) if len(active) == 1 else None
        return active.get(threading.get_ident(), only)

    def _update(self, force: bool = False) -> None:
        now = self._clock()
        if self._is_tty:
            if force or now - self._last >= REDRAW_SECONDS:
                line = self.line()
                self._write("\r" + line.ljust(self._shown))
                # What the old line had and the new one lacks is blank now.
                self._shown, self._last = len(line), now
        elif now - self._last >= HEARTBEAT_SECONDS:
            self._write(self.line() + "\n")
            self._last = now

    def _log(self, test: _Test, ended: _Repetition, outcome: str) -> None:
        """One plain line for a repetition that ended."""
        where = f"repetition {ended.number} of {test.last}"
        failed = f"{test.failed} crashed" if test.failed and test.repetitions > 1 else ""
        parts = [test.id, where, ended.place, outcome, ended.counted, failed, self._left(test)]
        self._write("  ".join(part for part in parts if part) + "\n")
        self._last = self._clock()

    def _forms(self, test: _Test) -> tuple[str, str]:
        """The line in full, and abridged for a narrow terminal."""
        running = sorted(test.active.values(), key=lambda item: item.number)
        numbers = ", ".join(str(item.number) for item in running)
        what = " | ".join(item.describe() for item in running)
        plural = "s" if len(running) > 1 else ""
        of = f"{numbers or test.done} of {test.last}"
        full_where = f"repetition{plural} {of}" if running else f"{of} repetitions done"
        failed = f"{test.failed} crashed" if test.failed else ""
        full = [test.id, full_where, what, failed, self._left(test)]
        left = self._left(test).replace("about ", "")  # becomes 2m10s left
        for unit in ("h", "min", "s"):
            left = left.replace(f" {unit}", unit[0])
        left = left.replace("m ", "m").replace("h ", "h")
        short_where = f"{numbers.replace(', ', '+') or test.done}/{test.last}"
        short = [test.id, short_where, what.replace("  ", " "), failed, left]
        return "  ".join(filter(None, full)), "  ".join(filter(None, short))

    def _left(self, test: _Test) -> str:
        seconds = test.left(self._clock())
        if seconds is None or len(test.seconds) >= test.repetitions:
            return ""
        return f"about {duration(seconds)} left"


def duration(seconds: float) -> str:
    """A time as people say it: `45 s`, `2 min 10 s`, `1 h 20 min`."""
    if seconds < 60:
        return f"{max(1, round(seconds))} s" if round(seconds) < 60 else "1 min"
    if seconds < 3570:
        minutes, rest = divmod(round(seconds / 10) * 10, 60)
        return f"{minutes} min {rest} s" if rest else f"{minutes} min"
    hours, minutes = divmod(round(seconds / 60), 60)
    return f"{hours} h {minutes} min" if minutes else f"{hours} h"
