"""What is changed in a robot's URDF before tasks use it, because its TOML file says so.

All functions change the root element that they are given. What is wrong with a name is told by the
reader of the file; what is wrong with the URDF itself, by `Description`, which looks afterwards.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping

from pytest_simbench.scene import Pose
from pytest_simbench.simulator import DescriptionError
from pytest_simbench.simulator.urdf import pose_of_rpy, write_origin
from pytest_simbench.simulator.urdf_check import FIXED, MOVING

TURNS = 2 * math.pi
"""How far a joint that turns without end may go to each side, where no limits stand beside it
[rad]: one turn, as the makers of such arms write it."""

FRAME_MASS = 1e-6
"""A link without shapes that weighs no more than this marks a frame [kg]: onshape-to-robot, which
many small arms come from, gives its frames 1e-9 kg and no inertia."""

TOOL_LINK, TOOL_JOINT = "tool_centre_point", "joint_of_the_tool_centre_point"


def bound_joints(robot: ET.Element) -> bool:
    """Give joints that turn without end limits: planning and engines need them.

    Returns:
        Whether there were any.
    """
    endless = [joint for joint in robot.findall("joint") if joint.get("type") == "continuous"]
    for joint in endless:
        joint.set("type", "revolute")
        limit = joint.find("limit")
        if limit is None:
            limit = ET.SubElement(joint, "limit")
        if "lower" not in limit.attrib and "upper" not in limit.attrib:
            limit.attrib.update(lower=repr(-TURNS), upper=repr(TURNS))
    return bool(endless)


def free_frames(robot: ET.Element) -> bool:
    """Take the mass from links that only mark a frame: a body of no inertia has none.

    Returns:
        Whether there were any.
    """
    found = False
    for link in robot.findall("link"):
        masses = link.findall("inertial/mass")
        if link.find("collision") is None and any(map(_negligible, masses)):
            for inertial in link.findall("inertial"):
                link.remove(inertial)
            found = True
    return found


def _negligible(mass: ET.Element) -> bool:
    try:
        return 0.0 < float(mass.get("value", "")) <= FRAME_MASS
    except ValueError:
        return False  # `Description` says so


def lock_joints(robot: ET.Element, positions: Mapping[str, float]) -> None:
    """Make joints fixed ones, where they stand at some position.

    Args:
        positions: of joints that move, by name [rad] or [m]; others are left as they are.

    Raises:
        DescriptionError: a number of such a joint cannot be read.
    """
    for joint in robot.findall("joint"):
        if joint.get("name") not in positions or joint.get("type") not in MOVING:
            continue
        position = positions[joint.get("name", "")]
        axis = _numbers(joint, "axis", "xyz", "1 0 0")
        origin = pose_of_rpy(*(_numbers(joint, "origin", key, "0 0 0") for key in ("xyz", "rpy")))
        if joint.get("type") == "prismatic":
            moved = Pose.at(*(part * position for part in axis))
        else:
            sine = math.sin(position / 2)
            x, y, z = (part * sine for part in axis)
            moved = Pose(quaternion=(math.cos(position / 2), x, y, z))
        for tag in ("origin", "mimic"):
            for element in joint.findall(tag):
                joint.remove(element)
        joint.set("type", FIXED)
        write_origin(joint, origin * moved)


def add_tool(
    robot: ET.Element, link: str, pose: Pose, name: str = TOOL_LINK, joint_name: str = TOOL_JOINT
) -> None:
    """Add a link without mass at the tool centre point.

    Args:
        link: that carries it.
        pose: in that link.
        name, joint_name: of the new link and its joint.

    Raises:
        DescriptionError: there is no such link, or one with the new link's name.
    """
    names = [element.get("name", "") for element in robot.findall("link")]
    if link not in names:
        raise DescriptionError(
            f"the tool frame {link!r} is no link; choose from {', '.join(names)}"
        )
    if name in names:
        raise DescriptionError(
            f"there is a link {name!r} already; name it as tool_frame, without xyz and rpy"
        )
    ET.SubElement(robot, "link", name=name)
    joint = ET.SubElement(robot, "joint", name=joint_name, type=FIXED)
    ET.SubElement(joint, "parent", link=link)
    ET.SubElement(joint, "child", link=name)
    write_origin(joint, pose)


def _numbers(joint: ET.Element, tag: str, key: str, default: str) -> tuple[float, ...]:
    """Three numbers of a joint's part."""
    part = joint.find(tag)
    text = default if part is None else part.get(key, default)
    try:
        x, y, z = map(float, text.split())
    except ValueError:
        raise DescriptionError(
            f"joint {joint.get('name')!r} has <{tag} {key}={text[:80]!r}>; give 3 numbers"
        ) from None
    return x, y, z
