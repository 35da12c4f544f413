"""The clocks of a busy machine, and of helpers; the workload that runs beside the stepping."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from pytest_simbench.worker.control import MOST_AT_ONCE, SHARE, Clock, Control, Family, workload


@contextmanager
def busy_machine(others: int = 2 * (os.cpu_count() or 1), *before: str) -> Iterator[None]:
    """Processes that never rest, each in a session of its own: Linux shares the cores out among
    sessions (`man 7 sched`, autogroups), and a worker has one."""
    command = [*before, sys.executable, "-c", "while True: pass"]
    hogs = [subprocess.Popen(command, start_new_session=True) for _ in range(others)]
    try:
        yield
    finally:
        for hog in hogs:
            hog.kill()
            hog.wait()


def test_what_was_waited_is_the_wall_time_without_the_cpu_time() -> None:
    """What a hypervisor takes away is neither, so the least of three counts."""
    clock, shares = Clock(), []
    for _ in range(3):
        with busy_machine():
            cpu = time.thread_time()
            began, before = clock()
            while time.thread_time() - cpu < 0.4:
                pass
            ended, after = clock()
            cpu = time.thread_time() - cpu
        wall, waited = ended - began, after - before
        assert waited > 0.1
        shares.append((wall - waited) / cpu)
    assert min(shares) == pytest.approx(1.0, rel=0.1)


def test_where_the_kernel_does_not_tell_nothing_was_waited(tmp_path: Path) -> None:
    clock = Clock(str(tmp_path / "none"))
    before, waited = clock()
    assert waited == 0.0
    assert clock()[0] > before


def test_the_workload_stays_the_same() -> None:
    """Its time is compared with that of runs of earlier versions: this much arithmetic, no more."""
    assert workload() == pytest.approx(2997.9)  # sum of k k mod 7 for k < 1500, root of 0.81


def test_the_control_takes_its_share_and_no_more() -> None:
    control = Control(Clock())
    assert control.to_wire() == {}
    control.keep_up(0.0)
    assert control.runs == 1  # also the shortest repetition has one
    control.keep_up(0.0)
    assert control.runs == 1
    control.keep_up(0.2)
    assert control.runs > 1
    assert control.wall - control.waited < 3 * SHARE * 0.2  # of runs that are not the shortest
    runs = control.runs
    control.keep_up(1e6)  # steps that take forever do not keep the engine waiting
    assert control.runs == runs + MOST_AT_ONCE


def test_all_runs_are_summed() -> None:
    """By a clock on which each run takes 4 ms, 1 ms of it waiting."""
    ticks = itertools.count()
    control = Control(lambda: (0.004 * (tick := next(ticks)), 0.001 * tick))  # type: ignore[arg-type]
    for stepping in range(1, 9):
        control.keep_up(stepping)
    assert control.runs > 3
    assert control.wall == pytest.approx(0.004 * control.runs)
    assert control.waited == pytest.approx(0.001 * control.runs)


def test_the_record_gets_means_of_single_runs() -> None:
    control = Control(Clock())
    for stepping in (0.01, 0.02, 0.03, 1.0):
        control.keep_up(stepping)
    found = control.to_wire()
    assert found["control_runs"] == control.runs
    assert found["control_runs"] * found["control_wall"] == pytest.approx(control.wall)
    assert 0 <= found["control_waited"] < found["control_wall"]
    assert 1e-6 < found["control_cpu"] < 0.01


BURN = "import time\nwhile time.process_time() < 0.3: pass\nprint(flush=True)\ninput()"
PARENT = f"import subprocess, sys\nsubprocess.run([sys.executable, '-c', {BURN!r}])"


@pytest.mark.skipif(sys.platform != "linux", reason="Linux alone tells who they are")
@pytest.mark.parametrize("helper", [BURN, PARENT], ids=["child", "child of a child"])
def test_a_helper_counts_while_it_lives_and_once_it_has_ended(helper: str) -> None:
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    family = Family()
    before = family.cpu()
    with subprocess.Popen([sys.executable, "-c", helper], **pipes) as child:
        child.stdout.readline()
        family.meet()
        living = family.cpu() - before
        child.communicate(b"\n")
    assert 0.3 <= living <= family.cpu() - before < 2 * living
