"""`simbench replay`: what it plays and prints, of a world that is written down."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest

from pytest_simbench.client.answers import Constructed
from pytest_simbench.client.errors import Where, WorkerExited
from pytest_simbench.experiment.example import Example, ExampleError
from pytest_simbench.repeatability import example as module
from pytest_simbench.scene import Pose
from tests.repeatability.scripted import Scripted, moved, operation

TAPE = [operation("wait", "fall", 1.0)]


class Handle:
    """Of a worker that plays its tape, or is gone where that is empty."""

    constructed = Constructed(versions={"sim": "2", "same": "1"})
    made: ClassVar[list[Any]] = []

    def __init__(self, case: Any) -> None:
        self.done: list[Any] = [case]
        Handle.made.append(self.done)

    @contextmanager
    def episode(self, scene: Any) -> Iterator[Any]:
        def play(tape: Any) -> None:
            if not tape:
                raise WorkerExited("it is gone", Where("sim", "gui"), "\x1b[31m")
            self.done.append(tape)

        poses = {"a": Pose.at(0.03, -0.04, 0.025), "b": Pose.at(0.5, 0.0, 0.0253)}
        self.done.append(scene)
        yield SimpleNamespace(play=play, time=1.25, poses=lambda: poses)

    def close(self) -> None:
        self.done.append("closed")


def test_an_episode_of_a_file_is_played_and_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scene, read = Scripted(lambda p: moved(0.0)).scene(), []
    case = SimpleNamespace(simulator="sim", mode="gui", profile="tuned")
    versions = {"sim": "1", "same": "1", "gone\x1b": "3"}
    tapes = iter([TAPE, TAPE, [], TAPE])

    def read_example(path: Path, folder: Path, **how: Any) -> Example:
        read.append((path, folder.is_dir(), how))
        return Example(case, scene, next(tapes), versions)  # type: ignore[arg-type]

    monkeypatch.setattr(module, "read_example", read_example)
    monkeypatch.setattr(module, "SimulatorHandle", Handle)
    monkeypatch.setattr(Handle, "made", [])
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setenv("WAYLAND_DISPLAY", "w")
    assert module.replay_file("x", True, "p", None, True) == 0  # type: ignore[arg-type]
    assert capsys.readouterr().out == (
        "note: the file was made with sim 1, this is 2\n"
        "note: the file was made with gone\\x1b 3, this is without it\n"
        "sim gui tuned, t = 1.250 s\n"
        "  a: 0.0300 -0.0400 0.0250 m, 50.0 mm moved\n"
        "  b: 0.5000 0.0000 0.0253 m, 0.3 mm moved\n"
    )
    monkeypatch.delenv("WAYLAND_DISPLAY")
    with pytest.raises(ExampleError, match="^there is no display for a window; try xvfb-run -s"):
        module.replay_file("x", False, None, "s", False)  # type: ignore[arg-type]
    assert Handle.made == [[case, scene, TAPE, "closed"]]
    monkeypatch.setenv("DISPLAY", ":0")
    assert module.replay_file("x", False, None, "s", False) == 1  # type: ignore[arg-type]
    out, told = capsys.readouterr()
    assert out.startswith("note: the file was made with sim 1")
    assert "it is gone" in told
    assert "\x1b" not in told
    assert Handle.made[1:] == [[case, scene, "closed"]]
    own = {"mode": None, "python": None, "spec": "s", "trust_robot": False}
    window = {"mode": "gui", "python": "p", "spec": None, "trust_robot": True}
    assert read == [(Path("x"), True, how) for how in (window, own, own)]
    case.mode = "headless"
    monkeypatch.delenv("DISPLAY")
    assert module.replay_file("x", False, None, "s", False) == 0  # type: ignore[arg-type]
