"""Gazebo with one planted fault: a world that differs from the scene in one quantity.

Loaded by workers as `tests.sims.gazebo_faults:FaultyGazebo`, since Gazebo lives in the system's
Python; the setting `fault` names the quantity. Faults are planted in the text of the world, which
is what Gazebo is told.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from typing import Any

from pytest_simbench.sims.gazebo import adapter
from pytest_simbench.sims.gazebo.adapter import Gazebo

from pytest_simbench.scene import Scene

from .planted import Planting

LINK = "model[@name='robot']/link[@name='panda_link4']"
JOINT = "model[@name='robot']/joint[@name='panda_joint4']/axis"
CUBE = "model[@name='cube_05']"
BOX = f"{CUBE}/link/collision"


Fault = Callable[[ET.Element], None]


def other(path: str, at: int, factor: float = 1.0, by: float = 0.0) -> Fault:
    """One of the numbers at a path, times a factor, and moved."""

    def plant(world: ET.Element) -> None:
        element = world.find(path)
        numbers = [float(text) for text in (element.text or "").split()]
        numbers[at] = factor * numbers[at] + by
        element.text = " ".join(map(repr, numbers))

    return plant


def added(path: str, tags: str, text: str) -> Fault:
    """Elements below a path, one in the other, the last with a text."""

    def plant(world: ET.Element) -> None:
        for element in world.findall(path):
            for tag in tags.split("/"):
                found = element.find(tag)
                element = ET.SubElement(element, tag) if found is None else found
            element.text = text

    return plant


def bouncing(path: str) -> Fault:
    return added(path, "surface/bounce/restitution_coefficient", "0.5")


def ghost(path: str) -> Fault:
    return added(path, "surface/contact/collide_bitmask", "0")


FAULTS: dict[str, Fault] = {
    "timestep": other("physics/max_step_size", 0, factor=0.5),
    "ground/height": other("model[@name='ground']/pose", 2, by=0.01),
    "body/cube_05/com": other(f"{CUBE}/link/inertial/pose", 0, by=0.01),
    "body/cube_05/gravity": added(f"{CUBE}/link", "gravity", "false"),
    "body/cube_05/touches": ghost(BOX),
    "body/cube_05/dynamic": added(f"{CUBE}/link", "kinematic", "true"),
    "link/panda_link4/restitution": bouncing(f"{LINK}/collision"),
    "link/panda_link4/gravity": added(LINK, "gravity", "false"),
    "link/panda_link4/touches": ghost(f"{LINK}/collision"),
    "joint/panda_joint4/friction": added(JOINT, "dynamics/damping", "1.0"),
}
"""By quantity; `gripper/coupled` is dartsim's own to break, see `test_gazebo`."""


def childless(world: ET.Element) -> None:
    """A joint of a link that is not there."""
    child = world.find("model[@name='robot']/joint[@name='panda_joint4']/child")
    child.text = "no_such_link"


PLANTS: dict[str, Fault] = {**FAULTS, "refused": childless}
"""What can be planted: a fault, or what Gazebo refuses."""


class FaultyGazebo(Planting, Gazebo):
    faults = FAULTS

    def load(self, scene: Scene) -> None:
        honest = adapter.world_text

        def text(*args: Any) -> str:
            root = ET.fromstring(honest(*args))
            world = root.find("world")
            PLANTS[self.settings.fault](world)
            return ET.tostring(root, encoding="unicode")

        if self.settings.fault:
            adapter.world_text = text
        try:
            Gazebo.load(self, scene)
        finally:
            adapter.world_text = honest
