"""Worlds with one planted fault each: what the parity check must see.

An adapter is given the faulty scene to build, and what it reads back is held against the true one.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.scene import (
    Box,
    Capsule,
    ConvexMesh,
    Cylinder,
    Pose,
    Robot,
    Scene,
    Sphere,
)
from pytest_simbench.simulator.shapes import mesh_points
from pytest_simbench.testing import scenes

Plant = Callable[[Scene, Path], Scene]


@dataclass(frozen=True)
class Fault:
    """One way in which a world may be built wrong.

    Attributes:
        what: in plain words.
        quantity: that must be found to differ.
        plant: makes the faulty scene of the true one; files go into the folder.
    """

    what: str
    quantity: str
    plant: Plant


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
    return Scene(
        "full",
        (
            Box("table", (0.9, 0.9, 0.3), Pose.at(0.8, 0.0, 0.15), friction=0.7),
            Box(
                "brick",
                (0.1, 0.06, 0.03),
                TURNED,
                0.23,
                0.7,
                linear_velocity=(0.2, -0.1, 0.3),
                angular_velocity=SPIN,
            ),
            scenes.cube("cube", Pose.at(0.6, -0.1, 0.325, yaw=-1.0), friction=0.7),
            Sphere(
                "ball",
                0.03,
                Pose.at(0.7, 0.1, 0.33),
                0.12,
                0.7,
                restitution=0.6,
                linear_damping=0.3,
                angular_damping=0.2,
            ),
            Cylinder("can", 0.033, 0.11, LYING, 0.3, 0.7),
            Capsule("pill", 0.02, 0.06, Pose.at(0.8, -0.2, 0.36, yaw=0.3), 0.08, 0.7),
            ConvexMesh("wedge", scenes.wedge(), LEANING, 0.15, 0.7),
            Box(
                "belt",
                (0.5, 0.2, 0.1),
                Pose.at(-0.6, 0.5, 0.3, yaw=0.2),
                friction=0.7,
                linear_velocity=(0.3, 0.0, 0.0),
                prescribed=True,
            ),
            Cylinder("pillar", 0.04, 0.2, Pose.at(0.5, -0.6, 0.1), friction=0.7),
        ),
        robot=replace(scenes.arm(), friction=0.7),
        gravity=(0.3, -0.2, -3.7),
        ground_friction=0.7,
        ground_restitution=0.6,
    )


def of_scene(**values: Any) -> Plant:
    return lambda scene, _: replace(scene, **values)


def of_body(name: str, **values: Any) -> Plant:
    return lambda scene, _: scene.with_body(replace(scene.body(name), **values))


def of_robot(**values: Any) -> Plant:
    return lambda scene, _: replace(scene, robot=replace(_robot(scene), **values))


def of_joint(name: str, **factors: float) -> Plant:
    """Values of one joint's drive, multiplied."""

    def plant(scene: Scene, _: Path) -> Scene:
        robot = _robot(scene)
        joint = next(joint for joint in robot.joints if joint.name == name)
        values = {key: factor * getattr(joint, key) for key, factor in factors.items()}
        return replace(scene, robot=scenes.with_joint(robot, name, **values))

    return plant


def of_description(path: str, edit: Callable[[ET.Element, Robot, Path], None]) -> Plant:
    """An element of the URDF, edited."""

    def plant(scene: Scene, folder: Path) -> Scene:
        robot = _robot(scene)
        tree = ET.parse(robot.urdf)
        element = tree.getroot().find(path)
        if element is None:
            raise LookupError(f"{robot.urdf} has no {path}")
        edit(element, robot, folder)
        tree.write(folder / "faulty.urdf")
        return replace(scene, robot=replace(robot, urdf=str(folder / "faulty.urdf")))

    return plant


def _robot(scene: Scene) -> Robot:
    if scene.robot is None:
        raise LookupError(f"scene {scene.name} has no robot")
    return scene.robot


def _set(**values: str) -> Callable[[ET.Element, Robot, Path], None]:
    return lambda element, robot, folder: element.attrib.update(values)


def _without_shapes(link: ET.Element, robot: Robot, folder: Path) -> None:
    for shape in link.findall("collision"):
        link.remove(shape)


def _scaled(mesh: ET.Element, robot: Robot, folder: Path) -> None:
    """A mesh 1.3 times as large, as an STL file of its own beside the description."""
    package, _, rest = mesh.attrib["filename"].removeprefix("package://").partition("/")
    points = 1.3 * mesh_points(str(Path(robot.packages[package]) / rest))
    corners = np.resize(points, (3 * math.ceil(len(points) / 3), 3)).reshape(-1, 3, 3)
    record = np.zeros(
        len(corners), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("colour", "<u2")]
    )
    record["corners"] = corners
    path = folder / "scaled.stl"
    path.write_bytes(bytes(80) + len(corners).to_bytes(4, "little") + record.tobytes())
    mesh.attrib["filename"] = path.name


def _moved(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Callable[..., None]:
    """An <origin> moved."""

    def edit(origin: ET.Element, robot: Robot, folder: Path) -> None:
        at = np.array([float(part) for part in origin.attrib.get("xyz", "0 0 0").split()])
        origin.attrib["xyz"] = " ".join(map(str, at + np.array([x, y, z])))

    return edit


def _turned_inertia(inertia: ET.Element, robot: Robot, folder: Path) -> None:
    """Turned by 90 degrees about z: x becomes y, y becomes minus x."""
    old = dict(inertia.attrib)
    negative = str(-float(old["ixy"]))
    turned = str(-float(old["iyz"]))
    inertia.attrib.update(ixx=old["iyy"], iyy=old["ixx"], ixy=negative, ixz=turned, iyz=old["ixz"])


_LINK, _JOINT = "link[@name='panda_link4']", "joint[@name='panda_joint4']"
_TILTED = f"{math.sin(math.radians(5))} 0 {math.cos(math.radians(5))}"

FAULTS: dict[str, Fault] = {
    "finger_shape": Fault(
        "the rubber tip of a finger is 3 mm thinner",
        "link/panda_leftfinger/boxes",
        of_description(
            "link[@name='panda_leftfinger']/collision[4]/geometry/box",
            _set(size="17.5e-3 12.2e-3 18.5e-3"),
        ),
    ),
    "finger_pad": Fault(
        "the rubber tip of a finger is 2 mm nearer to the hand",
        "link/panda_leftfinger/boxes",
        of_description("link[@name='panda_leftfinger']/collision[4]/origin", _moved(z=-0.002)),
    ),
    "mesh_scale": Fault(
        "the mesh of link 4 is 1.3 times as large",
        "link/panda_link4/meshes",
        of_description(f"{_LINK}/collision/geometry/mesh", _scaled),
    ),
    "no_shape": Fault(
        "link 4 has no collision shape",
        "link/panda_link4/meshes",
        of_description(_LINK, _without_shapes),
    ),
    "joint_origin": Fault(
        "joint 4 is 10 mm aside",
        "link/panda_link4/pose",
        of_description(f"{_JOINT}/origin", _moved(y=0.01)),
    ),
    "joint_axis": Fault(
        "the axis of joint 1 is turned by 5 degrees",
        "joint/panda_joint1/axis",
        of_description("joint[@name='panda_joint1']/axis", _set(xyz=_TILTED)),
    ),
    "joint_limits": Fault(
        "joint 4 stops 0.1 rad earlier",
        "joint/panda_joint4/limits",
        of_description(f"{_JOINT}/limit", _set(lower="-2.9718")),
    ),
    "link_mass": Fault(
        "link 4 weighs 5 kg",
        "link/panda_link4/mass",
        of_description(f"{_LINK}/inertial/mass", _set(value="5.0")),
    ),
    "centre_of_mass": Fault(
        "the centre of mass of link 4 is 100 mm off",
        "link/panda_link4/com",
        of_description(f"{_LINK}/inertial/origin", _moved(y=-0.1)),
    ),
    "inertia_turned": Fault(
        "the inertia of link 4 is turned by 90 degrees",
        "link/panda_link4/inertia",
        of_description(f"{_LINK}/inertial/inertia", _turned_inertia),
    ),
    "inertia_scaled": Fault(
        "the inertia of link 4 is 20 % larger about x",
        "link/panda_link4/inertia",
        of_description(f"{_LINK}/inertial/inertia", _set(ixx="0.031")),
    ),
    "base": Fault(
        "the base is 10 mm aside",
        "link/panda_link1/pose",
        of_robot(base=Pose.at(0.0, 0.01, 0.0)),
    ),
    "finger_friction": Fault(
        "the robot's friction is 4", "link/panda_leftfinger/friction", of_robot(friction=4.0)
    ),
    "stiffness": Fault(
        "the drive of joint 4 is 10 % stiffer",
        "joint/panda_joint4/stiffness",
        of_joint("panda_joint4", stiffness=1.1),
    ),
    "drive_damping": Fault(
        "the drive of joint 4 damps 10 % more",
        "joint/panda_joint4/damping",
        of_joint("panda_joint4", damping=1.1),
    ),
    "effort_limit": Fault(
        "joint 4 has twice its effort limit",
        "joint/panda_joint4/effort_limit",
        of_joint("panda_joint4", effort_limit=2.0),
    ),
    "squeeze": Fault(
        "the fingers squeeze twice as strongly",
        "joint/panda_finger_joint1/effort_limit",
        lambda scene, folder: of_joint("panda_finger_joint1", effort_limit=2.0)(
            of_joint("panda_finger_joint2", effort_limit=2.0)(scene, folder), folder
        ),
    ),
    "armature": Fault(
        "joint 4 has half its rotor inertia",
        "joint/panda_joint4/armature",
        of_joint("panda_joint4", armature=0.5),
    ),
    "initial_position": Fault(
        "joint 4 starts 1 % nearer to zero",
        "joint/panda_joint4/initial_position",
        of_joint("panda_joint4", initial_position=0.99),
    ),
    "body_mass": Fault("the brick weighs 1 kg", "body/brick/mass", of_body("brick", mass=1.0)),
    "body_size": Fault(
        "the brick is 2 mm thinner",
        "body/brick/boxes",
        of_body("brick", size=(0.1, 0.058, 0.03)),
    ),
    "ball_size": Fault(
        "the ball is 1 mm smaller", "body/ball/rounds", of_body("ball", radius=0.0295)
    ),
    "can_length": Fault("the can is 2 mm shorter", "body/can/rounds", of_body("can", length=0.108)),
    "can_inertia": Fault(
        "the can is 1 mm thinner, and its inertia with it",
        "body/can/inertia",
        of_body("can", radius=0.0325),
    ),
    "pill_length": Fault(
        "the pill is 2 mm longer", "body/pill/rounds", of_body("pill", length=0.062)
    ),
    "wedge_corners": Fault(
        "the wedge is 2 mm longer",
        "body/wedge/meshes",
        of_body("wedge", vertices=scenes.wedge(length=0.102)),
    ),
    "wedge_inertia": Fault(
        "the wedge is 2 mm wider, and its inertia with it",
        "body/wedge/inertia",
        of_body("wedge", vertices=scenes.wedge(width=0.052)),
    ),
    "wedge_is_a_box": Fault(
        "the wedge is the box around it",
        "body/wedge/meshes",
        lambda scene, _: scene.with_body(
            Box("wedge", scene.body("wedge").extents, LEANING, 0.15, 0.7)
        ),
    ),
    "restitution": Fault(
        "the ball bounces less", "body/ball/restitution", of_body("ball", restitution=0.55)
    ),
    "ground_restitution": Fault(
        "the ground bounces less", "ground/restitution", of_scene(ground_restitution=0.55)
    ),
    "body_damping": Fault(
        "the ball turns on undamped", "body/ball/damping", of_body("ball", angular_damping=0.0)
    ),
    "round_kind": Fault(
        "the pillar is a capsule as long as it",
        "body/pillar/rounds",
        lambda scene, _: scene.with_body(
            Capsule("pillar", 0.04, 0.12, scene.body("pillar").pose, friction=0.7)
        ),
    ),
    "body_inertia": Fault(
        "the brick is 2 mm thinner, and its inertia with it",
        "body/brick/inertia",
        of_body("brick", size=(0.1, 0.058, 0.03)),
    ),
    "linear_velocity": Fault(
        "the brick starts 1 cm/s faster",
        "body/brick/velocity",
        of_body("brick", linear_velocity=(0.2, -0.1, 0.31)),
    ),
    "angular_velocity": Fault(
        "the brick's spin is in its own frame",
        "body/brick/velocity",
        of_body("brick", angular_velocity=tuple(TURNED.rotation().T @ SPIN)),
    ),
    "body_pose": Fault(
        "the cube is 1 mm aside",
        "body/cube/pose",
        of_body("cube", pose=Pose.at(0.601, -0.1, 0.325, yaw=-1.0)),
    ),
    "body_friction": Fault(
        "the brick's friction is 0.5", "body/brick/friction", of_body("brick", friction=0.5)
    ),
    "fixed_body": Fault(
        "the cube is fixed in the world", "body/cube/dynamic", of_body("cube", mass=0.0)
    ),
    "driven_body": Fault(
        "the belt is a free body", "body/belt/dynamic", of_body("belt", prescribed=False, mass=0.4)
    ),
    "gravity": Fault(
        "gravity is 1 % stronger", "gravity", of_scene(gravity=(0.303, -0.202, -3.737))
    ),
    "ground_friction": Fault(
        "the ground's friction is 0.5", "ground/friction", of_scene(ground_friction=0.5)
    ),
}
"""By short names."""


def rounds() -> list[dict[str, Fault]]:
    """`FAULTS` in as few worlds as there are faults of one quantity: worlds may be dear to build.

    No two of a round concern one quantity, so each must be seen beside the others.
    """
    found: list[dict[str, Fault]] = []
    for name, fault in FAULTS.items():
        for group in found:
            if fault.quantity not in {other.quantity for other in group.values()}:
                group[name] = fault
                break
        else:
            found.append({name: fault})
    return found
