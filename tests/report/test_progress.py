"""The live line, as a terminal and as a log see it."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.report.terminal.progress import (
    HEARTBEAT_SECONDS,
    LOG_SECONDS,
    Progress,
    duration,
)

TEST = "test_stacking[mujoco-headless]"


class Desk:
    """A clock to turn, a screen that keeps what is written; a test of so many repetitions runs."""

    def __init__(
        self, repetitions: int, is_tty: bool = True, width: int = 120, last: int | None = None
    ) -> None:
        self.now = 0.0
        self.written: list[str] = []
        self.progress = Progress(self.written.append, is_tty, width, clock=lambda: self.now)
        if repetitions:
            self.progress.start_test(TEST, repetitions, last)

    @property
    def text(self) -> str:
        return "".join(self.written)

    @property
    def screen(self) -> str:
        """What a terminal shows in the present line after all that was written."""
        cells: list[str] = []
        column = 0
        for char in self.text:
            if char == "\r":
                column = 0
                continue
            cells[column : column + 1] = [char]
            column += 1
        return "".join(cells).rstrip().removeprefix(f"{TEST}  ")

    def repeat(self, number: int, seconds: float, status: str = "ok") -> None:
        self.progress.repetition(number, seed=1000 + number)
        self.now += seconds
        self.progress.end_repetition(status, seconds)

    def under_way(self, number: int, phase: str, count: str = "", node: str = "") -> None:
        """A repetition that has been in a phase for a second, and has done `9/15 cubes`."""
        self.progress.repetition(number, seed=7, node=node)
        self.now += 0.5
        self.progress.phase(phase)
        self.now += 0.5
        if count:
            numbers, _, noun = count.partition(" ")
            done, total = map(int, numbers.split("/"))
            self.progress.count(done, total, noun)


def test_a_terminal_line_tells_where_the_run_is_and_how_long_it_takes() -> None:
    desk = Desk(16)
    assert desk.screen == "0 of 16 repetitions done"
    desk.repeat(1, 10.0)
    desk.repeat(2, 10.0)
    desk.under_way(3, "place", "9/15 cubes placed")
    assert desk.screen == "repetition 3 of 16  place  9/15 cubes placed  about 2 min 20 s left"


@pytest.mark.parametrize(
    ("width", "before", "now"),
    [(120, "10 of 12 repetitions", "repetition 11 of 12"), (50, "10/12", "11/12")],
)
def test_more_repetitions_of_a_test_are_counted_on(width: int, before: str, now: str) -> None:
    """`--reps auto` runs some more, and a resumed run what is missing: never `11 of 2`."""
    desk = Desk(2, width=width, last=12)
    assert desk.screen.startswith(before)
    desk.under_way(11, "place")
    assert desk.screen.startswith(now)
    desk.progress.end_repetition("ok", 10.0)
    desk.repeat(12, 10.0)
    assert desk.screen.startswith(before.replace("10", "12"))
    log = Desk(2, is_tty=False, last=12)
    log.repeat(11, 10.0)
    assert "repetition 11 of 12  ok after 10.0 s  about 10 s left" in log.text


@pytest.mark.parametrize(
    ("width", "screen"), [(80, "2/16  place 9/15 cubes  2m30s left"), (50, "2/16  place 9/...")]
)
def test_a_narrow_terminal_gets_the_short_form_and_then_a_cut_one(width: int, screen: str) -> None:
    desk = Desk(16, width=width)
    desk.repeat(1, 10.0)
    desk.under_way(2, "place", "9/15 cubes")
    assert desk.screen == screen


def test_a_shorter_line_leaves_nothing_of_the_longer_one_and_clear_leaves_none() -> None:
    desk = Desk(2)
    desk.under_way(1, "a very long name of a phase")
    desk.now += 1
    desk.progress.phase("x")
    assert desk.screen == "repetition 1 of 2  x"
    desk.progress.clear()
    assert desk.screen == ""
    assert desk.text.endswith("\r")
    before = len(desk.written)
    desk.progress.clear()
    assert len(desk.written) == before


def test_a_terminal_is_redrawn_ten_times_a_second_at_most() -> None:
    desk = Desk(1)
    desk.progress.repetition(1, seed=7)
    for step in range(1000):  # 1 ms apart
        desk.now = step / 1000
        desk.progress.count(step, 1000, "steps")
    assert 9 <= len(desk.written) <= 12


def test_a_log_has_a_line_every_ten_seconds_and_one_at_the_end() -> None:
    desk = Desk(3, is_tty=False)
    desk.progress.repetition(1, seed=7)
    desk.progress.count(15, 15, "cubes")
    desk.now += 10.5
    desk.progress.end_repetition("ok", 10.5)
    desk.repeat(2, 9.5, "failed")
    desk.repeat(3, 0.1)
    desk.progress.end_test()
    assert desk.text.splitlines() == [
        f"{TEST}  repetition 1 of 3  ok after 10.5 s  15/15 cubes  about 21 s left",
        f"{TEST}  repetition 3 of 3  ok after 0.1 s  1 crashed",
    ]
    desk.written.clear()
    desk.progress.start_test(TEST, 570)  # the study's tosses
    for number in range(1, 571):
        desk.repeat(number, 0.5)
    assert len(desk.written) == 570 * 0.5 // LOG_SECONDS + 1


def test_what_runs_on_a_cluster_says_where() -> None:
    desk = Desk(2)
    for node in ("lab1", "lab2"):
        desk.under_way(1, "place", node=node)
        assert desk.screen == f"repetition 1 of 2  on {node}  place"
    log = Desk(2, is_tty=False)
    log.under_way(1, "place", node="lab1")
    log.now += 9.5
    log.progress.end_repetition("ok", 10.5)
    assert log.text == f"{TEST}  repetition 1 of 2  on lab1  ok after 10.5 s  about 10 s left\n"


def test_a_log_of_a_long_repetition_shows_that_it_lives() -> None:
    desk = Desk(1, is_tty=False)
    desk.progress.repetition(1, seed=7)
    desk.progress.phase("pick")
    for second in range(100):
        desk.now = float(second)
        desk.progress.count(second // 10, 15, "cubes")
    assert len(desk.written) == int(99 // HEARTBEAT_SECONDS)
    assert desk.written[0] == f"{TEST}  repetition 1 of 1  pick  3/15 cubes\n"
    desk.now += HEARTBEAT_SECONDS
    desk.progress.phase("wind up")
    assert desk.written[-1] == f"{TEST}  repetition 1 of 1  pick  9/15 cubes\n"
    told = Desk(1, is_tty=False)
    told.progress.repetition(1, seed=7)
    for told.now in (0.0, HEARTBEAT_SECONDS - 0.5, HEARTBEAT_SECONDS):
        assert told.written == []
        told.progress.phase("pick")
    assert len(told.written) == 1


def test_failures_stay_in_sight() -> None:
    desk = Desk(4)
    desk.repeat(1, 10.0, "failed")
    desk.now += 1
    desk.progress.repetition(2, seed=7)
    assert desk.screen == "repetition 2 of 4  1 crashed  about 30 s left"


def at_once(count: int, work: Callable[[int], None]) -> None:
    threads = [threading.Thread(target=work, args=(number,)) for number in range(1, count + 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def test_parallel_repetitions_report_each_for_itself() -> None:
    desk, both = Desk(20, width=140), threading.Barrier(2)

    def work(number: int) -> None:
        desk.progress.repetition(number, seed=number)
        both.wait(10)
        desk.progress.phase(f"phase{number}")
        desk.progress.count(number, 15, "cubes")
        if not both.wait(10):
            at_once(1, lambda _: desk.progress.phase("of nobody"))
        both.wait(10)

    at_once(2, work)
    told = "repetitions 1, 2 of 20  phase1  1/15 cubes | phase2  2/15 cubes"
    assert desk.progress.line() == f"{TEST}  {told}"


def test_a_helper_thread_reports_for_the_only_repetition() -> None:
    desk = Desk(20, width=140)
    desk.progress.repetition(3, seed=3)
    at_once(1, lambda _: desk.progress.phase("place"))
    assert desk.progress.line() == f"{TEST}  repetition 3 of 20  place"


@pytest.mark.parametrize(
    ("jobs", "left"), [(1, "about 3 min 10 s left"), (2, "about 1 min 30 s left")]
)
def test_two_jobs_halve_the_time_left(jobs: int, left: str) -> None:
    desk, barrier = Desk(20), threading.Barrier(jobs)

    def work(number: int) -> None:
        desk.progress.repetition(number, seed=number)
        barrier.wait(10)
        desk.progress.end_repetition("ok", 10.0)

    at_once(jobs, work)
    assert desk.progress.line().endswith(left)


def test_reports_outside_a_test_are_ignored() -> None:
    desk = Desk(0)
    desk.under_way(1, "launch", "1/2")
    desk.progress.end_repetition("ok", 1.0)
    desk.progress.end_test()
    assert desk.text == desk.progress.line() == ""


@given(
    st.integers(2, 200),
    st.text("abcdefghij[]-_", min_size=1, max_size=80),
    st.lists(st.tuples(st.text("abc ", max_size=30), st.integers(0, 10**6)), max_size=6),
)
def test_no_line_is_wider_than_the_terminal(
    width: int, name: str, events: list[tuple[str, int]]
) -> None:
    desk = Desk(0, width=width)
    desk.progress.start_test(name, 20)
    for number, (phase, done) in enumerate(events, start=1):
        desk.under_way(number, phase, f"{done}/1000000 things")
        assert len(desk.progress.line()) < width
        desk.progress.end_repetition("ok", float(done))
        desk.now += 0.2
    assert all(len(part) < width for part in desk.text.split("\r"))


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.0, "1 s"), (45.4, "45 s"), (59.7, "1 min"), (60.0, "1 min"), (128.0, "2 min 10 s"),
     (3569.0, "59 min 30 s"), (3570.0, "1 h"), (4800.0, "1 h 20 min")],
)  # fmt: skip
def test_duration(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_it_loads_no_heavy_library() -> None:
    code = (
        "import sys, pytest_simbench.report.terminal.progress;"
        "print(sorted({'numpy', 'scipy', 'rich', 'matplotlib', 'psutil'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
