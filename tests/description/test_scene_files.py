"""Files of scenes: whether they are sound, what was carried of them, and stored starts."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.description import mjcf_check
from pytest_simbench.description.carried import Carried, keep, kept, markdown, named, terminal_lines
from pytest_simbench.description.mjcf_check import check_mjcf
from pytest_simbench.description.starts import distinct, read_starts
from pytest_simbench.ground.errors import DescriptionError
from pytest_simbench.report.model.carried import sections
from pytest_simbench.scene import Box, Pose, Scene, Start

ACCOUNT = (
    Carried("option gravity", "carried", "0 0 -9.81"),
    Carried("geom margin", "not carried", "a | b", "g<1>"),
    Carried("damping", "approximated", "by 3 %"),
    Carried("geom gap", "not carried", "why"),
)


def test_it_crosses_the_boundary() -> None:
    assert [Carried.from_wire(line.to_wire()) for line in ACCOUNT] == list(ACCOUNT)


def test_there_are_three_states() -> None:
    with pytest.raises(ValueError, match="no state 'lost'"):
        Carried("mass", "lost", "")


def test_many_names_are_shortened() -> None:
    assert named("abc") == "a, b, c"
    assert named(["a", "b", "c", "d", "e"]) == "a, b, c and 2 more"


def test_the_page_has_a_row_each_and_first_what_is_not_carried() -> None:
    rows = markdown("my|file", ACCOUNT).splitlines()
    assert rows == [
        "# What was carried of my\\|file",
        "",
        "| quantity | state | how, or why not | where |",
        "|---|---|---|---|",
        "| geom margin | not carried | a \\| b | g\\<1\\> |",
        "| geom gap | not carried | why |  |",
        "| damping | approximated | by 3 % |  |",
        "| option gravity | carried | 0 0 -9.81 |  |",
    ]


def test_the_terminal_has_a_line_for_each_state() -> None:
    assert terminal_lines(ACCOUNT) == [
        "carried (1): option gravity",
        "approximated (1): damping",
        "not carried (2): geom margin; geom gap",
    ]
    assert terminal_lines(()) == []


REFUSED = {
    "cannot read the scene .*: No such file": None,
    "not valid XML: .*line 1": "<mujoco><body></mujoco>",
    "is a URDF": "<robot/>",
    "line 1: the scene has a document type": '<!DOCTYPE m [<!ENTITY a "b">]><mujoco>&a;</mujoco>',
    "line 2: <include> of a.xml runs in a circle": '<mujoco>\n<include file="a.xml"/></mujoco>',
    "line 1: the file 'b.xml' is not there": '<mujoco><include file="b.xml"/></mujoco>',
    "line 1: the file 'm{199} is no path$": f'<mujoco><mesh file="{300 * "m"}"/></mujoco>',
    "line 2: the file 'm.stl' is not there": '<mujoco>\n<mesh file="m.stl"/></mujoco>',
    "line 1: the file '../../../m.stl' lies out": '<mujoco><mesh file="../../../m.stl"/></mujoco>',
    "the file '/etc/passwd' lies out": '<mujoco><include file="/etc/passwd"/></mujoco>',
    "the file '../../../a/m.stl' lies out": '<mujoco><compiler meshdir="../../../a"/>'
    '<mesh file="m.stl"/></mujoco>',
    "line 1: the file '/etc/passwd' lies out": '<mujoco><model file="/etc/passwd"/></mujoco>',
    "line 1: the file '/a.png' lies out": '<mujoco><texture fileright="/a.png"/></mujoco>',
    "line 1: the file '/a.msh' lies out": '<mujoco><flexcomp file="/a.msh"/></mujoco>',
    "more than 3 elements <body>": f"<mujoco>{4 * '<body/>'}</mujoco>",
    "more than 3 elements .*, with those": '<replicate count="2"><body/>'
    '<replicate count="2"><frame><body/></frame></replicate></replicate>',
    "<body>, with those that": f'<replicate count="{"9" * 5000}"><body/></replicate>',
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


def test_what_is_included_in_a_replicate_counts_as_often(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(mjcf_check.MOST, "body", 3)
    (tmp_path / "b.xml").write_text("<mujocoinclude><body/></mujocoinclude>")
    for count, refused in ("3", False), ("x", False), ("-9", False), ("4", True):
        (tmp_path / "a.xml").write_text(
            f'<mujoco><replicate count="{count}"><include file="b.xml"/></replicate></mujoco>'
        )
        with pytest.raises(DescriptionError, match="more than 3") if refused else nullcontext():
            check_mjcf(str(tmp_path / "a.xml"))
    monkeypatch.setitem(mjcf_check.MOST, "geom", 0)  # of elements five times as many
    with pytest.raises(DescriptionError, match="a.xml, line 1: too much is included"):
        check_mjcf(str(tmp_path / "a.xml"))
    monkeypatch.setitem(mjcf_check.MOST, "geom", 1)
    five = "<mujoco><option/><size/><frame/><include file='b.xml'/></mujoco>"
    (tmp_path / "a.xml").write_text(five)
    check_mjcf(str(tmp_path / "a.xml"))


def test_a_link_out_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "m.stl").write_text("")
    folder = tmp_path / "package" / "scenes" / "scene"
    folder.mkdir(parents=True)
    (folder / "m.stl").symlink_to(tmp_path / "m.stl")
    (folder / "a.xml").write_text('<mujoco><mesh file="m.stl"/></mujoco>')
    with pytest.raises(DescriptionError, match="lies out"):
        check_mjcf(str(folder / "a.xml"))


def test_a_file_that_is_attached_is_looked_at_too(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text('<mujoco><model file="b.xml"/></mujoco>')
    (tmp_path / "b.xml").write_text('<mujoco><model file="a.xml"/><mesh file="/m.stl"/></mujoco>')
    with pytest.raises(DescriptionError, match="b.xml, line 1: the file '/m.stl' lies out"):
        check_mjcf(str(tmp_path / "a.xml"))


def test_what_is_attached_deep_below_may_name_all_that_the_scene_may(tmp_path: Path) -> None:
    deep = tmp_path / "scenes" / "one" / "parts" / "two" / "three" / "b.xml"
    deep.parent.mkdir(parents=True)
    (tmp_path / "m.stl").write_text("")
    deep.write_text('<mujoco><mesh file="../../../../../m.stl"/></mujoco>')
    scene = tmp_path / "scenes" / "one" / "a.xml"
    scene.write_text('<mujoco><model file="parts/two/three/b.xml"/></mujoco>')
    check_mjcf(str(scene))
    with pytest.raises(DescriptionError, match="lies out of the folder"):
        check_mjcf(str(deep))


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


@pytest.mark.parametrize("folders", ['meshdir="meshes" assetdir="none"', 'assetdir="meshes"'])
def test_a_good_file_passes(tmp_path: Path, folders: str) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "m.stl").write_text("")
    (tmp_path / "b.xml").write_text('<mujocoinclude><include file="meshes/c.xml"/></mujocoinclude>')
    (tmp_path / "meshes" / "c.xml").write_text('<inside><mesh file="m.stl"/></inside>')
    (tmp_path / "a.xml").write_text(
        f'<mujoco><compiler {folders}/><compiler/><include file="b.xml"/><body/></mujoco>'
    )
    check_mjcf(str(tmp_path / "a.xml"))


SCENE = Scene(
    "s", tuple(Box(name, (0.1,) * 3, Pose.at(x, 0, 0.1), 1.0) for name, x in (("a", 0), ("b", 1)))
)


def rows(*places: tuple[float, float, float]) -> np.ndarray:
    return np.array([[*place, 1.0, 0.0, 0.0, 0.0] for place in places])


def test_accounts_of_several_files_stand_side_by_side(tmp_path: Path) -> None:
    """Of two called alike the second stood in the place of the first."""
    told = [
        keep(tmp_path, tmp_path / name, account)
        for name, account in (("a.xml", ACCOUNT[1:]), ("b.xml", ACCOUNT), ("b/a.xml", ACCOUNT[:1]),
                              ("a.xml", ACCOUNT[1:]))
    ]  # fmt: skip
    assert told == ["a.xml", "b.xml", "b/a.xml", "a.xml"]
    each = {"a.xml": ACCOUNT[1:], "b.xml": ACCOUNT, "b/a.xml": ACCOUNT[:1]}
    assert kept(tmp_path) == each
    page = (tmp_path / "carried.md").read_text()
    assert page == "\n".join(markdown(*told) for told in each.items())
    shown = sections(tmp_path)
    assert [section.title for section in shown] == [f"What was carried of {name}" for name in each]
    assert len(shown[1].tables[0].columns[0].cells) == len(ACCOUNT)


@pytest.mark.parametrize("line", ['{"file": 1}', '{"x": "y"}', '{"state": "odd"}', "[]", "x"])
def test_lines_that_are_no_account_are_passed_over(tmp_path: Path, line: str) -> None:
    keep(tmp_path, Path("a.xml"), ACCOUNT)
    with (tmp_path / "carried.jsonl").open("a") as file:
        file.write(line + "\n")
    assert kept(tmp_path) == {"a.xml": tuple(ACCOUNT)}


def test_equal_starts_elsewhere_on_the_table_are_one(tmp_path: Path) -> None:
    a = rows((0, 0, 1), (0.5, 0, 1), (0, 0, 1))
    b = rows((0, 0, 2), (0.5, 0, 2), (0, 0.1, 2))
    np.savez(tmp_path / "starts.npz", a=a, b=b)
    starts = read_starts(tmp_path / "starts.npz", SCENE)
    assert [start.poses[1].position for start in starts] == [(0, 0, 2), (0.5, 0, 2), (0, 0.1, 2)]
    assert distinct(starts, SCENE) == 2
    assert distinct(starts[:2], SCENE) == 1


def test_starts_differ_from_what_they_leave_and_in_what_drives_are_told(tmp_path: Path) -> None:
    """Three places of one body beside another that stays counted as one."""
    np.savez(tmp_path / "starts.npz", a=rows((0, 0, 1), (0.5, 0, 1), (0, 0, 1)))
    assert distinct(read_starts(tmp_path / "starts.npz", SCENE), SCENE) == 2
    told = [
        Start((), (), (0.1,), (to,), speeds) for to, speeds in ((0.1, ()), (0.2, ()), (0.1, (1.0,)))
    ]
    assert distinct([*told, Start((), (), (0.1,))], SCENE) == 3


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"c": rows((0, 0, 0))}, "'c', which is no free body of scene 's'; it has a, b"),
        ({"a": np.zeros((2, 3))}, r"must hold an array \(n, 7\)"),
        ({"a": np.zeros(7)}, r"must hold an array \(n, 7\)"),
        ({"a": rows((0, 0, 0)), "b": np.zeros((1, 7, 7))}, r"must hold an array \(n, 7\)"),
        ({"a": np.array([["x"] * 7])}, "the starts of 'a' are not all finite numbers"),
        ({"a": np.zeros((0, 7))}, "of the same n, 1 or more"),
        ({"a": rows((0, 0, 0)), "b": rows((0, 0, 0), (1, 0, 0))}, "of the same n"),
        ({"a": rows((0, 0, np.nan))}, "not all finite"),
        ({"a": np.zeros((1, 7))}, "quaternion of 'a' in row 0 has no unit length"),
        ({"a": [*rows((0, 0, 0)), np.ones(7)]}, "quaternion of 'a' in row 1 has no unit length"),
        ({}, r"must hold an array \(n, 7\)"),
    ],
)
def test_bad_starts_are_one_sentence(
    arrays: dict[str, np.ndarray], message: str, tmp_path: Path
) -> None:
    np.savez(tmp_path / "starts.npz", **arrays)
    with pytest.raises(DescriptionError, match=message):
        read_starts(tmp_path / "starts.npz", SCENE)


def test_no_such_file_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match="cannot read the file"):
        read_starts(tmp_path / "none.npz", SCENE)
