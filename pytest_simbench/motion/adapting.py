"""What is changed in a robot's URDF before tasks use it, because its TOML file says so; and a hand,
cut out of its own description, mounted on an arm.

The functions that take a root element change it. What is wrong with a name is told by the reader
of the file; what is wrong with the URDF itself, by `Description`, which looks afterwards."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import combinations

from pytest_simbench.description.links import joint_motion
from pytest_simbench.description.robot_files import content_of, keep
from pytest_simbench.description.urdf import numbers, pose_of_rpy, write_origin
from pytest_simbench.description.urdf_check import FIXED, MOVING
from pytest_simbench.scene import Pose, Robot, Vector3
from pytest_simbench.simulator import DescriptionError

TURNS = 2 * math.pi
"""How far a joint that turns without end may go to each side, where no limits stand beside it
[rad]: one turn, as the makers of such arms write it."""

FRAME_MASS = 1e-6
"""A link without shapes that weighs no more than this marks a frame [kg]: onshape-to-robot, which
many small arms come from, gives its frames 1e-9 kg and no inertia."""

TOOL_LINK, TOOL_JOINT = "tool_centre_point", "joint_of_the_tool_centre_point"


def bound_joints(robot: ET.Element) -> bool:
    """Give joints that turn without end limits: planning and engines need them. Whether there were
    any."""
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
    """Take the mass from links that only mark a frame: a body of no inertia has none. Whether there
    were any."""
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
    """Make joints that move, by name, fixed ones, where they stand at some position [rad] or [m].

    Raises:
        DescriptionError: a number of such a joint cannot be read, or it cannot stand there.
    """
    for joint in robot.findall("joint"):
        if joint.get("name") not in positions or joint.get("type") not in MOVING:
            continue
        axis, position = _numbers(joint, "axis", "xyz", "1 0 0"), positions[joint.attrib["name"]]
        _check_within(joint, position)
        origin = pose_of_rpy(*(_numbers(joint, "origin", key, "0 0 0") for key in ("xyz", "rpy")))
        moved = joint_motion(joint.attrib["type"], axis, position)
        for tag in ("origin", "mimic"):
            for element in joint.findall(tag):
                joint.remove(element)
        joint.set("type", FIXED)
        write_origin(joint, origin * moved)


def _check_within(joint: ET.Element, position: float) -> None:
    """Refuse a position out of the joint's limits."""
    limit = joint.find("limit")
    ends = ("-inf", "inf") if limit is None else (limit.get("lower", ""), limit.get("upper", ""))
    try:
        lower, upper = map(float, ends)
    except ValueError:
        raise DescriptionError(
            f"joint {joint.get('name')!r} has the limits {ends}; give 2 numbers"
        ) from None
    if not lower <= position <= upper:
        raise DescriptionError(
            f"joint {joint.get('name')!r} is locked at {position:g}, and its URDF lets it go from "
            f"{lower:g} to {upper:g} rad or m"
        )


def _fixed(name: str, parent: str, child: str, pose: Pose) -> ET.Element:
    """A joint that holds one link at a pose in another."""
    joint = ET.Element("joint", name=name, type=FIXED)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    write_origin(joint, pose)
    return joint


def _numbers(joint: ET.Element, tag: str, key: str, default: str) -> Vector3:
    """Three numbers of a joint's part."""
    part = joint.find(tag)
    text = default if part is None else part.get(key, default)
    try:
        return numbers(text)
    except ValueError:
        raise DescriptionError(
            f"joint {joint.get('name')!r} has <{tag} {key}={text[:80]!r}>; give 3 numbers"
        ) from None


def with_tool(
    robot: Robot, pose: Pose, name: str = TOOL_LINK, joint_name: str = TOOL_JOINT
) -> Robot:
    """The robot with a new link, without mass, at the tool centre point, which is at a pose in the
    link that was its tool frame.

    Raises:
        DescriptionError: there is no such link, or one with the new link's name.
    """
    kept, link = content_of(robot), robot.tool_frame
    urdf = ET.fromstring(kept["urdf"])
    names = [element.attrib["name"] for element in urdf.findall("link")]
    if link not in names:
        raise DescriptionError(
            f"the tool frame {link!r} is no link; choose from {', '.join(names)}"
        )
    if name in names:
        raise DescriptionError(
            f"there is a link {name!r} already; name it as tool_frame, without xyz and rpy"
        )
    ET.SubElement(urdf, "link", name=name)
    urdf.append(_fixed(joint_name, link, name, pose))
    path = keep(urdf, kept["meshes"])
    return replace(robot, urdf=str(path), packages={}, tool_frame=name)


MOUNT_JOINT = "mount_of_the_hand"


def mounted(
    robot: Robot, other: Robot, root: str, mount: str, pose: Pose, joint: str = MOUNT_JOINT
) -> Robot:
    """An arm whose description has a hand, or a thing beside it; its joints are left as they are.

    Args:
        other: a robot with the hand in it.
        root: link of `other` with which the hand begins; what hangs on it is the hand.
        mount: link of the arm that carries it.
        pose: of `root` in `mount`.
        joint: name of the joint that holds it there.

    Raises:
        DescriptionError: no such link, or a name that both have.
    """
    kept, added = content_of(robot), content_of(other)
    arm, hand = (ET.fromstring(content["urdf"]) for content in (kept, added))
    names = [link.attrib["name"] for link in arm.findall("link")]
    if mount not in names:
        raise DescriptionError(
            f"the hand is mounted on {mount!r}, which is no link of the arm; choose from "
            f"{', '.join(names)}"
        )
    parts = [element for element in hand if element.get("name") in _below(hand, root)]
    if not parts:
        raise DescriptionError(f"the hand begins with {root!r}, which is no link of its URDF")
    taken = {(element.tag, element.get("name")) for element in arm}
    for element in parts:
        if (element.tag, element.get("name")) in taken:
            raise DescriptionError(
                f"two descriptions both have the {element.tag} {element.get('name')!r}; rename one"
            )
    whole = ET.Element("robot", arm.attrib)
    whole.extend([*arm, *parts, _fixed(joint, mount, root, pose)])
    path = keep(whole, {**kept["meshes"], **added["meshes"]})
    return replace(robot, urdf=str(path), packages={})


def _below(xml: ET.Element, root: str) -> set[str]:
    """Names of the links at and below a link, and of the joints between them."""
    found: set[str] = set()
    waiting = [root] if any(link.get("name") == root for link in xml.findall("link")) else []
    while waiting:
        name = waiting.pop()
        found.add(name)
        for joint in xml.findall("joint"):
            if _end(joint, "parent") == name:
                found.add(joint.attrib["name"])
                waiting.append(_end(joint, "child"))
    return found


def _end(joint: ET.Element, tag: str) -> str:
    return next(joint.iter(tag)).attrib["link"]


def pairs_not_checked(urdf: ET.Element, lists: Iterable[ET.Element]) -> ET.Element:
    """The SRDF of a robot: the link pairs that the SRDF of arm and hand name, and every pair that
    one joint joins.

    Links that are fixed to each other move as one, so the neighbours of one are those of all.
    """
    links = {link.attrib["name"] for link in urdf.findall("link")}
    found = {
        (pair.get("link1", ""), pair.get("link2", ""))
        for xml in lists
        for pair in xml.iter("disable_collisions")
    }
    rigid = _rigid_bodies(urdf)
    for joint in urdf.findall("joint"):
        parent, child = rigid[_end(joint, "parent")], rigid[_end(joint, "child")]
        found |= {(a, b) for a in parent for b in child}
    for body in rigid.values():
        found |= set(combinations(sorted(body), 2))
    root = ET.Element("robot", urdf.attrib)
    for a, b in sorted({(min(pair), max(pair)) for pair in found}):
        if {a, b} <= links and a != b:
            ET.SubElement(root, "disable_collisions", link1=a, link2=b)
    return root


def _rigid_bodies(urdf: ET.Element) -> Mapping[str, set[str]]:
    """Each link's body: the links that fixed joints hold together with it."""
    body = {link.attrib["name"]: {link.attrib["name"]} for link in urdf.findall("link")}
    for joint in urdf.findall("joint"):
        if joint.get("type") == "fixed":
            whole = body[_end(joint, "parent")] | body[_end(joint, "child")]
            for name in whole:
                body[name] = whole
    return body
