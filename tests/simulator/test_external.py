"""Programs of their own, in lock-step: a real simulator in another process, and all its deaths."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest

from pytest_simbench.client.errors import EngineFailed, WorkerExited
from pytest_simbench.scene import Box, Pose, Scene
from pytest_simbench.simulator import SimulatorError
from pytest_simbench.simulator.external import Program
from pytest_simbench.testing import ConformanceTest, conformance_checks
from tests.sims.worlds import Worlds
from tests.simulator.outside import Outside

CUBE = Box("cube", (0.05, 0.05, 0.05), Pose.at(0.0, 0.0, 1.0), mass=0.1)
FALLING = Scene("falling", (CUBE,))

PATIENCE = 20.0
"""For what takes milliseconds, on a machine that is busy [s]."""

PARENTED = 'sleep 600 & trap "" TERM; echo "two of us"; wait'
"""A program that has a child, and does not go when it is told to."""

OWNER = """
import sys, time
from pathlib import Path
from pytest_simbench.simulator.external import Program
folder = Path(sys.argv[1])
folder.mkdir()
program = Program("It", ["/bin/sh", "-c", sys.argv[2]], folder)
print(program.pid, flush=True)
time.sleep(600)
"""


def group(number: int) -> list[psutil.Process]:
    """Who lives of a process group."""
    found = []
    for process in psutil.process_iter():
        try:
            if os.getpgid(process.pid) == number and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process)
        except (psutil.Error, ProcessLookupError):
            continue
    return found


def becomes_true(what: Callable[[], bool]) -> bool:
    until = time.monotonic() + PATIENCE
    while not what() and time.monotonic() < until:
        time.sleep(0.02)
    return what()


def program_of(worlds: Worlds) -> psutil.Process:
    """The simulator that the worker has started."""
    children = psutil.Process(worlds.worker.pid).children()
    (found,) = (child for child in children if "mujoco_program.py" in " ".join(child.cmdline()))
    return found


@conformance_checks(
    Outside,
    only=(
        "time_advances",
        "bad_description_rejected",
        "tracks_trajectory",
        "restore_continues",
        "parity_of_full_scene",
        "read_back_is_the_engines",
        "force_acts_for_its_time",
    ),
)
def test_a_program_keeps_the_contract(check: ConformanceTest) -> None:
    """Some laws of the kit. All held but `slides_flat`, MuJoCo's own, when it was written."""
    check()


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("exits", "exited with status 1 while starting; its last words: .*no licence for today"),
        ("hangs", "did not answer within 2 s and was killed while starting"),
        ("refuses", r"refused \(build\): there is no such thing as a cube$"),
    ],
)
def test_a_program_that_does_not_start(fault: str, message: str) -> None:
    simulator = Outside(replace(Outside.profiles["tuned"], fault=fault))
    if fault == "hangs":
        simulator.start_limit = 2.0  # type: ignore[misc]
    with pytest.raises(SimulatorError, match=f"MuJoCo's program {message}"):
        simulator.load(FALLING)
    simulator.close()
    assert not group(simulator.program.pid)
    assert not simulator.folder.exists()


def test_a_program_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(SimulatorError, match="It cannot be started: .*'/nowhere/it'"):
        Program("It", ["/nowhere/it"], tmp_path)
    with pytest.raises(SimulatorError, match="program was not started: no scene was loaded$"):
        Outside(Outside.profiles["tuned"]).step()


@pytest.mark.parametrize(
    ("says", "words"),
    [("echo one; sleep 0.1; echo two;", "its last words: one two"), ("", "it wrote nothing")],
)
def test_the_last_words_of_one_that_ends_are_all_it_said(
    tmp_path: Path, says: str, words: str
) -> None:
    program = Program("It", ["/bin/sh", "-c", f"{says} exit 3"], tmp_path)
    with pytest.raises(SimulatorError, match=f"It exited with status 3 .*; {words}$"):
        program.wait_until(lambda: False, PATIENCE)


@pytest.mark.engine
def test_exactly_so_many_steps() -> None:
    """The program stands when nobody asks, and what it says is in the log from the start."""
    simulator = Outside(Outside.profiles["tuned"])
    simulator.load(FALLING)
    simulator.advance(7)
    heights = [simulator.body_state()[0, 2]]
    time.sleep(0.1)
    heights.append(simulator.body_state()[0, 2])
    assert simulator.time == 0.007
    np.testing.assert_allclose(heights, 1 - 9.80665 * 1e-6 * 28, rtol=0, atol=1e-12)
    assert simulator.program.words() == "its last words: MuJoCo begins"
    simulator.close()
    assert simulator.program.ended() == "exited with status 0"  # it was asked, not killed
    assert not simulator.folder.exists()


@pytest.mark.engine
@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("drifts", "has made 102 steps and should have made 101: its time moves by itself"),
        ("babbles", r"was not understood \(UnpicklingError: .*\) while stepping"),
        ("killed", "was killed by SIGKILL while stepping; its last words: MuJoCo begins"),
        ("stopped", "did not answer within 1 s and was killed while stepping"),
    ],
)
def test_a_program_that_fails_while_stepping(fault: str, message: str) -> None:
    planted = "" if fault in ("killed", "stopped") else fault
    simulator = Outside(replace(Outside.profiles["tuned"], fault=planted))
    simulator.load(FALLING)
    for _ in range(100):
        simulator.step()
    if fault == "killed":
        simulator.program.kill()
    elif fault == "stopped":
        simulator.answer_limit = 1.0  # type: ignore[misc]
        os.kill(simulator.program.pid, signal.SIGSTOP)
    with pytest.raises(SimulatorError, match=f"MuJoCo's program {message}"):
        simulator.step()
    simulator.close()
    assert not group(simulator.program.pid)


def test_a_worker_tells_it_and_goes_on() -> None:
    """Garbage that a program prints harms nothing; its death fails one world; the next one has a
    new program; and it ends with a worker that is killed."""
    with Worlds(Outside) as worlds:
        world = worlds.load(FALLING, fault="chatters")
        world.wait(0.1)
        first = program_of(worlds)
        first.kill()
        with pytest.raises(EngineFailed, match="MuJoCo's program was killed by SIGKILL while step"):
            world.wait(1.0)
        world = worlds.load(FALLING)
        world.wait(0.1)
        second = program_of(worlds)
        assert second.pid != first.pid
        os.kill(worlds.worker.pid, signal.SIGKILL)
        with pytest.raises(WorkerExited, match="SIGKILL"):
            world.wait(1.0)
        assert becomes_true(lambda: not group(second.pid))


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGSEGV])
def test_nothing_outlives_its_owner(number: signal.Signals, tmp_path: Path) -> None:
    """Where no client looks after its workers: another host, a script."""
    folder = tmp_path / "folder"
    owner = subprocess.Popen(
        [sys.executable, "-c", OWNER, str(folder), PARENTED],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )
    program = int(owner.stdout.readline())
    assert becomes_true(lambda: len(group(program)) == 2)
    os.killpg(owner.pid, number)
    assert owner.wait(PATIENCE) != 0
    assert becomes_true(lambda: not group(program))
    assert becomes_true(lambda: not folder.exists())
    owner.stdout.close()


def test_what_is_asked_to_end_and_does_not_is_killed_with_its_children(tmp_path: Path) -> None:
    program = Program("It", ["/bin/sh", "-c", PARENTED], tmp_path)
    program.wait_until(lambda: "two of us" in program.words(), PATIENCE)
    assert len(group(program.pid)) == 2

    def ask() -> None:
        with program.within(PATIENCE, "asked to end"):  # the shorter limit holds
            os.kill(program.pid, signal.SIGTERM)

    program.end(ask, 0.3)
    assert program.ended() == "was killed by SIGKILL"
    assert not group(program.pid)
    program.end(lambda: None, 0.3)  # once more does nothing


def test_what_ends_when_it_is_asked_is_not_killed_whatever_the_asking_says(tmp_path: Path) -> None:
    script = 'trap "exit 7" TERM; echo ready; while :; do sleep 0.05; done'
    program = Program("It", ["/bin/sh", "-c", script], tmp_path)
    program.wait_until(lambda: "ready" in program.words(), PATIENCE)

    def ask() -> None:
        os.kill(program.pid, signal.SIGTERM)
        raise EOFError

    program.end(ask, PATIENCE)
    assert program.ended() == "exited with status 7"
