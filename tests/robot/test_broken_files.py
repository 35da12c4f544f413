"""Robot files with something wrong in them: one sentence each, and no traceback of ours."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_simbench.robot.errors import RobotError
from pytest_simbench.robot.registry import find
from tests.robot.small_arm import TOML, URDF, link, small_arm

Change = Callable[[str], str]


def swap(old: str, new: str) -> Change:
    """Replaces a text that is there."""

    def change(text: str) -> str:
        assert old in text
        return text.replace(old, new, 1)

    return change


BOMB = '<!DOCTYPE robot [<!ENTITY a "aaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>\n'
MESH = '<mesh filename="{}"/>'
BOX = '<box size="0.05 0.05 0.2"/>'
LOOP = '<mimic joint="right_finger"/></joint>'
LOWER = link("lower", "0.05 0.05 0.2", "0 0 0.15")
SRDF = swap("[arm]", 'srdf = "small.toml"\n[arm]')

IN_TOML = {
    "not TOML": (swap("[arm]", "[arm"), r"is no TOML file: "),
    "no name": (swap('name = "small"', ""), r"small\.toml: name is missing"),
    "a path as name": (swap('"small"', '"../small"'), r"name: use up to 40 letters, digits, _ and"),
    "a reserved name": (swap('"small"', '"all"'), r"name: use up to 40 letters, .*not all"),
    "a key nobody knows": (
        swap("stiffness = 2000.0", "stiffness = 2000.0\nstiffnes = 1"),
        r"\[arm\]: 'stiffnes' means nothing here; valid: joints, ready, stiffness, damping, effo",
    ),
    "no arm": (
        lambda text: text[: text.index("[arm]")] + text[text.index("[hand]") :],
        r"\[arm\]: joints is missing",
    ),
    "no hand": (lambda text: text[: text.index("[hand]")], r"\[hand\]: tool_frame is missing"),
    "a number for a table": (swap("[hand]", "[hand_of_it]"), r"\[hand\]: tool_frame is missing"),
    "no URDF": (swap("small.urdf", "other.urdf"), r"cannot read the robot .*other\.urdf: No such"),
    "an unknown package": (
        swap("small.urdf", "package://mine/small.urdf"),
        r"'package://mine/small.urdf' is in no package of the file; it has example-robot-data",
    ),
    "a wrong joint name": (
        swap('"bend"', '"bent"'),
        r"joints: 'bent' is no moving joint of the URDF; it has turn, lift, bend, left_finger, r",
    ),
    "a joint twice": (swap('"bend"', '"lift"'), r"joints: name each once"),
    "a joint too few": (
        lambda text: swap(', "bend"]', "]")(
            swap("1.2]", "]")(swap("[200.0, 200.0, 150.0]", "200.0")(text))
        ).replace("0.4, ]", "0.4]"),
        r"disagree about joints bend",
    ),
    "joints in another order": (
        swap('"turn", "lift"', '"lift", "turn"'),
        r"has joints \['turn', 'lift', 'bend'.* not \('lift', 'turn'",
    ),
    "too few angles": (swap("0.4, 1.2]", "0.4]"), r"ready: give it 3 numbers, or one .*it has 2"),
    "a stiffness below zero": (swap("2000.0", "-2000.0"), r"stiffness: -2000.0 is no number of at"),
    "a damping that is no number": (swap("150.0]", "nan]"), r"damping: nan is no number of at le"),
    "a word for a number": (swap("8.0", '"fast"'), r"acceleration: 'fast' is no number of at leas"),
    "a word for yes": (
        swap("[arm]", 'self_collide = "yes"\n[arm]'),
        r"self_collide: 'yes' is neither true nor false",
    ),
    "yes for a number": (swap("8.0", "true"), r"acceleration: True is no number of at least"),
    "a ready position out of the limits": (
        swap("0.4, 1.2]", "0.4, 2.6]"),
        r"joint 'bend' of small starts at 2\.6, .* from -2\.5 to 2\.5",
    ),
    "a ready position inside itself": (
        swap("0.4, 1.2]", "-2.4, -2.4]"),
        r"in its ready position .* touches .*; change ready, or list two links that may touch",
    ),
    "a tool frame that is no link": (
        swap('"grip"', '"grab"'),
        r"the tool frame 'grab' of small is no link of .*; choose from foot, column, upper, lowe",
    ),
    "a tool frame that the arm does not carry": (
        swap('"grip"', '"upper"'),
        r"the tool frame 'upper' hangs on 'lift', not on 'bend', the last joint of the arm",
    ),
    "a hand that opens inwards": (
        swap("closed = 0.0", "closed = 0.05"),
        r"opened: it must be above closed, which is 0\.05",
    ),
    "a hand without a finger of its own": (
        swap('["left_finger", "right_finger"]', '["left_finger"]'),
        r"disagree about joints right_finger",
    ),
    "fingers of two strengths": (
        swap("effort = 20.0", "effort = [20.0, 10.0]"),
        r"effort: give all fingers the same: it is the hand's squeeze",
    ),
    "an unknown hand": (
        lambda text: text[: text.index("[hand]")] + '[hand]\nuse = "robotiq"\nmount = "lower"\n',
        r'use: the one hand that is known is "panda"',
    ),
    "a mount that is no link": (
        lambda text: text[: text.index("[hand]")] + '[hand]\nuse = "panda"\nmount = "flange"\n',
        r"the hand is mounted on 'flange', which is no link of the arm; choose from foot, column",
    ),
    "a list of pairs that is none": (SRDF, r"list of link pairs .*small\.toml is not valid XML"),
}  # fmt: skip

IN_URDF = {
    "not XML": (swap("</robot>", ""), r"small\.urdf is not valid XML"),
    "an XML bomb": (lambda text: BOMB + text, r"has a document type .*leave it out"),
    "a missing mesh": (swap(BOX, MESH.format("none.stl")), r"none\.stl, which does not exist"),
    "a mesh out of the folder": (
        swap(BOX, MESH.format("../../secret.stl")),
        r"out of the robot's folders; put the file beside",
    ),
    "a mesh of 200 MB": (swap(BOX, MESH.format("huge.stl")), r"huge\.stl: it is larger than 16 MB"),
    "a mesh that is a text": (swap(BOX, MESH.format("text.stl")), r"holds no binary STL mesh"),
    "a sphere": (swap(BOX, '<sphere radius="0.1"/>'), r"a collision shape of <sphere>; it must"),
    "no inertia": (
        lambda text: text.replace(LOWER, '<link name="lower"/>'),
        r"link 'lower' is moved by joint 'bend' and has no mass; give it an <inertial>",
    ),
    "a mass below zero": (swap('mass value="1"', 'mass value="-1"'), r"has the mass -1 kg"),
    "a tensor that no body has": (swap('izz="0.01"', 'izz="0.03"'), r"none is larger than the ot"),
    "limits the wrong way": (
        swap('lower="-2.5" upper="2.5"', 'lower="2.5" upper="-2.5"'),
        r"joint 'turn' may go from 2\.5 to -2\.5; lower must be below upper",
    ),
    "a negative limit": (swap('effort="80"', 'effort="-80"'), r"has the effort limit '-80'; it"),
    "no limit of effort": (swap('effort="80"', ""), r"effort: 0.0 is no number of at least 1e-06"),
    "a mimic loop": (
        lambda text: text.replace("</joint>", LOOP.replace("right", "left"), 5).replace(
            '<mimic joint="left_finger"/>', "", 3
        ),
        r"follows itself \(<mimic>\); let one of the joints lead",
    ),
    "two roots": (swap("</robot>", '<link name="loose"/></robot>'), r"has 2 root links, not one"),
}  # fmt: skip


def refused(path: Path | str, message: str) -> None:
    with pytest.raises(RobotError, match=message) as refusal:
        find(str(path))
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 600


@pytest.mark.parametrize("what", IN_TOML)
def test_a_broken_robot_file(what: str, tmp_path: Path) -> None:
    change, message = IN_TOML[what]
    refused(small_arm(tmp_path, change(TOML)), message)


@pytest.mark.parametrize("what", IN_URDF)
def test_a_broken_description(what: str, tmp_path: Path) -> None:
    change, message = IN_URDF[what]
    path = small_arm(tmp_path, urdf=change(URDF))
    (tmp_path / "text.stl").write_text("solid box\nendsolid box\n")
    with (tmp_path / "huge.stl").open("wb") as file:
        file.truncate(200 * 2**20)
    refused(path, message)


def test_a_robot_file_that_is_none(tmp_path: Path) -> None:
    refused(tmp_path, r"unknown robot|it is a folder")
    pipe = tmp_path / "pipe.toml"
    os.mkfifo(pipe)
    refused(pipe, r"cannot read the robot file .*pipe\.toml: it is a pipe")
    folder = tmp_path / "folder.toml"
    folder.mkdir()
    refused(folder, r"cannot read the robot file .*folder\.toml: it is a folder")
    large = tmp_path / "large.toml"
    large.write_bytes(b"#" * (2**20 + 1))
    refused(large, r"larger than 1 MB")
