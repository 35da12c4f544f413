from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest

from pytest_simbench.description import robot_files
from pytest_simbench.experiment.identity import scene_digest
from pytest_simbench.experiment.scene_file import read_scene_file
from pytest_simbench.ground.errors import DescriptionError
from pytest_simbench.tasks import Settling
from tests.description.test_urdf_scene import CABINET

TEXT = """<mujoco><worldbody><geom type="plane" size="1 1 1"/>
<body name="cube" pos="0 0 .5"><freejoint/><geom type="box" size=".1 .1 .1"/></body>
</worldbody></mujoco>"""


def test_a_file_is_read_once_until_it_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mujoco")
    path = tmp_path / "one.xml"
    path.write_text(TEXT)
    found = read_scene_file(path)
    assert found.scene.body("cube").mass == pytest.approx(8.0)
    assert found.scene.file == str(path) == str(found.path)
    assert found.account
    assert read_scene_file(str(path)) is found
    path.write_text(TEXT.replace("cube", "cone"))  # as long as before
    os.utime(path, (1, 1))
    assert read_scene_file(path).scene.body("cone")


@pytest.mark.parametrize("name", ["a.usd", "a.sdf", "a.txt", "a.urdf", "a"])
def test_files_that_nobody_reads_are_told(tmp_path: Path, name: str) -> None:
    with pytest.raises(DescriptionError, match=name):
        read_scene_file(tmp_path / name)


def test_an_engine_that_is_not_here_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pytest_simbench.experiment.scene_file.missing", lambda info: "no engine")
    with pytest.raises(DescriptionError, match="is read by MuJoCo, which is not here: pip"):
        read_scene_file(tmp_path / "a.xml")


def test_what_the_engine_refuses_is_one_sentence(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    path = tmp_path / "zero.xml"
    path.write_text(TEXT.replace('<geom type="box"', '<geom mass="0" type="box"'))
    with pytest.raises(DescriptionError, match=r"zero.xml: .*mass.*line 2") as error:
        read_scene_file(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("ending", ["xml", "urdf"])
def test_the_same_file_elsewhere_is_the_same_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str
) -> None:
    """Also where another user keeps what was read of it."""
    pytest.importorskip("mujoco")
    told, text = set(), CABINET if ending == "urdf" else TEXT.replace("freejoint", "joint")
    for folder in ("here", "there"):
        (tmp_path / folder).mkdir()
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / folder / "cache"))
        robot_files.folder.cache_clear()
        path = tmp_path / folder / f"door.{ending}"
        path.write_text(text)
        scene = read_scene_file(path).scene
        assert str(tmp_path / folder) in scene.arm.urdf
        for task in (Settling(scene), Settling(replace(scene, file=""))):  # as if made by hand
            told.add((str(task.parameters()), scene_digest(task)))
    assert len(told) == 1
    monkeypatch.undo()
    robot_files.folder.cache_clear()
