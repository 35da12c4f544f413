"""Faults that can be planted in any robot: what is wrong in its description or in its drives."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from pytest_simbench.scene import FloatArray, Pose, Robot, Scene
from pytest_simbench.simulator import Capability, PreparedRobot
from pytest_simbench.simulator.robot_files import description_xml, digest
from pytest_simbench.testing.scenes import of_scene, with_joint

Plant = Callable[[Scene, Path], Scene]
Edit = Callable[[ET.Element, Path], None]

_TILT = math.radians(5)


@dataclass(frozen=True)
class Fault:
    """One way in which a world may be built wrong.

    Attributes:
        what: in plain words.
        quantity: that must be found to differ.
        plant: makes the faulty scene of the true one; files go into the folder.
        needs: the capability without which an engine cannot be wrong in this way.
    """

    what: str
    quantity: str
    plant: Plant
    needs: Capability | None = None


def robot_faults(robot: Robot) -> dict[str, Fault]:
    """Faults of the middle joint of an arm, of the link that it moves, of the base and the fingers.
    No two concern one quantity, so one world holds them all."""
    first, middle = robot.arm_joints[0].name, robot.arm_joints[len(robot.arm_joints) // 2].name
    moved = {joint.name: joint.child for joint in PreparedRobot(robot).joints}
    return faults_about(moved[first], middle, moved[middle], robot.gripper.joints)


def faults_about(first: str, middle: str, moved: str, fingers: tuple[str, ...]) -> dict[str, Fault]:
    """The same by names: of the first link, of a joint, of the link that this moves, of the joints
    of the fingers."""
    joint, link = f"joint[@name='{middle}']", f"link[@name='{moved}']"
    inertial, drive, of_link = f"{link}/inertial", f"joint/{middle}", f"link/{moved}"
    of_drive = partial(of_joint, middle)
    rows: dict[str, tuple[str, str, Plant]] = {
        "joint_origin": (f"{middle} is 10 mm aside", f"{of_link}/pose",
                         edited(joint, shift(y=0.01))),
        "joint_axis": (f"the axis of {middle} is turned by 5 degrees", f"{drive}/axis",
                       edited(joint, _tilt)),
        "joint_limits": (f"{middle} stops 0.1 rad earlier", f"{drive}/limits",
                         edited(f"{joint}/limit", add("lower", 0.1))),
        "no_shape": (f"{moved} has no collision shape", f"{of_link}/meshes",
                     edited(link, without_shapes)),
        "link_mass": (f"{moved} weighs 0.1 kg more", f"{of_link}/mass",
                      edited(f"{inertial}/mass", add("value", 0.1))),
        "centre_of_mass": (f"the centre of mass of {moved} is 10 mm off", f"{of_link}/com",
                           edited(inertial, shift(y=0.01))),
        "inertia": (f"the inertia of {moved} is 20 % larger", f"{of_link}/inertia",
                    edited(f"{inertial}/inertia", _larger)),
        "base": ("the base is 10 mm aside", f"link/{first}/pose",
                 of_robot(lambda robot: replace(robot, base=robot.base * Pose.at(0.0, 0.01, 0.0)))),
        "friction": ("the robot's friction is 4", f"{of_link}/friction",
                     of_robot(lambda robot: replace(robot, friction=4.0))),
        "stiffness": (f"{middle} has a drive 10 % stiffer", f"{drive}/stiffness",
                      of_drive(stiffness=1.1)),
        "drive_damping": (f"{middle} has a drive that damps 10 % more", f"{drive}/damping",
                          of_drive(damping=1.1)),
        "effort_limit": (f"{middle} has twice its effort limit", f"{drive}/effort_limit",
                         of_drive(effort_limit=2.0)),
        "armature": (f"{middle} has half its rotor inertia", f"{drive}/armature",
                     of_drive(armature=0.5)),
        "initial_position": (f"{middle} starts 10 mrad farther", f"{drive}/initial_position",
                             _farther(middle)),
    }  # fmt: skip
    if fingers:
        of_fingers = f"joint/{fingers[0]}/effort_limit"
        rows["squeeze"] = "the fingers squeeze twice as strongly", of_fingers, _twice(fingers)
    return {name: Fault(*row) for name, row in rows.items()}


def of_robot(change: Callable[[Robot], Robot]) -> Plant:
    """Another robot."""
    return lambda scene, _: replace(scene, robot=change(of_scene(scene)))


def of_joint(name: str, **factors: float) -> Plant:
    """Values of one joint's drive, multiplied."""

    def plant(scene: Scene, _: Path) -> Scene:
        robot = of_scene(scene)
        joint = next(joint for joint in robot.joints if joint.name == name)
        values = {key: factor * getattr(joint, key) for key, factor in factors.items()}
        return replace(scene, robot=with_joint(robot, name, **values))

    return plant


def edited(path: str, edit: Edit) -> Plant:
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
        edit(element, folder)
        ET.ElementTree(root).write(folder / "faulty.urdf")
        return replace(scene, robot=replace(robot, urdf=str(folder / "faulty.urdf")))

    return plant


def add(key: str, value: float) -> Edit:
    """A larger value of an attribute."""

    def edit(element: ET.Element, _: Path) -> None:
        element.attrib[key] = str(float(element.attrib[key]) + value)

    return edit


def shift(y: float = 0.0, z: float = 0.0) -> Edit:
    """The <origin> of an element, moved [m]."""

    def edit(element: ET.Element, _: Path) -> None:
        origin = element.find("origin")
        if origin is None:
            origin = ET.SubElement(element, "origin")
        at = _numbers(origin.attrib.get("xyz", "0 0 0"))
        origin.attrib["xyz"] = _text(at + np.array([0.0, y, z]))

    return edit


def without_shapes(link: ET.Element, _: Path) -> None:
    for shape in link.findall("collision"):
        link.remove(shape)


def _tilt(joint: ET.Element, _: Path) -> None:
    """The <axis>, turned by 5 degrees."""
    axis = joint.find("axis")
    if axis is None:
        axis = ET.SubElement(joint, "axis", xyz="1 0 0")
    old = _numbers(axis.attrib["xyz"])
    aside = np.cross(old, np.roll(old, 1))
    turned = math.cos(_TILT) * old + math.sin(_TILT) * aside / np.linalg.norm(aside)
    axis.attrib["xyz"] = _text(turned)


def _larger(inertia: ET.Element, _: Path) -> None:
    for key, value in inertia.attrib.items():
        inertia.attrib[key] = str(1.2 * float(value))


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
