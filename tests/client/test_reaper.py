"""Nothing that a run starts outlives it, however the run ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from pytest_simbench.client import reaper
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from tests.client.failing import faulty
from tests.conftest import workers
from tests.tiny import Falling


def gone(pids: list[int], seconds: float = 10.0) -> bool:
    """Whether none of them lives, at last."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if not [pid for pid in pids if lives(pid)]:
            return True
        time.sleep(0.05)
    return False


def lives(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


@pytest.mark.parametrize(("fault", "status"), [("Parent", "ok"), ("ParentThatDies", "failed")])
def test_children_of_an_engine(case: Case, tmp_path: Path, fault: str, status: str) -> None:
    ids = tmp_path / "ids"
    case = faulty(case, fault, environment={"UNRULY": str(ids)}, stall_timeout=20.0)
    record, _ = Repetition(Experiment(case, Falling()), 1).run()
    assert record.status == status
    pids = [int(line) for line in ids.read_text().split()]
    assert len(pids) == 3
    if fault == "ParentThatDies":  # its session and its mark are gone, and so is its parent
        assert gone(pids[:2])
        for pid in filter(lives, pids[2:]):
            os.kill(pid, signal.SIGKILL)
    assert gone(pids)


SCRIPT = """
import signal, sys, time
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup ignores it
from dataclasses import replace
from pathlib import Path
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from tests.conftest import ADAPTERS
from tests.tiny import Falling
folder = Path(sys.argv[1])
case = Case("t::t", "mujoco", "headless", "tuned", sys.argv[2], folder, stall_timeout=300.0,
            environment={"UNRULY": str(folder / "ids")})
Repetition(Experiment(case, Falling(1e6)), 1).run()
"""


def started(folder: Path, adapter: str) -> tuple[subprocess.Popen[bytes], list[psutil.Process]]:
    """A program that runs a repetition without end, and the processes that it has."""
    program = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, str(folder), adapter], start_new_session=True
    )
    me = psutil.Process(program.pid)
    for _ in range(300):
        log = list((folder / "logs").glob("*.log")) if (folder / "logs").is_dir() else []
        if log and len(me.children()) >= 2:
            break
        time.sleep(0.1)
    time.sleep(2.0)  # the worker is stepping, or stuck, by now
    ids = folder / "ids"
    while adapter.endswith("Parent") and not (ids.exists() and ids.read_text().count("\n") == 3):
        time.sleep(0.1)
    return program, me.children(recursive=True)


@pytest.mark.engine
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize(
    "adapter",
    ["pytest_simbench.sims.mujoco.adapter:MuJoCo", "tests.client.faulty:MuJoCo_Hung",
     "tests.client.faulty:MuJoCo_Stopped", "tests.client.faulty:Parent"],
)  # fmt: skip
def test_a_killed_run_leaves_nothing(tmp_path: Path, adapter: str, number: int) -> None:
    program, family = started(tmp_path, adapter)
    assert len(family) >= 2  # worker and reaper
    program.send_signal(number)
    assert program.wait(10) == -number
    assert gone([process.pid for process in family])
    if (tmp_path / "ids").exists():
        pids = [int(line) for line in (tmp_path / "ids").read_text().split()]
        assert len(pids) == 3
        assert gone(pids)


def test_a_reaper_that_was_ended_is_started_again() -> None:
    reaper.new_mark()
    first = reaper._run and reaper._run._script
    first.kill()
    first.wait()
    reaper.new_mark()
    second = reaper._run and reaper._run._script
    assert second.poll() is None


STOPPED = """
import os, signal, sys
from pytest_simbench.client import reaper
reaper.new_mark()
os.kill(reaper._run._script.pid, signal.SIGSTOP)
print(reaper._run._script.pid)
"""


def test_a_reaper_that_was_stopped_ends_with_its_run() -> None:
    output = subprocess.run([sys.executable, "-c", STOPPED], capture_output=True, check=True).stdout
    assert gone([int(output)], 5.0)


@pytest.mark.engine
@pytest.mark.parametrize("killed", [False, True])
def test_a_run_leaves_no_process_and_no_temporary_file(tmp_path: Path, killed: bool) -> None:
    """Whatever an engine leaves there: of a run that ends well, and of one that is killed."""
    script = SCRIPT if killed else SCRIPT.replace("1e6", "100.0")  # a second or two
    adapter, told = "tests.client.faulty:LeavesFiles", tmp_path / "ids"
    program = subprocess.Popen([sys.executable, "-c", script, str(tmp_path), adapter])
    while not (told.exists() and told.read_text()) and program.poll() is None:
        time.sleep(0.05)
    folder = Path(told.read_text())
    assert folder.parent.name.startswith(reaper.FOLDERS)
    family = psutil.Process(program.pid).children(recursive=True)
    assert len(family) >= 2  # worker and reaper
    if killed:
        program.kill()
    assert program.wait() == (-9 if killed else 0)
    assert gone([process.pid for process in family])
    until = time.monotonic() + 10.0
    while folder.parent.exists() and time.monotonic() < until:
        time.sleep(0.05)
    assert not folder.parent.exists()


def test_reaping_ends_those_of_the_mark_alone() -> None:
    def start(mark: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(["sleep", "600"], env={**os.environ, reaper.VARIABLE: mark})

    before, one, another = workers(), reaper.new_mark(), reaper.new_mark()
    mine, derived, others, longer = map(start, (one, f"{one}.1", another, f"{one}1"))
    try:
        reaper.reap(one)
        assert (mine.wait(1), derived.wait(1)) == (-9, -9)
        assert (others.poll(), longer.poll()) == (None, None)
    finally:
        for process in (others, longer):
            process.kill()
            process.wait()
    assert not workers() - before


def forked(do: Callable[[], bool]) -> int:
    pid = os.fork()
    if pid == 0:
        os._exit(0 if do() else 1)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def test_a_forked_process_has_a_mark_of_its_own() -> None:
    mine = reaper.new_mark().partition(".")[0]
    assert forked(lambda: reaper.new_mark().partition(".")[0] != mine) == 0
