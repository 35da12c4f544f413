from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.description import mjcf_check
from pytest_simbench.description.mjcf_check import check_mjcf
from pytest_simbench.ground.errors import DescriptionError

REFUSED = {
    "cannot read the scene .*: No such file": None,
    "not valid XML: .*line 1": "<mujoco><body></mujoco>",
    "is a URDF": "<robot/>",
    "line 1: the scene has a document type": '<!DOCTYPE m [<!ENTITY a "b">]><mujoco>&a;</mujoco>',
    "line 2: <include> of a.xml runs in a circle": '<mujoco>\n<include file="a.xml"/></mujoco>',
    "line 1: the file 'b.xml' is not there": '<mujoco><include file="b.xml"/></mujoco>',
    "line 2: the file 'm.stl' is not there": '<mujoco>\n<mesh file="m.stl"/></mujoco>',
    "line 1: the file '../../../m.stl' lies out": '<mujoco><mesh file="../../../m.stl"/></mujoco>',
    "the file '/etc/passwd' lies out": '<mujoco><include file="/etc/passwd"/></mujoco>',
    "the file '../../../a/m.stl' lies out": '<mujoco><compiler meshdir="../../../a"/>'
    '<mesh file="m.stl"/></mujoco>',
    "more than 3 elements <body>": f"<mujoco>{4 * '<body/>'}</mujoco>",
}


@pytest.mark.parametrize(("why", "text"), REFUSED.items())
def test_bad_files_are_told_in_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, why: str, text: str | None
) -> None:
    monkeypatch.setitem(mjcf_check.MOST, "body", 3)
    path = tmp_path / "a.xml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(DescriptionError, match=why) as error:
        check_mjcf(str(path))
    assert str(path) in str(error.value)


def test_a_link_out_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "m.stl").write_text("")
    folder = tmp_path / "package" / "scenes" / "scene"
    folder.mkdir(parents=True)
    (folder / "m.stl").symlink_to(tmp_path / "m.stl")
    (folder / "a.xml").write_text('<mujoco><mesh file="m.stl"/></mujoco>')
    with pytest.raises(DescriptionError, match="lies out"):
        check_mjcf(str(folder / "a.xml"))


def test_files_beside_are_read_but_a_whole_home_is_no_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = tmp_path / "scenes" / "a.xml"
    scene.parent.mkdir()
    (tmp_path / "m.stl").write_text("")
    scene.write_text('<mujoco><mesh file="../m.stl"/></mujoco>')
    check_mjcf(str(scene))
    monkeypatch.setenv("HOME", str(tmp_path))
    with pytest.raises(DescriptionError, match="lies out"):
        check_mjcf(str(scene))


def test_a_good_file_passes(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "m.stl").write_text("")
    (tmp_path / "b.xml").write_text('<mujocoinclude><mesh file="m.stl"/></mujocoinclude>')
    (tmp_path / "a.xml").write_text(
        '<mujoco><compiler meshdir="meshes"/><include file="b.xml"/><body/></mujoco>'
    )
    check_mjcf(str(tmp_path / "a.xml"))
