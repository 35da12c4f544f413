"""Links of the reduced robot: where they stand (forward kinematics of its description), what closes
loops of them, which of them collide with each other; and whether a robot's files fit its drives and
its scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pytest_simbench.description.urdf import ROOT, MovingJoint, PreparedRobot
from pytest_simbench.description.urdf_check import read_xml
from pytest_simbench.ground.errors import DescriptionError
from pytest_simbench.scene import Closure, FloatArray, Pose, Robot, Scene, SceneError, Vector3
from pytest_simbench.scene.pose import vector3


def link_poses(
    prepared: PreparedRobot, positions: Mapping[str, float] | FloatArray | None = None
) -> dict[str, Pose]:
    """Pose in the world of every link's frame, by name.

    Args:
        positions: of the joints [rad or m], by name or (n_joints,); None for the initial ones.
    """
    if positions is None:
        positions = prepared.robot.column("initial_position")
    if not isinstance(positions, Mapping):
        positions = dict(zip(prepared.robot.joint_names, positions.tolist(), strict=True))
    poses = {prepared.root: Pose()}
    for joint in prepared.joints:  # parents first
        moved = joint_motion(joint.kind, joint.axis, positions[joint.name])
        poses[joint.child] = poses[joint.parent] * joint.origin * moved
    return poses


def motion_subspace(joint: MovingJoint) -> FloatArray:
    """Velocity of the joint's child at unit joint speed, (6,), in the child's own frame.

    Angular velocity first [rad/s], then the linear velocity of the frame's origin [m/s]
    (Featherstone, Rigid Body Dynamics Algorithms, section 3.5).
    """
    return subspace(_unit(joint.axis), slides=joint.kind != "revolute")


def subspace(direction: FloatArray, point: FloatArray | None = None, *, slides: bool) -> FloatArray:
    """The same of a joint along or about a unit vector, (6,); a hinge is at a point [m], None: at
    the frame's origin."""
    if slides:
        return np.concatenate([np.zeros(3), direction])
    linear = np.zeros(3) if point is None else np.cross(point, direction)
    return np.concatenate([direction, linear])


def _unit(axis: Vector3) -> FloatArray:
    return np.asarray(np.array(axis) / np.linalg.norm(axis))


def joint_motion(kind: str, axis: Vector3, position: float) -> Pose:
    """Of a joint's child, from where it is at position 0, at a position [rad or m]."""
    x, y, z = vector3(_unit(axis))
    if kind == "prismatic":
        return Pose((x * position, y * position, z * position))
    s = float(np.sin(position / 2))
    return Pose(quaternion=(float(np.cos(position / 2)), x * s, y * s, z * s))


OPEN = 1e-6
"""How far the points of a closure may be apart at the joints' initial positions [m]: rounding."""


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
    for name, point in closure.sides:
        if name not in prepared.places:
            raise DescriptionError(
                f"a closure of {robot.name} holds link {name!r}, which is none of {robot.urdf}; "
                f"choose from {', '.join(prepared.places)}"
            )
        link, pose = prepared.places[name]
        names.append(link)
        points.append(vector3(pose.rotation() @ np.asarray(point) + pose.position))
    if names[0] == names[1]:
        raise DescriptionError(
            f"a closure of {robot.name} holds {closure.first!r} at {closure.second!r}, and no "
            "joint between them moves"
        )
    found = Closure(names[0], names[1], points[0], points[1], closure.rigid)
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
    poses = link_poses(prepared, positions)
    first, second = (
        np.asarray(poses[link].rotation() @ np.asarray(point) + poses[link].position)
        for link, point in closure.sides
    )
    return first, second


def opening(prepared: PreparedRobot, positions: FloatArray) -> float:
    """How far both points of a closure are apart at most, with the joints there [m]."""
    pairs = (ends(prepared, closure, positions) for closure in reduced(prepared))
    return max((float(np.linalg.norm(first - second)) for first, second in pairs), default=0.0)


def frames(prepared: PreparedRobot, closure: Closure) -> tuple[Pose, Pose]:
    """A frame in each link of a reduced closure, at its points: they are one frame of the world
    where the joints start, and stay one where the closure is rigid."""
    poses = link_poses(prepared)
    turn = (poses[closure.second].inverse() * poses[closure.first]).quaternion
    return Pose(closure.first_point), Pose(closure.second_point, turn)


def borne(
    prepared: PreparedRobot, gravity: Sequence[float], felt: float = 1.0
) -> dict[str, FloatArray]:
    """What makes links feel their share of gravity, where it is not the whole: forces at their
    centres of mass by name, in the world, (3,) each [N].

    Args:
        gravity: of the scene [m/s^2].
        felt: share that the engine lets these links feel.
    """
    return {
        name: (share - felt) * prepared.links[name].mass * np.asarray(gravity)
        for name, share in prepared.gravity.items()
        if share != 1
    }


def joined(prepared: PreparedRobot) -> frozenset[frozenset[str]]:
    """Pairs of links that one joint joins: they never collide with each other."""
    return frozenset(frozenset((joint.parent, joint.child)) for joint in prepared.joints)


def links_collide(prepared: PreparedRobot, first: str, second: str) -> bool:
    """Whether two links of the reduced robot are to collide with each other."""
    return prepared.robot.self_collide and {first, second} not in joined(prepared)


def check_apart(scene: Scene, prepared: PreparedRobot | None) -> None:
    """Raise `SceneError` for a pair kept apart that names no link of the reduced robot."""
    links = () if prepared is None else prepared.links
    for name in sorted({name for pair in scene.apart for name in pair}):
        if name.startswith("link/") and name.removeprefix("link/") not in links:
            raise SceneError(
                f"scene {scene.name!r}: {name!r} is kept apart, and the robot has no such link; "
                f"choose from {', '.join(links)}"
            )


def check_robot(robot: Robot) -> None:
    """Check all files of a robot, and that they fit its drives.

    Raises:
        DescriptionError: what is wrong, where, and what to do.
    """
    reduced(PreparedRobot(robot))
    if not robot.srdf:
        return
    srdf = read_xml(robot.srdf, "the list of link pairs")
    if srdf.tag != "robot":
        raise DescriptionError(f"{robot.srdf} is no SRDF: it holds <{srdf.tag}>, not <robot>")


def check_names(scene: Scene) -> None:
    """Raise `SceneError` for a body that has the name of one of the robot's links.

    Engines keep both under their names, in one list.
    """
    if scene.robot is None:
        return
    xml = read_xml(scene.robot.urdf, "the robot description")
    links = {ROOT, *(link.get("name") for link in xml.findall("link"))}
    for body in scene.bodies:
        if body.name in links:
            raise SceneError(
                f"scene {scene.name!r}: a body is named {body.name!r}, as a link of the robot "
                f"{scene.robot.name!r} is; give it another name"
            )
