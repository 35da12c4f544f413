"""What a replay of a kept episode prints, of a world whose end is known."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest

from pytest_simbench.experiment.example import ExampleError
from pytest_simbench.repeatability import example
from pytest_simbench.scene import Box, Pose, Scene

BOXES = [Box(name, (0.1,) * 3, Pose.at(x, 0.0, 0.1), 1.0) for name, x in (("a", 0.5), ("b", 0.0))]
ENDS = {"a": Pose.at(0.53, -0.04, 0.22), "b": Pose.at(0.0, 0.0, 0.09994)}


class Handle:
    """One of a worker that ends there."""

    closed = False
    constructed = SimpleNamespace(versions={"sim": "2", "glue": "1"})

    def __init__(self, case: Any) -> None:
        pass

    @contextmanager
    def episode(self, scene: Scene) -> Iterator[Any]:
        yield SimpleNamespace(time=1.25, poses=lambda: ENDS, play=list)

    def close(self) -> None:
        Handle.closed = True


def test_a_replay_tells_other_versions_and_where_bodies_end(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[Any] = []

    def read(path: Any, folder: Any, **more: Any) -> Any:
        asked.append(more)
        case = SimpleNamespace(simulator="sim", mode=more["mode"] or "headless", profile="tuned")
        versions = {"sim": "1", "glue": "1", "gone\n": "3"}
        return SimpleNamespace(
            case=case, scene=Scene("s", tuple(BOXES)), tape=[], versions=versions
        )

    monkeypatch.setattr(example, "read_example", read)
    monkeypatch.setattr(example, "SimulatorHandle", Handle)
    assert example.replay_file("x", False, "p", "s", True) == 0
    assert capsys.readouterr().out.splitlines() == [
        "note: the file was made with sim 1, this is 2",
        "note: the file was made with gone 3, this is without it",
        "sim headless tuned, t = 1.250 s",
        "  a: 0.5300 -0.0400 0.2200 m, 130.0 mm moved",
        "  b: 0.0000 0.0000 0.0999 m, 0.1 mm moved",
    ]
    assert Handle.closed
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ExampleError, match="no display for a window; try xvfb-run"):
        example.replay_file("x", True, None, None, False)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        with monkeypatch.context() as there:
            there.setenv(name, ":0")
            assert example.replay_file("x", True, None, None, False) == 0
    told = {"python": "p", "spec": "s", "trust_robot": True, "mode": None}
    window = {"python": None, "spec": None, "trust_robot": False, "mode": "gui"}
    assert asked == [told, window, window, window]
