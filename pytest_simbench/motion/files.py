"""Robots from TOML files, each next to a URDF: drives, limits of motion, hand, tool frame, base.

The built-in arms are such files too, in the folder `arms`. docs/extending/robots.md has the keys.
"""

from __future__ import annotations

import re
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pytest_simbench.description.mesh_check import PACKAGE
from pytest_simbench.description.robot_files import content, description_xml, keep
from pytest_simbench.description.urdf import pose_of_rpy
from pytest_simbench.description.urdf_check import MOVING, Description, read_xml
from pytest_simbench.ground.files import FileError, read_file
from pytest_simbench.motion import panda
from pytest_simbench.motion.adapting import (
    bound_joints,
    free_frames,
    lock_joints,
    mounted,
    pairs_not_checked,
    with_tool,
)
from pytest_simbench.motion.collision import PlanningScene
from pytest_simbench.motion.errors import RobotError
from pytest_simbench.motion.hulls import AXES, Cuts, with_hulls
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.table import FileTable
from pytest_simbench.scene import Gripper, Joint, MotionLimits, Pose, Robot, Scene, SceneError
from pytest_simbench.simulator import DescriptionError

LARGEST_FILE = 2**20
"""[bytes]"""

SMALLEST = 1e-6
"""What must be above zero is at least this."""

FEWEST_CORNERS = 50
"""Of a mesh's hull. With fewer a ball of 5 cm radius stands back by more than 4 mm."""

JERK = 100.0
"""Jerk limit where a file has none, as a multiple of the acceleration limit [1/s]: the
acceleration then builds up in 10 ms."""


def read_robot(path: str | Path) -> Robot:
    """The robot that a TOML file describes, checked.

    Raises:
        RobotError: the file, or one that it names, cannot be used; one sentence.
    """
    path = Path(path)
    try:
        data = tomllib.loads(read_file(path, LARGEST_FILE, "the robot file").decode("utf-8-sig"))
    except FileError as error:
        raise RobotError(str(error)) from None
    except (ValueError, RecursionError) as error:
        raise RobotError(f"{path} is no TOML file: {error}") from None
    try:
        return _Reader(FileTable(data, str(path)), path.parent).read()
    except (DescriptionError, SceneError, FileError) as error:
        raise RobotError(f"{path}: {error}") from None


class _Hand(NamedTuple):
    """What a file says of the hand; `mount` where it is another description's, `tool` where the
    tool centre point lies elsewhere in the link `tool_frame`."""

    joints: tuple[Joint, ...]
    gripper: Gripper
    tool_frame: str
    speed: float
    mount: tuple[str, Pose] | None = None
    tool: Pose | None = None


class _Reader:
    """Reads one file, whose paths begin in `folder`."""

    def __init__(self, table: FileTable, folder: Path) -> None:
        self.table, self.folder = table, folder
        self.name = table.text("name")
        if not re.fullmatch(r"[A-Za-z0-9_-]{1,40}", self.name) or self.name in ("all", "none"):
            raise table.error("name", "use up to 40 letters, digits, _ and - (not all, not none)")
        self.packages = {panda.DISTRIBUTION: str(panda.description_folder())}
        for name, place in table.every("packages", FileTable.text).items():
            self.packages[name] = str(folder / place)
        self.urdf = self._path(table.text("urdf"))
        self.srdf = self._path(table.text("srdf")) if "srdf" in table else None
        self._locked, self._changed = table.every("locked", FileTable.number), False
        description = Description(self.urdf, self.packages, self._adapt)
        self.moving = _moving(description.joints)
        self._mimics = {n: mimic for n, j in self.moving.items() for mimic in j.iter("mimic")}
        corners = table.number("hull_corners", 0.0, least=0.0)
        if corners and (corners < FEWEST_CORNERS or corners != int(corners)):
            raise table.error("hull_corners", f"give a whole number of at least {FEWEST_CORNERS}")
        cuts = self._cuts(description, bool(corners))
        if self._changed or corners:
            kept = content(description, self.name)
            if corners:
                kept = with_hulls(kept, int(corners), cuts)
            self.urdf, self.packages = str(keep(kept["urdf"], kept["meshes"])), {}

    def read(self) -> Robot:
        """Arm and hand as one robot."""
        table, arm = self.table, self.table.table("arm")
        names = arm.texts("joints")
        joints = self._drives(arm, names, arm.each("ready", len(names)))
        measured, limits = "levers" in arm, self._limits(arm, names)
        arm.close()
        hand = self._hand()
        self._check_mimics(hand.gripper.joints)
        swing = self._swing(len(names)) if "throw" in table else None
        position, yaw = table.each("base", 3, 0.0), table.number("yaw", 0.0)
        stand = Pose.at(*table.each("stand", 3), yaw=yaw) if "stand" in table else None
        robot = Robot(
            name=self.name,
            urdf=self.urdf,
            packages=self.packages,
            srdf="",
            joints=(*joints, *hand.joints),
            gripper=hand.gripper,
            tool_frame=hand.tool_frame,
            base=Pose.at(*position, yaw=yaw),
            friction=table.number("friction", 1.0, least=0.0),
            swing=swing,
            stand=stand,
            self_collide=table.flag("self_collide", False),
        )
        table.close()
        robot = _with_files(robot, hand, self.srdf)
        limits = replace(limits, finger_speed=hand.speed)
        if not measured:
            limits = replace(limits, levers=levers_of(RobotModel(robot)))
        return _standing(replace(robot, limits=limits))

    def _adapt(self, urdf: ET.Element) -> None:
        """Make of the user's URDF what tasks can use."""
        changes = [bound_joints(urdf), free_frames(urdf), bool(self._locked)]
        self._changed = any(changes)
        _check_moving(self.table, "locked", self._locked, _moving(urdf.findall("joint")))
        lock_joints(urdf, self._locked)

    def _cuts(self, description: Description, hulls: bool) -> dict[str, Cuts]:
        """Where the meshes of links are cut, by link."""
        found, links = {}, description.links
        for name, table in self.table.every("cut", FileTable.table).items():
            if not hulls:
                raise self.table.error("cut", "give hull_corners too: each slice becomes a hull")
            if name not in links:
                raise self.table.error("cut", f"{name!r:.80} is no link; it has {', '.join(links)}")
            axis = table.text("axis")
            if axis not in AXES:
                raise table.error("axis", f"choose from {', '.join(AXES)}")
            found[name] = Cuts(axis, table.some("at"))
            table.close()
        return found

    def _path(self, text: str) -> str:
        """A path from the file's folder, or of a package."""
        package, _, rest = text.removeprefix(PACKAGE).partition("/")
        if not text.startswith(PACKAGE):
            return str(self.folder / text)
        if package not in self.packages:
            known = ", ".join(self.packages)
            raise RobotError(
                f"{self.table.where}: {text!r:.200} is in no package of the file; it has {known}"
            )
        return str(Path(self.packages[package]) / rest)

    def _drives(
        self, table: FileTable, names: Sequence[str], start: Sequence[float]
    ) -> tuple[Joint, ...]:
        _check_moving(table, "joints", names, self.moving)
        n = len(names)
        columns = [table.each(key, n, least=SMALLEST) for key in ("stiffness", "damping")]
        effort = table.each("effort", n, self._of_urdf("effort", names), least=SMALLEST)
        armature = table.each("armature", n, panda.ARMATURE, least=0.0)
        return tuple(
            Joint(*values) for values in zip(names, *columns, effort, armature, start, strict=True)
        )

    def _check_mimics(self, fingers: Collection[str]) -> None:
        """Fingers alone follow each other, and move alike."""
        for name, mimic in self._mimics.items():
            leader, ratio = mimic.attrib["joint"], float(mimic.get("multiplier", 1))
            alike = (ratio, float(mimic.get("offset", 0))) == (1.0, 0.0)
            if not (alike and {name, leader} <= set(fingers)):
                raise DescriptionError(
                    f"joint {name!r} follows {leader!r} (<mimic>), and here each joint of an arm "
                    "moves by itself, and fingers move alike, with multiplier 1 and offset 0; "
                    "leave <mimic> out, turn the finger's axis, or put the joint under [locked]"
                )

    def _of_urdf(self, key: str, names: Sequence[str]) -> list[float]:
        """The URDF's limits of effort or velocity."""
        limits = [next(self.moving[name].iter("limit")) for name in names]
        return [float(limit.get(key, 0)) for limit in limits]

    def _limits(self, arm: FileTable, names: Sequence[str]) -> MotionLimits:
        n = len(names)
        acceleration = arm.each("acceleration", n, least=SMALLEST)
        return MotionLimits(
            velocity=arm.each("velocity", n, self._of_urdf("velocity", names), least=SMALLEST),
            acceleration=acceleration,
            jerk=arm.each("jerk", n, [JERK * value for value in acceleration], least=SMALLEST),
            levers=arm.each("levers", n, 1.0, least=SMALLEST),
            finger_speed=1.0,
        )

    def _swing(self, n: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Arm joints before and after a throw."""
        throw = self.table.table("throw")
        swing = throw.each("start", n), throw.each("end", n)
        throw.close()
        return swing

    def _hand(self) -> _Hand:
        hand = self.table.table("hand")
        if "use" in hand:
            if hand.text("use") != "panda":
                raise hand.error("use", 'the one hand that is known is "panda"')
            mount = hand.text("mount"), _pose(hand) or Pose()
            squeeze = hand.number("squeeze", panda.SQUEEZE, least=SMALLEST)
            hand.close()
            joints, gripper = panda.fingers(squeeze), panda.gripper(squeeze)
            return _Hand(joints, gripper, panda.TOOL_FRAME, panda.LIMITS.finger_speed, mount)
        return self._own_hand(hand)

    def _own_hand(self, hand: FileTable) -> _Hand:
        """A hand in the robot's own URDF; one without joints only touches."""
        frame, tool = hand.text("tool_frame"), _pose(hand)
        if "joints" not in hand:
            hand.close()
            nothing = Gripper((), 0.0, 0.0, 0.0)
            return _Hand((), nothing, frame, panda.LIMITS.finger_speed, tool=tool)
        names = hand.texts("joints")
        opened, closed = hand.number("opened"), hand.number("closed")
        if not closed < opened:
            raise hand.error("opened", f"it must be above closed, which is {closed:g}")
        joints = self._drives(hand, names, [opened] * len(names))
        squeeze = joints[0].effort_limit
        if {joint.effort_limit for joint in joints} != {squeeze}:
            raise hand.error("effort", "give all fingers the same: it is the hand's squeeze [N]")
        speed = hand.number("speed", min(self._of_urdf("velocity", names)), least=SMALLEST)
        hand.close()
        return _Hand(joints, Gripper(names, opened, closed, squeeze), frame, speed, tool=tool)


def _pose(table: FileTable) -> Pose | None:
    """The pose that `xyz` and `rpy` give; None where neither is there."""
    if "xyz" not in table and "rpy" not in table:
        return None
    return pose_of_rpy(table.each("xyz", 3, 0.0), table.each("rpy", 3, 0.0))


def _moving(joints: Iterable[ET.Element]) -> dict[str, ET.Element]:
    """The joints that move, by name."""
    return {joint.get("name", ""): joint for joint in joints if joint.get("type") in MOVING}


def _check_moving(
    table: FileTable, key: str, names: Iterable[str], moving: Collection[str]
) -> None:
    for name in names:
        if name not in moving:
            known = ", ".join(moving) or "none"
            raise table.error(key, f"{name!r:.80} is no moving joint of the URDF; it has {known}")


def _with_files(robot: Robot, hand: _Hand, srdf: str | None) -> Robot:
    """The robot with its hand mounted, and a list of the link pairs that are not checked."""
    lists = [read_xml(srdf, "the list of link pairs")] if srdf else []
    if hand.tool is not None:
        robot = with_tool(robot, hand.tool)
    elif hand.mount is not None:
        whole = panda.panda()
        robot = mounted(robot, whole, panda.HAND, *hand.mount)
        lists.append(read_xml(whole.srdf, "the list of link pairs"))
    pairs = pairs_not_checked(description_xml(robot), lists)
    return replace(robot, srdf=str(keep(pairs, ending=".srdf")))


def _standing(robot: Robot) -> Robot:
    """The robot, if the arm carries the hand, can throw so, and nothing touches where it begins."""
    model = RobotModel(robot)
    carrier = model.pin.frames[model.tool].parentJoint
    if carrier != model.arm:
        raise DescriptionError(
            f"the tool frame {robot.tool_frame!r} hangs on {model.pin.names[carrier]!r}, not on "
            f"{model.pin.names[model.arm]!r}, the last joint of the arm"
        )
    if any((np.clip(arm, model.lower, model.upper) != arm).any() for arm in robot.swing or ()):
        raise DescriptionError("[throw]: start or end lies outside the limits of the joints")
    touching = PlanningScene(model, Scene("ready", (), robot)).collision(model.home)
    if touching is not None:
        raise DescriptionError(
            f"in its ready position {' touches '.join(touching)}; change ready, or list two links "
            "that may touch in an SRDF file"
        )
    return robot


def levers_of(model: RobotModel) -> tuple[float, ...]:
    """How far the fingertips can be from each arm joint's axis at most [m]: the lengths from joint
    to joint up to the tool frame, strokes included, and the opening of the hand, which for a jaw
    that turns is the arc of its tip. 1 [m/m] for a joint that slides."""
    offsets = [
        float(np.linalg.norm(model.pin.jointPlacements[joint].translation)) + stroke
        for joint, stroke in enumerate(model.strokes, 1)
    ]
    tool = float(np.linalg.norm(model.pin.frames[model.tool].placement.translation))
    rest = tool + model.robot.gripper.opened * model.finger_lever
    return tuple(1.0 if s else sum(offsets[k:]) + rest for k, s in enumerate(model.strokes, 1))
