"""Loops of links: the closures of a robot, as its reduced description has them."""

from __future__ import annotations

import numpy as np

from pytest_simbench.scene import Closure, FloatArray, Scene, Vector3
from pytest_simbench.simulator.errors import DescriptionError, NotSupportedError
from pytest_simbench.simulator.info import Capability, SimulatorInfo
from pytest_simbench.simulator.kinematics import link_poses
from pytest_simbench.simulator.urdf import PreparedRobot

OPEN = 1e-6
"""How far the points of a closure may be apart at the joints' initial positions [m]: rounding."""


def check_loops(info: SimulatorInfo, scene: Scene) -> None:
    """Raise `NotSupportedError` for a scene with loops on a simulator that closes none."""
    if "loop" in scene.words and Capability.LOOPS not in info.capabilities:
        raise NotSupportedError(
            f"{info.name} closes no loops of links, and the robot of scene {scene.name!r} has one"
        )


def reduced(prepared: PreparedRobot) -> tuple[Closure, ...]:
    """The closures between links of the reduced robot, points in their frames.

    Raises:
        DescriptionError: a closure names a link that is not there, holds a link at itself, or is
            open at the joints' initial positions.
    """
    return tuple(_reduced(prepared, closure) for closure in prepared.robot.closures)


def _reduced(prepared: PreparedRobot, closure: Closure) -> Closure:
    robot = prepared.robot
    names, points = [], []
    for name, point in (
        (closure.first, closure.first_point),
        (closure.second, closure.second_point),
    ):
        if name not in prepared.places:
            raise DescriptionError(
                f"a closure of {robot.name} holds link {name!r}, which is none of {robot.urdf}; "
                f"choose from {', '.join(prepared.places)}"
            )
        link, pose = prepared.places[name]
        names.append(link)
        points.append(_vector(pose.rotation() @ np.asarray(point) + pose.position))
    if names[0] == names[1]:
        raise DescriptionError(
            f"a closure of {robot.name} holds {closure.first!r} at {closure.second!r}, and no "
            "joint between them moves"
        )
    found = Closure(names[0], names[1], points[0], points[1])
    first, second = ends(prepared, found)
    if (apart := float(np.linalg.norm(first - second))) > OPEN:
        raise DescriptionError(
            f"the closure of {closure.first!r} and {closure.second!r} of {robot.name} is open by "
            f"{1000 * apart:.3g} mm at the joints' initial positions; close it there"
        )
    return found


def ends(
    prepared: PreparedRobot, closure: Closure, positions: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Where both points of a reduced closure are in the world, (3,) each [m].

    Args:
        prepared: whose links are held.
        closure: one of `reduced`.
        positions: of the joints, (n_joints,); None for the initial ones.
    """
    robot = prepared.robot
    if positions is None:
        positions = robot.column("initial_position")
    poses = link_poses(prepared, dict(zip(robot.joint_names, positions, strict=True)))
    first, second = (
        np.asarray(poses[link].rotation() @ np.asarray(point) + poses[link].position)
        for link, point in (
            (closure.first, closure.first_point),
            (closure.second, closure.second_point),
        )
    )
    return first, second


def _vector(values: FloatArray) -> Vector3:
    x, y, z = (float(value) for value in values)
    return (x, y, z)
