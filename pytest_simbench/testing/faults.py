"""Worlds with one planted fault each: what the parity check must see.

An adapter is given the faulty scene to build, and what it reads back is held against the true one.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.scene import (
    Box,
    Capsule,
    ConvexMesh,
    Cylinder,
    Pose,
    Scene,
    Sphere,
)
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.mesh_check import TRIANGLE
from pytest_simbench.simulator.shapes import mesh_points
from pytest_simbench.testing import scenes
from pytest_simbench.testing.robot_faults import (
    Edit,
    Fault,
    Plant,
    edited,
    faults_about,
    of_robot,
    shift,
)

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


def _set(**values: str) -> Edit:
    return lambda element, _: element.attrib.update(values)


def _scaled(mesh: ET.Element, folder: Path) -> None:
    """A mesh 1.3 times as large, as an STL file of its own beside the description."""
    points = 1.3 * mesh_points(str(folder / mesh.attrib["filename"]))
    corners = np.resize(points, (3 * math.ceil(len(points) / 3), 3)).reshape(-1, 3, 3)
    record = np.zeros(len(corners), TRIANGLE)
    record["corners"] = corners
    path = folder / "scaled.stl"
    path.write_bytes(bytes(80) + len(corners).to_bytes(4, "little") + record.tobytes())
    mesh.attrib["filename"] = path.name


def _turned_inertia(inertia: ET.Element, _: Path) -> None:
    """Turned by 90 degrees about z: x becomes y, y becomes minus x."""
    old = dict(inertia.attrib)
    negative = str(-float(old["ixy"]))
    turned = str(-float(old["iyz"]))
    inertia.attrib.update(ixx=old["iyy"], iyy=old["ixx"], ixy=negative, ixz=turned, iyz=old["ixz"])


_LINK4, _TIP = "link[@name='panda_link4']", "link[@name='panda_leftfinger']/collision[4]"
_THINNER = (0.1, 0.058, 0.03)


def _described(what: str, quantity: str, path: str, edit: Edit) -> Fault:
    """An element of the URDF, edited."""
    return Fault(what, quantity, edited(path, edit))


def _built(what: str, quantity: str, **values: Any) -> Fault:
    """A body with other values; the quantity is `NAME/QUANTITY`."""
    return Fault(what, f"body/{quantity}", of_body(quantity.partition("/")[0], **values))


FAULTS: dict[str, Fault] = {
    **faults_about(
        "panda_link1",
        "panda_joint4",
        "panda_link4",
        ("panda_finger_joint1", "panda_finger_joint2"),
    ),
    "finger_shape": _described(
        "the rubber tip of a finger is 3 mm thinner",
        "link/panda_leftfinger/boxes",
        f"{_TIP}/geometry/box",
        _set(size="17.5e-3 12.2e-3 18.5e-3"),
    ),
    "finger_pad": _described(
        "the rubber tip of a finger is 2 mm nearer to the hand",
        "link/panda_leftfinger/boxes",
        _TIP,
        shift(z=-0.002),
    ),
    "mesh_scale": _described(
        "the mesh of link 4 is 1.3 times as large",
        "link/panda_link4/meshes",
        f"{_LINK4}/collision/geometry/mesh",
        _scaled,
    ),
    "inertia_turned": _described(
        "the inertia of link 4 is turned by 90 degrees",
        "link/panda_link4/inertia",
        f"{_LINK4}/inertial/inertia",
        _turned_inertia,
    ),
    "self_collide": Fault(
        "the robot's links collide with each other",
        "link/panda_link4/touches",
        of_robot(lambda robot: replace(robot, self_collide=True)),
        Capability.SELF_COLLIDE,
    ),
    "body_mass": _built("the brick weighs 1 kg", "brick/mass", mass=1.0),
    "body_size": _built("the brick is 2 mm thinner", "brick/boxes", size=_THINNER),
    "ball_size": _built("the ball is 1 mm smaller", "ball/rounds", radius=0.0295),
    "can_length": _built("the can is 2 mm shorter", "can/rounds", length=0.108),
    "can_inertia": _built(
        "the can is 1 mm thinner, and its inertia with it", "can/inertia", radius=0.0325
    ),
    "pill_length": _built("the pill is 2 mm longer", "pill/rounds", length=0.062),
    "wedge_corners": _built(
        "the wedge is 2 mm longer", "wedge/meshes", vertices=scenes.wedge(length=0.102)
    ),
    "wedge_inertia": _built(
        "the wedge is 2 mm wider, and its inertia with it",
        "wedge/inertia",
        vertices=scenes.wedge(width=0.052),
    ),
    "wedge_is_a_box": Fault(
        "the wedge is the box around it",
        "body/wedge/meshes",
        lambda scene, _: scene.with_body(
            Box("wedge", scene.body("wedge").extents, LEANING, 0.15, 0.7)
        ),
    ),
    "restitution": _built("the ball bounces less", "ball/restitution", restitution=0.55),
    "ground_restitution": Fault(
        "the ground bounces less", "ground/restitution", of_scene(ground_restitution=0.55)
    ),
    "body_damping": _built("the ball turns on undamped", "ball/damping", angular_damping=0.0),
    "round_kind": Fault(
        "the pillar is a capsule as long as it",
        "body/pillar/rounds",
        lambda scene, _: scene.with_body(
            Capsule("pillar", 0.04, 0.12, scene.body("pillar").pose, friction=0.7)
        ),
    ),
    "body_inertia": _built(
        "the brick is 2 mm thinner, and its inertia with it", "brick/inertia", size=_THINNER
    ),
    "linear_velocity": _built(
        "the brick starts 1 cm/s faster", "brick/velocity", linear_velocity=(0.2, -0.1, 0.31)
    ),
    "angular_velocity": _built(
        "the brick's spin is in its own frame",
        "brick/velocity",
        angular_velocity=tuple(TURNED.rotation().T @ SPIN),
    ),
    "body_pose": _built(
        "the cube is 1 mm aside", "cube/pose", pose=Pose.at(0.601, -0.1, 0.325, yaw=-1.0)
    ),
    "body_friction": _built("the brick's friction is 0.5", "brick/friction", friction=0.5),
    "fixed_body": _built("the cube is fixed in the world", "cube/dynamic", mass=0.0),
    "driven_body": _built("the belt is a free body", "belt/dynamic", prescribed=False, mass=0.4),
    "gravity": Fault(
        "gravity is 1 % stronger", "gravity", of_scene(gravity=(0.303, -0.202, -3.737))
    ),
    "ground_friction": Fault(
        "the ground's friction is 0.5", "ground/friction", of_scene(ground_friction=0.5)
    ),
}
"""By short names."""


def rounds(capabilities: Collection[Capability]) -> list[dict[str, Fault]]:
    """`FAULTS` of an engine in as few worlds as there are of one quantity: worlds may be dear to
    build.

    No two of a round concern one quantity, so each must be seen beside the others.
    """
    found: list[dict[str, Fault]] = []
    possible = (item for item in FAULTS.items() if item[1].needs in (None, *capabilities))
    for name, fault in possible:
        for group in found:
            if fault.quantity not in {other.quantity for other in group.values()}:
                group[name] = fault
                break
        else:
            found.append({name: fault})
    return found
