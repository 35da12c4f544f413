"""Robots from TOML files, sound and broken ones."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from pytest_simbench.motion.collision import MARGIN
from pytest_simbench.motion.errors import RobotError
from pytest_simbench.motion.files import read_robot
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.motion.planning import CHECK_SPACING
from pytest_simbench.motion.registry import ARMS, BUILT_IN, find
from pytest_simbench.scene import Pose
from pytest_simbench.simulator import PreparedRobot
from tests.motion.small_arm import TOML, URDF, joint, link, small_arm

MOUNTED, HAND = ("ur5", "ur10", "xarm7"), ("left_finger", "right_finger")


def test_a_file_says_everything(tmp_path: Path) -> None:
    robot = read_robot(small_arm(tmp_path))
    assert robot.name == "small"
    assert robot.joint_names == ("turn", "lift", "bend", "left_finger", "right_finger")
    assert robot.column("stiffness").tolist() == [2000, 2000, 2000, 1000, 1000]
    assert robot.column("damping").tolist() == [200, 200, 150, 40, 40]
    assert robot.column("effort_limit").tolist() == [80, 80, 80, 20, 20]
    assert robot.column("armature").tolist() == [0.1] * 5
    assert robot.column("initial_position").tolist() == [0, 0.4, 1.2, 0.04, 0.04]
    assert (robot.gripper.opened, robot.gripper.closed, robot.gripper.squeeze) == (0.04, 0, 20)
    assert robot.tool_frame == "grip"
    assert robot.base == Pose.at(0.1, 0.0, 0.2)
    assert robot.friction == 1.0
    assert not robot.self_collide
    limits = robot.limits
    assert limits.velocity == (2, 2, 2)  # the URDF's
    assert limits.acceleration == (8, 8, 8)
    assert limits.jerk == (800, 800, 800)
    assert limits.finger_speed == 2
    assert limits.levers == pytest.approx((0.2 + 0.3 + 0.42, 0.3 + 0.42, 0.42))


def test_an_arm_reaches_as_much_farther_as_a_joint_slides(tmp_path: Path) -> None:
    slider = joint("bend", "upper", "lower", "0 0 0.3", "0 0 1", "prismatic")  # by 0.05 m
    urdf = URDF.replace(joint("bend", "upper", "lower", "0 0 0.3", "0 1 0"), slider)
    robot = read_robot(small_arm(tmp_path, TOML.replace("1.2]", "0.01]"), urdf))
    assert robot.limits.levers == pytest.approx((0.2 + 0.35 + 0.42, 0.35 + 0.42, 1.0))
    assert RobotModel(robot).reach == pytest.approx(0.2 + 0.35 + 0.38)


def test_what_a_file_says_besides(tmp_path: Path) -> None:
    more = TOML.replace(
        "[arm]",
        "yaw = 1.5\nfriction = 0.6\nself_collide = true\n[arm]\njerk = 50\nlevers = [1, 0.9, 0.5]",
    ).replace("base =", "stand = [0.3, 0.1, 0.0]\nbase =")
    more = more.replace("[arm]\n", "[arm]\nvelocity = [1, 1.5, 2]\neffort = 40\narmature = 0.02\n")
    robot = read_robot(small_arm(tmp_path, more.replace("[hand]", "[hand]\nspeed = 0.1")))
    assert robot.base == Pose.at(0.1, 0.0, 0.2, yaw=1.5)
    assert robot.stand == Pose.at(0.3, 0.1, 0.0, yaw=1.5)
    assert robot.friction == 0.6
    assert robot.self_collide
    assert robot.column("effort_limit")[:3].tolist() == [40, 40, 40]
    assert robot.column("armature")[:3].tolist() == [0.02] * 3
    limits = robot.limits
    assert limits.velocity == (1, 1.5, 2)
    assert limits.jerk == (50, 50, 50)
    assert limits.levers == (1, 0.9, 0.5)
    assert limits.finger_speed == 0.1


@pytest.mark.parametrize("name", MOUNTED)
def test_a_built_in_arm_carries_the_pandas_hand(name: str) -> None:
    robot = find(name)
    assert robot.name == name
    assert robot.gripper == panda().gripper
    assert robot.joints[-2:] == panda().joints[-2:]
    prepared, whole = PreparedRobot(robot), PreparedRobot(panda())
    for finger in ("panda_leftfinger", "panda_rightfinger"):
        ours, theirs = prepared.links[finger], whole.links[finger]
        assert ours.mass == theirs.mass
        assert [shape.size for shape in ours.shapes] == [shape.size for shape in theirs.shapes]
    arm = pin.buildModelFromUrdf(str(read_arm(name)))
    mass = sum(inertia.mass for inertia in RobotModel(robot).pin.inertias)
    assert mass == pytest.approx(sum(inertia.mass for inertia in arm.inertias) + 0.73 + 0.03)


def read_arm(name: str) -> Path:
    """The arm's own URDF, as its file names it."""
    line = next(x for x in (ARMS / f"{name}.toml").read_text().splitlines() if x.startswith("urdf"))
    folder = panda().packages["example-robot-data"]
    return Path(folder, line.partition("example-robot-data/")[2].rstrip('"'))


@pytest.mark.parametrize("name", MOUNTED)
def test_the_tool_lies_before_the_flange(name: str) -> None:
    """The hand's tool centre point is 0.1034 m along the flange's z axis, at any position."""
    robot = find(name)
    model = RobotModel(robot)
    arm = pin.buildModelFromUrdf(str(read_arm(name)))
    flange = arm.getFrameId("tool0" if name.startswith("ur") else "link_eef")
    for q in np.random.default_rng(1).uniform(-1, 1, (5, model.arm)):
        data = arm.createData()
        pin.framesForwardKinematics(arm, data, q)
        expected = model.base * data.oMf[flange] * pin.SE3(np.eye(3), np.array([0, 0, 0.1034]))
        assert np.allclose(model.tool_transform(q).homogeneous, expected.homogeneous, atol=1e-9)


@pytest.mark.parametrize("name", sorted(BUILT_IN))
def test_between_two_checks_no_fingertip_moves_farther_than_twice_the_margin(name: str) -> None:
    """Distances from the tip of an open finger to each joint's axis, at random positions. The
    Panda's levers are 14 % short of a stretched arm's."""
    model = RobotModel(find(name))
    farthest = np.zeros(model.arm)
    for arm in np.random.default_rng(5).uniform(model.lower, model.upper, (1000, model.arm)):
        pin.computeJointJacobians(model.pin, model.data, model.full(arm))
        tool = model.base.actInv(model.tool_transform(arm))
        tip = tool.act(np.array([0.009, 0.035 + 0.0152, 0.009]))
        for k in range(model.arm):
            away = tip - model.data.oMi[k + 1].translation
            distance = np.linalg.norm(np.cross(model.data.J[3:, k], away))
            farthest[k] = max(farthest[k], float(distance))
    levers = model.limits.column("levers")
    assert (farthest * CHECK_SPACING <= 2 * MARGIN * levers).all(), farthest


def test_the_same_robot_lies_in_the_same_place() -> None:
    """Engines keep compiled meshes by path; files are named by their content."""
    first, again = (read_robot(ARMS / "ur5.toml") for _ in range(2))
    assert first == again
    assert first.limits == again.limits
    assert Path(first.urdf).stem == Path(again.urdf).stem != Path(find("ur10").urdf).stem


def test_unknown_robots() -> None:
    with pytest.raises(RobotError, match=r"unknown robot 'ur7'; choose from panda, .*ur5.*\.toml"):
        find("ur7")
    with pytest.raises(RobotError, match=r"cannot read the robot file none\.toml: No such file"):
        find("none.toml")


def test_a_file_cannot_take_a_known_name(tmp_path: Path) -> None:
    path = small_arm(tmp_path, TOML.replace('"small"', '"ur5"', 1))
    with pytest.raises(RobotError, match="the name 'ur5' is that of a known robot"):
        find(str(path))


def test_a_hand_that_only_touches(tmp_path: Path) -> None:
    toml = TOML[: TOML.index("[hand]")] + '[hand]\ntool_frame = "grip"\n'
    fixed = URDF.replace('type="prismatic"', 'type="fixed"')
    robot = read_robot(small_arm(tmp_path, toml, fixed))
    assert robot.joint_names == ("turn", "lift", "bend")
    assert robot.gripper.couplings == ()
    assert not RobotModel(robot).has_parallel_fingers


def test_a_hand_of_three_fingers_and_one_of_one(tmp_path: Path) -> None:
    third = link("third", "0.01 0.02 0.08", "0.005 0 0.06", 0.05, 0.1)
    third += joint("third_finger", "lower", "third", "0 0 0.3", "1 0 0", "prismatic")
    urdf = URDF.replace("</robot>", f"{third}</robot>")
    toml = TOML.replace('"right_finger"]', '"right_finger", "third_finger"]')
    robot = read_robot(small_arm(tmp_path, toml, urdf))
    pairs = [(pair.leader, pair.follower) for pair in robot.gripper.couplings]
    assert pairs == [("left_finger", "right_finger"), ("left_finger", "third_finger")]
    assert not RobotModel(robot).has_parallel_fingers
    jaw = URDF.replace(
        '<joint name="right_finger" type="prismatic">', '<joint name="right_finger" type="fixed">'
    )
    toml = TOML.replace(', "right_finger"]', "]")
    assert read_robot(small_arm(tmp_path, toml, jaw)).gripper.couplings == ()


def test_fingers_may_follow_each_other(tmp_path: Path) -> None:
    end = 'child link="right"/>'
    urdf = URDF.replace(end, f'{end}<mimic joint="left_finger"/>')
    assert read_robot(small_arm(tmp_path, TOML, urdf)).joint_names[3:] == HAND


Change = Callable[[str], str]


def swap(old: str, new: str) -> Change:
    """Replaces a text that is there."""

    def change(text: str) -> str:
        assert old in text
        return text.replace(old, new, 1)

    return change


def more(text: str, before: str = "") -> Change:
    """Says this after, and that before everything else."""
    return lambda toml: f"{before}\n{toml}\n{text}\n"


HULLS = "hull_corners = 99"


def test_a_package_also_holds_the_link_pairs_of_an_arm_with_hulls(tmp_path: Path) -> None:
    pairs = '<disable_collisions link2="upper" link1="foot"/><disable_collisions link2="foot"/>'
    (tmp_path / "small.srdf").write_text(f"<robot>{pairs}</robot>")
    toml = TOML.replace("[arm]", 'srdf = "package://mine/small.srdf"\npackages.mine = "."\n[arm]')
    srdf = Path(read_robot(small_arm(tmp_path, f"{HULLS}\n{toml}")).srdf).read_text()
    told = re.findall('link1="(.*?)" link2="(.*?)"', srdf)
    assert ("foot", "upper") in told  # and what one joint joins, the grip fixed to the last link
    assert set(told) - {("foot", "upper")} == {
        ("column", "foot"), ("column", "upper"), ("lower", "upper"), ("grip", "upper"),
        ("left", "lower"), ("grip", "left"), ("lower", "right"), ("grip", "right"),
        ("grip", "lower"),
    }  # fmt: skip


SWING = "[throw]\nstart = [0.1, 0.2, 0.3]\nend = "
LOOP = '<mimic joint="right_finger"/></joint>'
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
    "a number for a table": (
        lambda text: f"hand = 3\n{text[: text.index('[hand]')]}",
        r"small\.toml: hand: make it a table, with its values below \[hand\]$",
    ),
    "a blank name": (swap('"small"', '" "'), r"small\.toml: name: give it a text$"),
    "a name for a list": (swap('["turn", "lift", "bend"]', '"turn"'), r"joints: give it a list of"),
    "numbers for names": (swap('"bend"]', "3]"), r"\[arm\]: joints: give it a list of names"),
    "a number too large": (swap("8.0", "2e12"), r"acceleration: 2000000000000.0 is no number of"),
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
    "a hand that does not open": (
        swap("closed = 0.0", "closed = 0.04"),
        r"opened: it must be above closed, which is 0\.04",
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
    "a locked joint that is none": (
        more("[locked]\nlost_finger = 0"), r"small\.toml: locked: 'lost_finger' is no moving joint"
    ),
    "a joint of the arm that is locked": (
        more("[locked]\nbend = 0.1"), r"joints: 'bend' is no moving joint of the URDF; it has"
    ),
    "locked out of the limits": (
        lambda text: swap('["left_finger", "right_finger"]', '["left_finger"]')(text)
        + "[locked]\nright_finger = 5.0\n",
        r"joint 'right_finger' is locked at 5, and its URDF lets it go from 0 to 0\.05 rad or m",
    ),
    "locked at no number": (more("[locked]\nbend = nan"), r"\[locked\]: bend: nan is no number of"),
    "a tool beside no link": (
        lambda text: swap('"grip"', '"grab"')(text) + "xyz = [0.0, 0.0, 0.0]\n",
        r"the tool frame 'grab' is no link; choose from foot, column, upper, lower",
    ),
    "a swing out of the limits": (
        more(SWING + "[0.4, 0.5, 2.6]"), r"\[throw\]: start or end lies outside the limits of the j"
    ),
    "a swing of too few angles": (more(SWING + "[0.4, 0.5]"), r"\[throw\]: end: give it 3 numbers"),
    "a swing with more in it": (
        more(SWING + "[0.4, 0.5, 0.6]\nstop = 1"), r"\[throw\]: 'stop' means nothing here; valid: "
    ),
    "too few corners": (more("", "hull_corners = 12"), "hull_corners: give a whole number of"),
    "cuts without hulls": (
        more('[cut]\nupper = { axis = "z", at = [0.1] }'), "cut: give hull_corners too"
    ),
    "a cut of no link": (
        more('[cut]\nno = { axis = "z", at = [0.1] }', HULLS), "cut: 'no' is no link; it has foot"
    ),
    "a cut across no axis": (
        more('[cut]\nupper = { axis = "w", at = [0.1] }', HULLS), "axis: choose from x, y, z"
    ),
    "a cut nowhere": (more('[cut]\nupper = { axis = "x", at = [] }', HULLS), "at: give it a list"),
    "a list of pairs that is none": (SRDF, r"list of link pairs .*small\.toml is not valid XML"),
}  # fmt: skip

IN_URDF = {
    "not XML": (swap("</robot>", ""), r"small\.toml: .*small\.urdf is not valid XML"),
    "no limit of effort": (swap('effort="80"', ""), r"effort: 0.0 is no number of at least 1e-06"),
    "a joint of the arm that follows": (
        swap('child link="lower"/>', 'child link="lower"/><mimic joint="lift"/>'),
        r"joint 'bend' follows 'lift' \(<mimic>\), and here each joint of an arm moves by itself",
    ),
    "a finger that moves the other way": (
        swap(
            'child link="right"/>',
            'child link="right"/><mimic joint="left_finger" multiplier="-1"/>',
        ),
        r"joint 'right_finger' follows 'left_finger' .* turn the finger's axis",
    ),
    "a finger that moves ahead": (
        swap('child link="right"/>', 'child link="right"/><mimic joint="left_finger" offset="1"/>'),
        r"joint 'right_finger' follows 'left_finger' .* multiplier 1 and offset 0",
    ),
    "a mimic loop": (
        lambda text: text.replace("</joint>", LOOP.replace("right", "left"), 5).replace(
            '<mimic joint="left_finger"/>', "", 3
        ),
        r"follows itself \(<mimic>\); let one of the joints lead",
    ),
}  # fmt: skip
"""What is wrong with a URDF has its table in tests/description/test_urdf_check.py."""


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
    refused(small_arm(tmp_path, urdf=change(URDF)), message)


def test_a_robot_file_that_is_too_large(tmp_path: Path) -> None:
    large = tmp_path / "large.toml"
    large.write_bytes(b"#" * (2**20 + 1))
    refused(large, r"larger than 1 MB")
