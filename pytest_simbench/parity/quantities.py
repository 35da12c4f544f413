"""The quantities of a scene: what every engine is asked for, by name, and what it must answer.

    gravity, timestep, gripper/coupled
    ground/{height, friction, restitution}
    body/NAME/{pose, boxes, rounds, meshes, friction, restitution, margin, dynamic, touches}
        and of a body with a mass {mass, com, inertia, damping, gravity, velocity}
    link/NAME/{pose, boxes, rounds, meshes, friction, restitution, margin, touches}
        and of a link that moves {mass, com, inertia, damping, gravity}
    joint/NAME/{axis, limits, effort_limit, stiffness, damping, friction, armature,
        initial_position} and of one with a spring rest
    closure/NUMBER/{points, rigid}, coupling/FOLLOWER

Links are those of the prepared robot (`description.urdf`), in which fixed joints are merged; its
base is the link `base`, whose frame is the world's.

- pose: position and quaternion w, x, y, z of the body's or link's frame in the world, (7,).
- boxes, rounds, meshes: the reach of each collision shape of that kind (rounds are spheres,
  cylinders and capsules) in the 26 directions of
  `shapes.DIRECTIONS`, in the body's or link's frame, (n_shapes, 26) [m]; a mesh counts as its
  convex hull.
- com: centre of mass in that frame (3,) [m]; inertia: tensor about it in axes of that frame,
  (3, 3) [kg m^2].
- friction: Coulomb's coefficient; restitution: Newton's, 0 of links; margin: the distance from its
  shape at which it rests on others, 0 [m].
- damping of a body or link: resistance to its linear and angular motion, (2,) [1/s], 0 of links.
  A body's own replaces that of the settings.
- gravity of a body or link: the share of the scene's gravity that it feels; of a body 1.
- dynamic: 1 if forces can move the body, else 0; a prescribed one is moved by none.
- velocity: of the centre of mass, then angular, in the world frame, (6,) [m/s, rad/s].
- touches: the shares of ground, bodies and links that it can collide with, (3,). Links collide
  with links where the robot has `self_collide`, but for those that one joint joins; what
  the scene keeps `apart` does not; what can never meet (fixed things) is left out of count; 0 where
  nothing is left.
- axis: velocity of the joint's child link at unit joint speed, angular before linear, in that
  link's frame, (6,).
- stiffness and damping of a joint: of its drive and all else that pulls in proportion to position
  and velocity; friction: what resists its motion beside that [N m, N]. A joint's own friction
  replaces that of the settings.
- rest: position at which the joint's own spring is without load [rad, m].
- points: of a closure of the robot, by its number from 0 on: those that are held together, each in
  its link's frame, (2, 3) [m]; rigid: 1 for a weld, 0 for a ball and its socket.
- coupled: 1 if the fingers are. coupling: ratio and offset of a joint to its leader, (2,).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from pytest_simbench.description.links import link_poses, links_collide, motion_subspace, reduced
from pytest_simbench.description.shapes import DIRECTIONS, outlines, reach, shape_points
from pytest_simbench.description.urdf import FIXED_ROOT, ROOT, PreparedRobot
from pytest_simbench.scene import Body, Box, ConvexMesh, FloatArray, Robot, Scene
from pytest_simbench.simulator.settings import Settings

MOVING = ("pose", "velocity", "initial_position")
"""Kinds of quantities that change while a world is stepped."""


def expected_quantities(scene: Scene, settings: Settings) -> dict[str, Any]:
    """Every quantity that an engine should report of a scene."""
    prepared = None if scene.robot is None else PreparedRobot(scene.robot)
    quantities: dict[str, Any] = {
        "gravity": scene.gravity,
        "timestep": settings.timestep,
        "ground/height": 0.0,
        "ground/friction": scene.ground_friction,
        "ground/restitution": scene.ground_restitution,
    }
    for body in scene.bodies:
        quantities |= named(
            f"body/{body.name}",
            pose=body.pose.as_array(),
            friction=body.friction,
            restitution=body.restitution,
            margin=0.0,
            dynamic=float(body.mass > 0),
        )
        shapes = ((kind_of(part), part.reach_placed(DIRECTIONS)) for part in body.parts)
        quantities |= named(f"body/{body.name}", **outlines(shapes))
        if body.mass:
            inertia = np.diag(body.inertia())
            quantities |= _inertial(f"body/{body.name}", body.mass, np.zeros(3), inertia)
            quantities[f"body/{body.name}/velocity"] = body.velocity
            quantities[f"body/{body.name}/damping"] = body.damping
    if prepared is not None:
        quantities |= _robot_quantities(prepared.robot, prepared)
    quantities |= touches(scene, prepared, lambda a, b: _collide(scene, prepared, a, b))
    own = {f"body/{body.name}/damping" for body in scene.free_bodies if body.damping.any()}
    joints = () if scene.robot is None else scene.robot.joints
    own |= {f"joint/{joint.name}/friction" for joint in joints if joint.friction}
    motors = [joint.name for joint in joints if joint.motor]
    own |= {f"joint/{name}/{gain}" for name in motors for gain in ("stiffness", "damping")}
    for pattern, value in settings.quantities().items():
        meant = {name for name in quantities if fnmatchcase(name, pattern)}
        quantities |= dict.fromkeys(meant - own, value)
    for joint in () if prepared is None else prepared.robot.joints:  # beside what settings say
        quantities[f"joint/{joint.name}/stiffness"] += joint.spring
        quantities[f"joint/{joint.name}/damping"] += joint.passive_damping
    return quantities


def constants(names: Collection[str], scene: Scene) -> list[str]:
    """Those of the quantities that stay as they are while the world is stepped.

    Places and speeds change, but for the places of fixed bodies and of the robot's base.
    """
    base = f"link/{FIXED_ROOT}/pose"
    base = base if base in names else f"link/{ROOT}/pose"
    still = {base, *(f"body/{body.name}/pose" for body in scene.fixed_bodies)}
    return [n for n in names if n.rpartition("/")[2] not in MOVING or n in still]


def kind_of(shape: Body) -> str:
    """Which of `shapes.OUTLINES` a body of one shape is."""
    return {Box.kind: "boxes", ConvexMesh.kind: "meshes"}.get(shape.kind, "rounds")


def named(prefix: str, **values: Any) -> dict[str, Any]:
    """Quantities of a body, link or joint by their whole names."""
    return {f"{prefix}/{name}": value for name, value in values.items()}


def _inertial(prefix: str, mass: float, com: FloatArray, inertia: FloatArray) -> dict[str, Any]:
    return named(prefix, mass=mass, com=com, inertia=inertia, damping=np.zeros(2), gravity=1.0)


def _robot_quantities(robot: Robot, prepared: PreparedRobot) -> dict[str, Any]:
    quantities: dict[str, Any] = {"gripper/coupled": 1.0}
    axes = {joint.name: motion_subspace(joint) for joint in prepared.joints}
    for joint in robot.joints:
        quantities |= named(
            f"joint/{joint.name}",
            axis=axes[joint.name],
            limits=prepared.limits[joint.name],
            effort_limit=joint.effort_limit,
            stiffness=joint.stiffness,
            damping=joint.damping,
            friction=joint.friction,
            armature=joint.armature,
            initial_position=joint.initial_position,
        )
        if joint.spring:
            quantities[f"joint/{joint.name}/rest"] = joint.rest
    for k, closure in enumerate(reduced(prepared)):
        points = np.array([closure.first_point, closure.second_point])
        quantities |= named(f"closure/{k}", points=points, rigid=float(closure.rigid))
    for pair in robot.couplings:
        quantities[f"coupling/{pair.follower}"] = np.array([pair.ratio, pair.offset])
    poses = link_poses(prepared)
    for link in prepared.links.values():
        prefix = f"link/{link.name}"
        quantities[f"{prefix}/pose"] = poses[link.name].as_array()
        shapes = (
            ("boxes" if shape.size else "meshes", reach(shape_points(shape)))
            for shape in link.shapes
        )
        quantities |= named(prefix, **outlines(shapes))
        if link.shapes:
            quantities |= named(prefix, friction=robot.friction, restitution=0.0, margin=0.0)
        if link.name in prepared.gravity:
            quantities |= _inertial(prefix, link.mass, link.centre, link.inertia)
            quantities[f"{prefix}/gravity"] = prepared.gravity[link.name]
    return quantities


def touches(
    scene: Scene, prepared: PreparedRobot | None, can_touch: Callable[[str, str], Any]
) -> dict[str, Any]:
    """The quantities `body/NAME/touches` and `link/NAME/touches`.

    Args:
        can_touch: whether two of "ground", `body/NAME` and `link/NAME` can collide, as the engine
            (or, for what is expected, the scene) has it; only asked where one of them can move, and
            once of each pair.
    """
    links = _links(prepared)
    bodies = [f"body/{body.name}" for body in scene.bodies]
    still = {"ground", *(f"body/{body.name}" for body in scene.bodies if not body.mass)}
    if prepared is not None:
        still.add(f"link/{prepared.root}")

    answers: dict[frozenset[str], bool] = {}

    def touch(a: str, b: str) -> bool:
        pair = frozenset((a, b))
        if pair not in answers:
            answers[pair] = bool(can_touch(a, b))
        return answers[pair]

    def share(name: str, others: Iterable[str]) -> float:
        asked = [o for o in others if o != name and not (o in still and name in still)]
        return sum(touch(name, other) for other in asked) / len(asked) if asked else 0.0

    groups = (["ground"], bodies, links)
    return {
        f"{name}/touches": np.array([share(name, group) for group in groups])
        for name in [*bodies, *links]
    }


def _collide(scene: Scene, prepared: PreparedRobot | None, a: str, b: str) -> bool:
    """Whether two of "ground", `body/NAME` and `link/NAME` are to collide."""
    if scene.kept_apart(a, b):
        return False
    first, second = a.removeprefix("link/"), b.removeprefix("link/")
    if prepared is None or first == a or second == b:
        return True
    return links_collide(prepared, first, second)


def _links(prepared: PreparedRobot | None) -> list[str]:
    """The links that have shapes, as `link/NAME`."""
    if prepared is None:
        return []
    return [f"link/{link.name}" for link in prepared.links.values() if link.shapes]
