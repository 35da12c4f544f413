"""A robot travels as content: no path of one machine reaches another, and nothing is lost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_simbench.robot.panda import panda
from pytest_simbench.scene import Robot, Scene
from pytest_simbench.simulator import DescriptionError, PreparedRobot
from pytest_simbench.simulator.robot_files import content_of, folder, received, with_content
from pytest_simbench.simulator.shapes import reach, shape_points
from pytest_simbench.worker.wire import pack, unpack


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Another machine's folder for descriptions."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder.cache_clear()
    yield tmp_path / "cache" / "pytest-simbench" / "robots"
    folder.cache_clear()


def sent() -> dict[str, Any]:
    scene = Scene("s", robot=panda())
    wire: dict[str, Any] = unpack(pack(with_content(scene.to_wire(), scene.robot)))
    return wire


def test_no_path_is_sent() -> None:
    robot = sent()["robot"]
    meshes = robot["content"].pop("meshes")
    assert len(meshes) == 9
    for part in (str(Path(panda().urdf).parents[3]), "package://", "site-packages", ".dae"):
        assert part not in repr(robot)


def test_what_arrives_is_the_same_robot(elsewhere: Path) -> None:
    there = Scene.from_wire(received(sent())).robot
    assert there is not None
    assert Path(there.urdf).parent == elsewhere
    ours, theirs = PreparedRobot(panda()), PreparedRobot(there)
    assert list(ours.links) == list(theirs.links)
    for name, link in ours.links.items():
        other = theirs.links[name]
        assert (other.mass, other.inertia.tolist()) == (link.mass, link.inertia.tolist())
        for one, two in zip(link.shapes, other.shapes, strict=True):
            assert np.array_equal(reach(shape_points(one)), reach(shape_points(two)))
    assert ours.limits.keys() == theirs.limits.keys()
    assert there.joints == panda().joints


def test_the_same_description_lies_in_the_same_place(elsewhere: Path) -> None:
    """Engines keep compiled meshes by path. A damaged file is written anew."""
    first = received(sent())["robot"]["urdf"]
    files = {path: path.read_bytes() for path in elsewhere.iterdir()}
    damaged = next(path for path in files if path.suffix == ".stl")
    damaged.write_bytes(b"half")
    assert received(sent())["robot"]["urdf"] == first
    assert {path: path.read_bytes() for path in elsewhere.iterdir()} == files


def test_where_no_cache_can_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    folder.cache_clear()
    try:
        assert Path(received(sent())["robot"]["urdf"]).is_file()
    finally:
        folder.cache_clear()


def test_a_scene_without_a_robot_and_one_with_paths_stay_as_they_are() -> None:
    for scene in (Scene("s"), Scene("s", robot=panda())):
        assert Scene.from_wire(received(scene.to_wire())) == scene


def test_a_file_that_is_missing_is_named_here() -> None:
    robot: Robot = replace(panda(), urdf="/nowhere/panda.urdf")
    with pytest.raises(DescriptionError, match=r"cannot read the robot description /nowhere/panda"):
        content_of(robot)
