"""Faults that can be planted in any robot, as `testing.faults.FAULTS` are in the Panda."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from pytest_simbench.scene import FloatArray, Pose, Robot, Scene
from pytest_simbench.simulator import PreparedRobot
from pytest_simbench.simulator.robot_files import description_xml, digest
from pytest_simbench.testing.faults import Fault, Plant, of_joint, of_robot
from pytest_simbench.testing.scenes import of_scene, with_joint

_TILT = math.radians(5)


def robot_faults(robot: Robot) -> dict[str, Fault]:
    """Faults of the middle joint of an arm, of the link that it moves, and of the base. No two
    concern one quantity, so one world holds them all."""
    first, middle = robot.arm_joints[0].name, robot.arm_joints[len(robot.arm_joints) // 2].name
    moved = {joint.name: joint.child for joint in PreparedRobot(robot).joints}
    joint, link = f"joint[@name='{middle}']", f"link[@name='{moved[middle]}']"
    of_link, of_drive = f"link/{moved[middle]}", f"joint/{middle}"

    def drive(what: str, **factors: float) -> Fault:
        (quantity,) = factors
        return Fault(f"{middle} has {what}", f"{of_drive}/{quantity}", of_joint(middle, **factors))

    faults = {
        "joint_origin": Fault(
            f"{middle} is 10 mm aside", f"{of_link}/pose", _edited(joint, _shift(0.01))
        ),
        "joint_axis": Fault(
            f"the axis of {middle} is turned by 5 degrees",
            f"{of_drive}/axis",
            _edited(joint, _tilt),
        ),
        "joint_limits": Fault(
            f"{middle} stops 0.1 rad earlier",
            f"{of_drive}/limits",
            _edited(f"{joint}/limit", _add("lower", 0.1)),
        ),
        "no_shape": Fault(
            f"{moved[middle]} has no collision shape",
            f"{of_link}/meshes",
            _edited(link, _without_shapes),
        ),
        "link_mass": Fault(
            f"{moved[middle]} weighs 0.1 kg more",
            f"{of_link}/mass",
            _edited(f"{link}/inertial/mass", _add("value", 0.1)),
        ),
        "centre_of_mass": Fault(
            f"the centre of mass of {moved[middle]} is 10 mm off",
            f"{of_link}/com",
            _edited(f"{link}/inertial", _shift(0.01)),
        ),
        "inertia": Fault(
            f"the inertia of {moved[middle]} is 20 % larger",
            f"{of_link}/inertia",
            _edited(f"{link}/inertial/inertia", _larger),
        ),
        "base": Fault(
            "the base is 10 mm aside",
            f"link/{moved[first]}/pose",
            of_robot(base=robot.base * Pose.at(0.0, 0.01, 0.0)),
        ),
        "friction": Fault(
            "the robot's friction is 4", f"{of_link}/friction", of_robot(friction=4.0)
        ),
        "stiffness": drive("a drive 10 % stiffer", stiffness=1.1),
        "drive_damping": drive("a drive that damps 10 % more", damping=1.1),
        "effort_limit": drive("twice its effort limit", effort_limit=2.0),
        "armature": drive("half its rotor inertia", armature=0.5),
        "initial_position": Fault(
            f"{middle} starts 10 mrad farther", f"{of_drive}/initial_position", _farther(middle)
        ),
    }
    if robot.gripper.joints:
        faults["squeeze"] = Fault(
            "the fingers squeeze twice as strongly",
            f"joint/{robot.gripper.joints[0]}/effort_limit",
            _twice(robot.gripper.joints),
        )
    return faults


Edit = Callable[[ET.Element], None]


def _edited(path: str, edit: Edit) -> Plant:
    """An element of the URDF, edited; the meshes come along."""

    def plant(scene: Scene, folder: Path) -> Scene:
        def beside(mesh: Path) -> str:
            data = mesh.read_bytes()
            (folder / f"{digest(data)}.stl").write_bytes(data)
            return f"{digest(data)}.stl"

        robot = of_scene(scene)
        root = description_xml(robot, beside)
        element = root.find(path)
        if element is None:
            raise LookupError(f"{robot.urdf} has no {path}")
        edit(element)
        ET.ElementTree(root).write(folder / "faulty.urdf")
        return replace(scene, robot=replace(robot, urdf=str(folder / "faulty.urdf")))

    return plant


def _add(key: str, value: float) -> Edit:
    """A larger value of an attribute."""

    def edit(element: ET.Element) -> None:
        element.attrib[key] = str(float(element.attrib[key]) + value)

    return edit


def _shift(y: float) -> Edit:
    """The <origin> of an element, moved [m]."""

    def edit(element: ET.Element) -> None:
        origin = element.find("origin")
        if origin is None:
            origin = ET.SubElement(element, "origin")
        at = _numbers(origin.attrib.get("xyz", "0 0 0"))
        origin.attrib["xyz"] = _text(at + np.array([0.0, y, 0.0]))

    return edit


def _tilt(joint: ET.Element) -> None:
    """The <axis>, turned by 5 degrees."""
    axis = joint.find("axis")
    if axis is None:
        axis = ET.SubElement(joint, "axis", xyz="1 0 0")
    old = _numbers(axis.attrib["xyz"])
    aside = np.cross(old, np.roll(old, 1))
    turned = math.cos(_TILT) * old + math.sin(_TILT) * aside / np.linalg.norm(aside)
    axis.attrib["xyz"] = _text(turned)


def _larger(inertia: ET.Element) -> None:
    for key, value in inertia.attrib.items():
        inertia.attrib[key] = str(1.2 * float(value))


def _without_shapes(link: ET.Element) -> None:
    for shape in link.findall("collision"):
        link.remove(shape)


def _farther(name: str) -> Plant:
    """A joint that starts 10 mrad farther."""

    def plant(scene: Scene, folder: Path) -> Scene:
        robot = of_scene(scene)
        joint = next(joint for joint in robot.joints if joint.name == name)
        moved = with_joint(robot, name, initial_position=joint.initial_position + 0.01)
        return replace(scene, robot=moved)

    return plant


def _twice(joints: tuple[str, ...]) -> Plant:
    """All fingers with twice their effort limit."""

    def plant(scene: Scene, folder: Path) -> Scene:
        for name in joints:
            scene = of_joint(name, effort_limit=2.0)(scene, folder)
        return scene

    return plant


def _numbers(text: str) -> FloatArray:
    return np.array([float(part) for part in text.split()])


def _text(values: FloatArray) -> str:
    return " ".join(repr(float(value)) for value in values)
