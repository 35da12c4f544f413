"""Worlds with one planted fault each: what the parity check must see.

An adapter is given the faulty scene to build, and what it reads back is held against the true one.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pytest_simbench.description.mesh_check import written_stl
from pytest_simbench.description.robot_files import content_of, digest, folder, keep
from pytest_simbench.description.shapes import mesh_points
from pytest_simbench.laws.mechanisms import Part, Y, mechanism
from pytest_simbench.scene import (
    Box,
    Capsule,
    Closure,
    Compound,
    ConvexMesh,
    Cylinder,
    FloatArray,
    Pose,
    Robot,
    Scene,
    Sphere,
)
from pytest_simbench.simulator import Capability, PreparedRobot
from pytest_simbench.testing import scenes

Plant = Callable[[Scene], Scene]
"""Makes the faulty scene of the true one."""

Edit = Callable[[ET.Element], None]
"""Changes an element of a description."""


@dataclass(frozen=True)
class Fault:
    """One way in which a world may be built wrong.

    Attributes:
        quantity: that must be found to differ.
        needs: the capability without which an engine cannot be wrong in this way.
        word: of `Deviation.only`, by which an adapter declares that its engine has no such thing.
    """

    what: str
    quantity: str
    plant: Plant
    needs: Capability | None = None
    word: str = ""


TURNED, SPIN = Pose.at(0.5, 0.1, 0.315, yaw=0.4), (0.7, -0.5, 0.4)
"""Of the true scene's brick: where it is, and its angular velocity [rad/s]."""

LYING = Pose((0.7, -0.1, 0.42), (math.cos(0.3), math.sin(0.3), 0.0, 0.0)) * Pose(
    quaternion=(math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)
)
"""Of the true scene's can, which falls: it lies across, and is turned about the x axis."""

LEANING = Pose((0.6, 0.25, 0.4), (math.cos(0.4), 0.6 * math.sin(0.4), 0.8 * math.sin(0.4), 0.0))
"""Of the true scene's wedge, which falls."""


def true_scene() -> Scene:
    """The Panda in front of a table with a brick that starts up and a cube: odd sizes and
    velocities, tilted gravity."""
    bodies = (
        Box("table", (0.9, 0.9, 0.3), Pose.at(0.8, 0.0, 0.15)),
        Box("brick", (0.1, 0.06, 0.03), TURNED, 0.23, linear_velocity=(0.2, -0.1, 0.3),
            angular_velocity=SPIN),
        scenes.cube("cube", Pose.at(0.6, -0.1, 0.325, yaw=-1.0)),
        Sphere("ball", 0.03, Pose.at(0.7, 0.1, 0.33), 0.12, restitution=0.6, linear_damping=0.3,
               angular_damping=0.2),
        Cylinder("can", 0.033, 0.11, LYING, 0.3),
        Capsule("pill", 0.02, 0.06, Pose.at(0.8, -0.2, 0.36, yaw=0.3), 0.08),
        ConvexMesh("wedge", scenes.wedge(), LEANING, 0.15),
        Box("belt", (0.5, 0.2, 0.1), Pose.at(-0.6, 0.5, 0.3, yaw=0.2),
            linear_velocity=(0.3, 0.0, 0.0), prescribed=True),
        Cylinder("pillar", 0.04, 0.2, Pose.at(0.5, -0.6, 0.1)),
        Compound("stool", _stool(), Pose.at(-0.5, -0.5, 0.5, yaw=0.4), 0.5,
                 moments=(1.0e-3, 1.2e-3, 1.1e-3), friction=0.7),
    )  # fmt: skip
    pull = (0.3, -0.2, -3.7)
    scene = Scene("full", bodies, scenes.arm(), gravity=pull, ground_restitution=0.6)
    return scene.with_frictions(lambda mu: 0.7)


def _stool(aside: float = 0.0) -> tuple[Box, Box]:
    """Foot and back of a body of two shapes, the back `aside` of its place [m]."""
    back = Box("back", (0.02, 0.1, 0.1), Pose.at(0.03, aside, 0.01, yaw=0.3), friction=0.7)
    return Box("foot", (0.1, 0.1, 0.02), Pose.at(0.0, 0.0, -0.05), friction=0.7), back


def of_scene(**values: Any) -> Plant:
    return lambda scene: replace(scene, **values)


def of_body(name: str, **values: Any) -> Plant:
    return lambda scene: scene.with_body(replace(scene.body(name), **values))


def of_robot(change: Callable[[Robot], Robot]) -> Plant:
    """Another robot."""
    return lambda scene: replace(scene, robot=change(scene.arm))


def of_joints(*names: str, **factors: float) -> Plant:
    """Values of the joints' drives, multiplied."""
    return of_robot(lambda robot: robot.scaled(*names, **factors))


def with_own(joint: str, **values: float) -> Plant:
    """Other values of a joint, see `scene.Joint`."""
    return of_robot(lambda robot: robot.with_joints(joint, **values))


def edited(path: str, edit: Edit) -> Plant:
    """An element of the URDF, edited; the meshes come along."""

    def plant(scene: Scene) -> Scene:
        robot = scene.arm
        root = ET.parse(keep(**content_of(robot))).getroot()
        element = root.find(path)
        if element is None:
            raise LookupError(f"{robot.urdf} has no {path}")
        edit(element)
        urdf = keep(root)
        return replace(scene, robot=replace(robot, urdf=str(urdf)))

    return plant


def add(key: str, value: float) -> Edit:
    """A larger value of an attribute."""

    def edit(element: ET.Element) -> None:
        element.attrib[key] = str(float(element.attrib[key]) + value)

    return edit


def shift(y: float = 0.0, z: float = 0.0) -> Edit:
    """The <origin> of an element, moved [m]."""

    def edit(element: ET.Element) -> None:
        origin = element.find("origin")
        if origin is None:
            origin = ET.SubElement(element, "origin")
        at = _numbers(origin.attrib.get("xyz", "0 0 0"))
        origin.attrib["xyz"] = _text(at + np.array([0.0, y, z]))

    return edit


def put(**values: str) -> Edit:
    """Other values of attributes."""
    return lambda element: element.attrib.update(values)


def _scaled(mesh: ET.Element) -> None:
    """A mesh 1.3 times as large, as an STL file of its own."""
    points = 1.3 * mesh_points(str(folder() / mesh.attrib["filename"]))
    corners = np.resize(points, (3 * math.ceil(len(points) / 3), 3)).reshape(-1, 3, 3)
    data = written_stl(corners)
    path = folder() / f"{digest(data)}.stl"
    path.write_bytes(data)
    mesh.attrib["filename"] = path.name


def _turned_inertia(inertia: ET.Element) -> None:
    """Turned by 90 degrees about z: x becomes y, y becomes minus x."""
    old = dict(inertia.attrib)
    negative = str(-float(old["ixy"]))
    turned = str(-float(old["iyz"]))
    inertia.attrib.update(ixx=old["iyy"], iyy=old["ixx"], ixy=negative, ixz=turned, iyz=old["ixz"])


def without_shapes(link: ET.Element) -> None:
    for shape in link.findall("collision"):
        link.remove(shape)


def _tilt(joint: ET.Element) -> None:
    """The <axis>, turned by 5 degrees."""
    axis = joint.find("axis")
    if axis is None:
        axis = ET.SubElement(joint, "axis", xyz="1 0 0")
    old, tilt = _numbers(axis.attrib["xyz"]), math.radians(5)
    aside = np.cross(old, np.roll(old, 1))
    turned = math.cos(tilt) * old + math.sin(tilt) * aside / np.linalg.norm(aside)
    axis.attrib["xyz"] = _text(turned)


def _larger(inertia: ET.Element) -> None:
    for key, value in inertia.attrib.items():
        inertia.attrib[key] = str(1.2 * float(value))


def _numbers(text: str) -> FloatArray:
    return np.array([float(part) for part in text.split()])


def _text(values: FloatArray) -> str:
    return " ".join(repr(float(value)) for value in values)


def robot_faults(robot: Robot) -> dict[str, Fault]:
    """Faults of the middle joint of an arm, of the link that it moves, of the base and the
    fingers."""
    first, driven = robot.arm_joints[0].name, robot.arm_joints[len(robot.arm_joints) // 2]
    middle, farther = driven.name, driven.initial_position + 0.01
    children = {joint.name: joint.child for joint in PreparedRobot(robot).joints}
    moved, fingers = children[middle], robot.gripper.joints
    joint, link = f"joint[@name='{middle}']", f"link[@name='{moved}']"
    inertial, drive, of_link = f"{link}/inertial", f"joint/{middle}", f"link/{moved}"
    rows: dict[str, tuple[Any, ...]] = {
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
        "base": ("the base is 10 mm aside", f"link/{children[first]}/pose",
                 of_robot(lambda robot: replace(robot, base=robot.base * Pose.at(0.0, 0.01, 0.0)))),
        "friction": ("the robot's friction is 4", f"{of_link}/friction",
                     of_robot(lambda robot: replace(robot, friction=4.0))),
        "stiffness": (f"{middle} has a drive 10 % stiffer", f"{drive}/stiffness",
                      of_joints(middle, stiffness=1.1)),
        "drive_damping": (f"{middle} has a drive that damps 10 % more", f"{drive}/damping",
                          of_joints(middle, damping=1.1)),
        "effort_limit": (f"{middle} has twice its effort limit", f"{drive}/effort_limit",
                         of_joints(middle, effort_limit=2.0)),
        "armature": (f"{middle} has half its rotor inertia", f"{drive}/armature",
                     of_joints(middle, armature=0.5)),
        "passive_damping": (f"{middle} is damped beside its drive", f"{drive}/damping",
                            with_own(middle, passive_damping=3.0), None, "passive_damping"),
        "joint_friction": (f"{middle} has dry friction", f"{drive}/friction",
                           with_own(middle, friction=2.0), None, "joint_friction"),
        "spring": (f"{middle} has a spring beside its drive", f"{drive}/stiffness",
                   with_own(middle, spring=70.0), None, "spring"),
        "link_gravity": (f"{moved} feels half of gravity", f"{of_link}/gravity",
                         with_own(middle, gravity=0.5), None, "link_gravity"),
        "initial_position": (f"{middle} starts 10 mrad farther", f"{drive}/initial_position",
                             with_own(middle, initial_position=farther)),
    }  # fmt: skip
    if fingers:
        twice = of_joints(*fingers, effort_limit=2.0)
        quantity = f"joint/{fingers[0]}/effort_limit"
        rows["squeeze"] = "the fingers squeeze twice as strongly", quantity, twice
    return {name: Fault(*row) for name, row in rows.items()}


_LINK4, _TIP = "link[@name='panda_link4']", "link[@name='panda_leftfinger']/collision[4]"
_THINNER = (0.1, 0.058, 0.03)

_ROWS: dict[str, tuple[Any, ...]] = {
    "finger_shape": ("the rubber tip of a finger is 3 mm thinner", "link/panda_leftfinger/boxes",
                     edited(f"{_TIP}/geometry/box", put(size="17.5e-3 12.2e-3 18.5e-3"))),
    "finger_pad": ("the rubber tip of a finger is 2 mm nearer to the hand",
                   "link/panda_leftfinger/boxes", edited(_TIP, shift(z=-0.002))),
    "mesh_scale": ("the mesh of link 4 is 1.3 times as large", "link/panda_link4/meshes",
                   edited(f"{_LINK4}/collision/geometry/mesh", _scaled)),
    "inertia_turned": ("the inertia of link 4 is turned by 90 degrees", "link/panda_link4/inertia",
                       edited(f"{_LINK4}/inertial/inertia", _turned_inertia)),
    "inertia_product": ("the inertia of link 6 has no products", "link/panda_link6/inertia",
                        edited("link[@name='panda_link6']/inertial/inertia",
                               put(ixy="0", ixz="0", iyz="0"))),
    "self_collide": ("the robot's links collide with each other", "link/panda_link4/touches",
                     of_robot(lambda robot: replace(robot, self_collide=True)),
                     Capability.SELF_COLLIDE),
    "apart": ("brick and cube pass through each other", "body/cube/touches",
              of_scene(apart=(("body/cube", "body/brick"),)), Capability.APART),
    "body_mass": ("the brick weighs 1 kg", "body/brick/mass", of_body("brick", mass=1.0)),
    "body_size": ("the brick is 2 mm thinner", "body/brick/boxes",
                  of_body("brick", size=_THINNER)),
    "ball_size": ("the ball is 1 mm smaller", "body/ball/rounds", of_body("ball", radius=0.0295)),
    "can_length": ("the can is 2 mm shorter", "body/can/rounds", of_body("can", length=0.108)),
    "can_inertia": ("the can is 1 mm thinner, and its inertia with it", "body/can/inertia",
                    of_body("can", radius=0.0325)),
    "pill_length": ("the pill is 2 mm longer", "body/pill/rounds", of_body("pill", length=0.062)),
    "wedge_corners": ("the wedge is 2 mm longer", "body/wedge/meshes",
                      of_body("wedge", vertices=scenes.wedge(length=0.102))),
    "wedge_inertia": ("the wedge is 2 mm wider, and its inertia with it", "body/wedge/inertia",
                      of_body("wedge", vertices=scenes.wedge(width=0.052))),
    "wedge_is_a_box": ("the wedge is the box around it", "body/wedge/meshes",
                       lambda scene: scene.with_body(
                           Box("wedge", scene.body("wedge").extents, LEANING, 0.15, 0.7))),
    "compound_pose": ("the back of the stool is 5 mm aside", "body/stool/boxes",
                      of_body("stool", shapes=_stool(0.005)), Capability.COMPOUND),
    "compound_inertia": ("the stool's moments of inertia are exchanged", "body/stool/inertia",
                         of_body("stool", moments=(1.2e-3, 1.0e-3, 1.1e-3)), Capability.COMPOUND),
    "restitution": ("the ball bounces less", "body/ball/restitution",
                    of_body("ball", restitution=0.55)),
    "ground_restitution": ("the ground bounces less", "ground/restitution",
                           of_scene(ground_restitution=0.55)),
    "body_damping": ("the ball turns on undamped", "body/ball/damping",
                     of_body("ball", angular_damping=0.0)),
    "round_kind": ("the pillar is a capsule as long as it", "body/pillar/rounds",
                   lambda scene: scene.with_body(
                       Capsule("pillar", 0.04, 0.12, scene.body("pillar").pose, friction=0.7))),
    "body_inertia": ("the brick is 2 mm thinner, and its inertia with it", "body/brick/inertia",
                     of_body("brick", size=_THINNER)),
    "linear_velocity": ("the brick starts 1 cm/s faster", "body/brick/velocity",
                        of_body("brick", linear_velocity=(0.2, -0.1, 0.31))),
    "angular_velocity": ("the brick's spin is in its own frame", "body/brick/velocity",
                         of_body("brick", angular_velocity=tuple(TURNED.rotation().T @ SPIN))),
    "body_pose": ("the cube is 1 mm aside", "body/cube/pose",
                  of_body("cube", pose=Pose.at(0.601, -0.1, 0.325, yaw=-1.0))),
    "body_friction": ("the brick's friction is 0.5", "body/brick/friction",
                      of_body("brick", friction=0.5)),
    "fixed_body": ("the cube is fixed in the world", "body/cube/dynamic",
                   of_body("cube", mass=0.0)),
    "driven_body": ("the belt is a free body", "body/belt/dynamic",
                    of_body("belt", prescribed=False, mass=0.4)),
    "gravity": ("gravity is 1 % stronger", "gravity", of_scene(gravity=(0.303, -0.202, -3.737))),
    "ground_friction": ("the ground's friction is 0.9", "ground/friction",
                        of_scene(ground_friction=0.9)),
}  # fmt: skip

FAULTS: dict[str, Fault] = {
    **robot_faults(scenes.arm()),
    **{name: Fault(*row) for name, row in _ROWS.items()},
}
"""By short names."""


def mechanisms(capabilities: Collection[Capability]) -> list[tuple[Scene, dict[str, Fault]]]:
    """True scenes of levers with a spring and with a weld, each with the fault of that."""
    first, second = (Part(f"lever {k}", Y, centre=(0.3, 0.0, 0.0)) for k in (1, 2))
    sprung = mechanism("sprung", replace(first, spring=20.0, rest=0.3))
    weld = Closure(first.link, second.link, (0.1, 0.0, 0.0), (0.1, 0.0, 0.0), rigid=True)
    welded = mechanism("welded", first, second, closures=(weld,))
    shifted = Fault("the spring is at rest 0.1 rad farther", f"joint/{first.name}/rest",
                    with_own(first.name, rest=0.4), None, "spring")  # fmt: skip
    loose = Fault("a ball and its socket in place of the weld", "closure/0/rigid",
                  of_robot(lambda r: replace(r, closures=(replace(weld, rigid=False),))),
                  Capability.LOOPS)  # fmt: skip
    rows = {"rest": (sprung, shifted), "weld": (welded, loose)}
    return [
        (Scene(name, robot=robot), {name: fault})
        for name, (robot, fault) in rows.items()
        if fault.needs in (None, *capabilities)
    ]


def rounds(
    capabilities: Collection[Capability], faults: Mapping[str, Fault] = FAULTS
) -> list[dict[str, Fault]]:
    """The faults of an engine in as few worlds as there are of one quantity: worlds may be dear to
    build.

    No two of a round concern one quantity, so each must be seen beside the others.
    """
    found: list[dict[str, Fault]] = []
    possible = (item for item in faults.items() if item[1].needs in (None, *capabilities))
    for name, fault in possible:
        for group in found:
            if fault.quantity not in {other.quantity for other in group.values()}:
                group[name] = fault
                break
        else:
            found.append({name: fault})
    return found
