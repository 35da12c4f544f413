from __future__ import annotations

import os
from pathlib import Path

import pytest

from pytest_simbench.experiment.scene_file import read_scene_file
from pytest_simbench.ground.errors import DescriptionError

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
    path.write_text(TEXT.replace("cube", "block"))
    os.utime(path, (1, 1))
    assert read_scene_file(path).scene.body("block")


@pytest.mark.parametrize("name", ["a.usd", "a.sdf", "a.txt", "a.urdf"])
def test_files_that_nobody_reads_are_told(tmp_path: Path, name: str) -> None:
    with pytest.raises(DescriptionError, match=name):
        read_scene_file(tmp_path / name)


def test_what_the_engine_refuses_is_one_sentence(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    path = tmp_path / "zero.xml"
    path.write_text(TEXT.replace('<geom type="box"', '<geom mass="0" type="box"'))
    with pytest.raises(DescriptionError, match=r"zero.xml: .*mass.*line 2") as error:
        read_scene_file(path)
    assert "\n" not in str(error.value)
