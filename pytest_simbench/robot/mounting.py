"""One robot of two: a hand, cut out of its own description, mounted on an arm."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from itertools import combinations
from typing import Any

from pytest_simbench.scene import Pose
from pytest_simbench.simulator import DescriptionError
from pytest_simbench.simulator.urdf import write_origin

MOUNT_JOINT = "mount_of_the_hand"


def mounted(arm: ET.Element, hand: ET.Element, root: str, mount: str, pose: Pose) -> ET.Element:
    """The URDF of an arm with a hand.

    Args:
        arm: URDF of the arm.
        hand: a URDF with the hand in it.
        root: link of `hand` with which the hand begins; what hangs on it is the hand.
        mount: link of `arm` that carries it.
        pose: of `root` in `mount`.

    Raises:
        DescriptionError: no such link, or a name that both have.
    """
    names = [link.get("name", "") for link in arm.findall("link")]
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
                f"arm and hand both have the {element.tag} {element.get('name')!r}; rename one"
            )
    joint = ET.Element("joint", name=MOUNT_JOINT, type="fixed")
    ET.SubElement(joint, "parent", link=mount)
    ET.SubElement(joint, "child", link=root)
    write_origin(joint, pose)
    whole = ET.Element("robot", arm.attrib)
    whole.extend([*arm, *parts, joint])
    return whole


def _below(xml: ET.Element, root: str) -> set[str]:
    """Names of the links at and below a link, and of the joints between them."""
    found: set[str] = set()
    waiting = [root] if any(link.get("name") == root for link in xml.findall("link")) else []
    while waiting:
        name = waiting.pop()
        found.add(name)
        for joint in xml.findall("joint"):
            if _end(joint, "parent") == name:
                found.add(joint.get("name", ""))
                waiting.append(_end(joint, "child"))
    return found


def _end(joint: ET.Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def pairs_not_checked(urdf: ET.Element, lists: Iterable[ET.Element]) -> ET.Element:
    """The SRDF of a robot: the link pairs that its lists name, and every pair that one joint joins.

    Links that are fixed to each other move as one, so the neighbours of one are those of all.

    Args:
        urdf: of the whole robot.
        lists: SRDF of arm and hand.
    """
    links = {link.get("name", "") for link in urdf.findall("link")}
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
    body: dict[str, Any] = {link.get("name", ""): {link.get("name")} for link in urdf.iter("link")}
    for joint in urdf.findall("joint"):
        if joint.get("type") == "fixed":
            whole = body[_end(joint, "parent")] | body[_end(joint, "child")]
            for name in whole:
                body[name] = whole
    return body
