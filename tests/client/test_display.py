"""The virtual display: there when it is needed, gone with the run, and named when it is lost."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import psutil
import pytest

from pytest_simbench.client.display import Displays
from pytest_simbench.client.errors import DisplayError
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.tasks.base import Count, Outcome
from tests.client.test_reaper import gone
from tests.conftest import ADAPTERS
from tests.tiny import Falling

pytestmark = pytest.mark.skipif(
    shutil.which("Xvfb") is None, reason="no Xvfb: apt-get install xvfb"
)


@pytest.fixture
def displays(monkeypatch: pytest.MonkeyPatch) -> Iterator[Displays]:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    displays = Displays()
    yield displays
    displays.close()


def servers() -> list[psutil.Process]:
    return [p for p in psutil.Process().children() if p.name() == "Xvfb"]


def test_one_for_all_and_gone_at_the_end(displays: Displays) -> None:
    first = displays.environment()
    assert displays.environment() == first
    (server,) = servers()
    assert displays.problem(first) == ""
    assert os.getsid(server.pid) != os.getsid(0)  # Ctrl-C is not for it
    displays.close()
    assert not server.is_running()


def greeting(display: str) -> bytes:
    """The first byte that an X server answers to a client, who leaves then: 1 is a welcome."""
    hello = b"l\0" + struct.pack("<5H", 11, 0, 0, 0, 0)  # little-endian, protocol 11.0, no key
    with socket.socket(socket.AF_UNIX) as client:
        client.settimeout(10.0)
        client.connect(f"/tmp/.X11-unix/X{display.removeprefix(':')}")
        client.sendall(hello)
        return client.recv(8)[:1]


def test_who_comes_when_the_last_has_left_is_welcome(displays: Displays) -> None:
    display = displays.environment()["DISPLAY"]
    assert [greeting(display) for _ in range(100)] == [b"\1"] * 100


def test_the_user_s_own_comes_first(displays: Displays, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":7")
    assert displays.environment() == {}
    assert servers() == []


def test_one_that_died_is_told_and_replaced(displays: Displays) -> None:
    first = displays.environment()
    servers()[0].send_signal(signal.SIGKILL)
    while not displays.problem(first):
        time.sleep(0.01)
    text = f"the virtual display {first['DISPLAY']} (Xvfb) was killed by SIGKILL"
    assert displays.problem(first) == text
    again = displays.environment()
    assert displays.problem(again) == ""


@pytest.mark.parametrize("script", ["exit 3", "exec sleep 600"], ids=["ends", "says nothing"])
def test_one_that_does_not_start(
    displays: Displays, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str
) -> None:
    (tmp_path / "Xvfb").write_text(f"#!/bin/sh\n{script}\n")
    (tmp_path / "Xvfb").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setattr("pytest_simbench.client.display.START_TIMEOUT", 1.0)
    with pytest.raises(DisplayError, match=r"exited with status 3|told no display in 1 s"):
        displays.environment()


@dataclass(frozen=True)
class Blinded(Falling):
    """Somebody kills the display while the cubes fall."""

    name: ClassVar[str] = "blinded"

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        if seed == 10001:
            for server in servers():
                server.kill()
        return super().perform(world, seed, count)


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_the_repetition_whose_display_died_fails_and_the_next_has_another(
    case: Case, displays: Displays, engine: str
) -> None:
    case = replace(case, mode="gui", display=displays, simulator=engine, adapter=ADAPTERS[engine])
    records = [Repetition(Experiment(case, Blinded()), number).run()[0] for number in (1, 2)]
    assert [record.status for record in records] == ["failed", "ok"]
    error = records[0].error
    assert error.type == "DisplayLost"
    assert "(Xvfb) was killed by SIGKILL" in error.message


SCRIPT = """
import signal, time
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup ignores it
from pytest_simbench.client.display import Displays
Displays().environment()
print("ready", flush=True)
time.sleep(600)
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_killed_run_leaves_no_display(displays: Displays, number: int) -> None:
    program = subprocess.Popen(
        [sys.executable, "-c", SCRIPT], stdout=subprocess.PIPE, start_new_session=True
    )
    program.stdout.readline()
    family = psutil.Process(program.pid).children(recursive=True)
    assert [p for p in family if p.name() == "Xvfb"]
    os.killpg(program.pid, number)
    program.wait(10)
    assert gone([p.pid for p in family])
