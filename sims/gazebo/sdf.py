"""The scene as an SDF world.

Every link stands where it does at the robot's initial position, and that is the zero of every
joint: Gazebo's reset puts joints to zero. So the limits are moved, and `drives` adds the offset.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from pytest_simbench.description.links import link_poses
from pytest_simbench.description.shapes import write_obj
from pytest_simbench.description.urdf import MovingJoint, Shape
from pytest_simbench.scene import (
    Body,
    Box,
    Capsule,
    ConvexMesh,
    Cylinder,
    FloatArray,
    Pose,
    Scene,
    Sphere,
)
from pytest_simbench.simulator import NotSupportedError, PreparedRobot

from .settings import GazeboSettings
from .window import add_drawing

VERSION = "1.11"
"""Of SDF; gz-sim 8 reads none newer."""

FEATHERSTONE = "bullet-featherstone"


@dataclass(frozen=True)
class Physics:
    """What a world says of its engine.

    Attributes:
        lone: whether the world is one free body on the ground and nothing else.
    """

    settings: GazeboSettings
    lone: bool = False

    @property
    def engine(self) -> str:
        return self.settings.engine

    @property
    def coupled(self) -> bool:
        """Whether it has `<mimic>`."""
        return self.engine == FEATHERSTONE

    @property
    def turns_torques(self) -> bool:
        """Whether it takes a torque on a body in the body's axes, not in the world's as it should
        (seen with 8.14.0: a turned cube under a torque about x turned about another axis)."""
        return self.engine == FEATHERSTONE

    def effort(self, limit: float) -> float:
        """What to write so that a drive has this limit.

        bullet-featherstone makes the motor, and computes its largest impulse, before the world has
        told it the step: it takes one of 1 ms (`JointFeatures.cc`, `maxEffort * world->stepSize`).
        """
        return limit * self.settings.timestep / 1e-3 if self.engine == FEATHERSTONE else limit

    def effort_of(self, written: float) -> float:
        """The limit for which `effort` wrote this."""
        return written * 1e-3 / self.settings.timestep if self.engine == FEATHERSTONE else written

    def friction(self, coefficient: float, ground: bool = False) -> float:
        """What to write so that a pair of such surfaces has this coefficient.

        bullet-featherstone counts each surface's friction twice, and Bullet multiplies those of a
        pair: the fourth root. The second count is along the body's own x and y only
        (`SDFFeatures.cc`, `setAnisotropicFriction(mu, mu2, 1)`), so only 1 is the same along all
        axes. A lone body has 1, and the ground, whose z axis is always the contact's normal, the
        square root. dartsim takes the smaller one.
        """
        if self.engine != FEATHERSTONE:
            return coefficient
        if self.lone:
            return math.sqrt(coefficient) if ground else 1.0
        return coefficient**0.25

    def friction_of(self, written: float, other: float) -> float:
        """The coefficient of a pair of surfaces for which these were written."""
        return (written * other) ** 2 if self.engine == FEATHERSTONE else min(written, other)

    @property
    def friction_names(self) -> tuple[str, str]:
        """Elements of <friction> that the engine reads."""
        if self.engine == FEATHERSTONE:
            return "bullet/friction", "bullet/friction2"
        return "ode/mu", "ode/mu2"


def world_text(
    scene: Scene,
    prepared: PreparedRobot | None,
    physics: Physics,
    name: str,
    folder: Path,
    drawn: bool = False,
) -> str:
    """The world as SDF text, called `name`; `drawn` if it has a window. Meshes of bodies go into
    files in the folder, which must stay as long as the world."""
    root = ET.Element("sdf", version=VERSION)
    world = ET.SubElement(root, "world", name=name)
    _add_physics(world, physics)
    _text(world, "gravity", _spaced(scene.gravity))
    _add_ground(world, scene, physics)
    for body in scene.bodies:
        _add_body(world, body, physics, folder)
    if prepared is not None:
        _add_robot(world, scene, prepared, physics)
    if drawn:
        add_drawing(world, scene)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode")


def is_lone(scene: Scene) -> bool:
    """Whether a world is one free body on the ground, of one friction, and nothing else."""
    if scene.robot is not None or len(scene.bodies) != 1:
        return False
    (body,) = scene.bodies
    return body.mass > 0 and body.friction == scene.ground_friction


def robot_model(scene: Scene) -> str:
    """Name of the robot's model: no body of the scene has it."""
    names, name = {body.name for body in scene.bodies}, "robot"
    while name in names:
        name += "_"
    return name


def _add_physics(world: ET.Element, physics: Physics) -> None:
    element = ET.SubElement(world, "physics", name="physics", type="ignored")
    _text(element, "max_step_size", repr(physics.settings.timestep))
    _text(element, "real_time_factor", "0")  # do not wait for the clock
    dart = ET.SubElement(element, "dart")
    _text(dart, "collision_detector", physics.settings.detector)
    _text(ET.SubElement(dart, "solver"), "solver_type", physics.settings.solver)
    system = ET.SubElement(
        world, "plugin", filename="gz-sim-physics-system", name="gz::sim::systems::Physics"
    )
    _text(ET.SubElement(system, "engine"), "filename", f"gz-physics-{physics.engine}-plugin")


def _add_ground(world: ET.Element, scene: Scene, physics: Physics) -> None:
    link = _add_static(world, "ground", Pose())
    collision = ET.SubElement(link, "collision", name="0")
    _text(ET.SubElement(ET.SubElement(collision, "geometry"), "plane"), "normal", "0 0 1")
    mu = physics.friction(scene.ground_friction, ground=True)
    _add_surface(collision, mu, physics, scene.ground_restitution)


def _add_body(world: ET.Element, body: Body, physics: Physics, folder: Path) -> None:
    if not body.mass:  # fixed, or prescribed, which Gazebo has not
        link = _add_static(world, body.name, body.pose)
    else:
        model = ET.SubElement(world, "model", name=body.name)
        _add_pose(model, body.pose)
        link = ET.SubElement(model, "link", name="link")
        i, j, k = body.inertia()
        _add_inertial(link, body.mass, Pose(), [i, 0.0, 0.0, j, 0.0, k])
    collision = ET.SubElement(link, "collision", name="0")
    _add_solid(ET.SubElement(collision, "geometry"), body, folder)
    _add_surface(collision, physics.friction(body.friction), physics, body.restitution)


def _add_solid(geometry: ET.Element, body: Body, folder: Path) -> None:
    """The shape of a body; those of SDF are along z."""
    match body:
        case Box():
            _text(ET.SubElement(geometry, "box"), "size", _spaced(body.size))
        case Sphere():
            _text(ET.SubElement(geometry, "sphere"), "radius", repr(float(body.radius)))
        case Cylinder() | Capsule():
            element = ET.SubElement(geometry, type(body).__name__.lower())
            _text(element, "radius", repr(float(body.radius)))
            _text(element, "length", repr(float(body.length)))
        case ConvexMesh():
            element = ET.SubElement(geometry, "mesh", optimization="convex_hull")
            number = sum(1 for _ in folder.iterdir())  # names may hold what paths may not
            _text(element, "uri", str(write_obj(folder / f"mesh_{number}.obj", body.hull)))
        case _:
            raise NotSupportedError(f"gazebo has no {type(body).__name__}")


def _add_static(world: ET.Element, name: str, pose: Pose) -> ET.Element:
    model = ET.SubElement(world, "model", name=name)
    _add_pose(model, pose)
    _text(model, "static", "true")
    return ET.SubElement(model, "link", name="link")


def _add_robot(world: ET.Element, scene: Scene, prepared: PreparedRobot, physics: Physics) -> None:
    robot = prepared.robot
    model = ET.SubElement(world, "model", name=robot_model(scene))
    _text(model, "self_collide", "false")
    fixed = ET.SubElement(model, "joint", name="fixed_in_the_world", type="fixed")
    _text(fixed, "parent", "world")
    _text(fixed, "child", prepared.root)
    poses = link_poses(prepared, {joint.name: joint.initial_position for joint in robot.joints})
    for link in prepared.links.values():
        element = ET.SubElement(model, "link", name=link.name)
        _add_pose(element, poses[link.name])
        if link.mass > 0:
            x, y, z = (float(value) for value in link.centre)
            tensor = link.inertia[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
            _add_inertial(element, link.mass, Pose.at(x, y, z), tensor)
        _add_shapes(element, link.shapes, robot.friction, physics)
    couplings = {pair.follower: pair.leader for pair in robot.gripper.couplings}
    for joint in prepared.joints:
        _add_joint(model, joint, prepared, physics, couplings.get(joint.name))


def _add_joint(
    model: ET.Element,
    joint: MovingJoint,
    prepared: PreparedRobot,
    physics: Physics,
    leader: str | None,
) -> None:
    drive = prepared.robot.joints[prepared.robot.joint_names.index(joint.name)]
    element = ET.SubElement(model, "joint", name=joint.name, type=joint.kind)
    _text(element, "parent", joint.parent)
    _text(element, "child", joint.child)
    axis = ET.SubElement(element, "axis")
    _text(axis, "xyz", _spaced(joint.axis))
    limit = ET.SubElement(axis, "limit")
    lower, upper = prepared.limits[joint.name] - drive.initial_position
    _text(limit, "lower", repr(float(lower)))
    _text(limit, "upper", repr(float(upper)))
    effort = drive.effort_limit
    if leader is not None and physics.coupled:
        mimic = ET.SubElement(axis, "mimic", joint=leader)
        _text(mimic, "multiplier", "1")
        _text(mimic, "offset", "0")
        _text(mimic, "reference", "0")
    elif leader is not None:
        effort *= 2  # it has to hold against the first finger's drive and against its own load
    _text(limit, "effort", repr(physics.effort(effort)))


def _add_shapes(
    link: ET.Element, shapes: Iterable[Shape], friction: float, physics: Physics
) -> None:
    for number, shape in enumerate(shapes):
        element = ET.SubElement(link, "collision", name=str(number))
        _add_pose(element, shape.pose)
        geometry = ET.SubElement(element, "geometry")
        if shape.size is not None:
            _text(ET.SubElement(geometry, "box"), "size", _spaced(shape.size))
        else:
            _text(ET.SubElement(geometry, "mesh"), "uri", shape.mesh or "")
        _add_surface(element, physics.friction(friction), physics)


def _add_surface(
    collision: ET.Element, mu: float, physics: Physics, restitution: float = 0.0
) -> None:
    """Friction, as `Physics.friction` gives it, and restitution: of a pair both engines take the
    product of the restitutions."""
    surface = ET.SubElement(collision, "surface")
    bounce = ET.SubElement(surface, "bounce")
    _text(bounce, "restitution_coefficient", repr(math.sqrt(restitution)))
    element = ET.SubElement(surface, "friction")
    own = ET.SubElement(element, physics.friction_names[0].partition("/")[0])
    for name in physics.friction_names:
        _text(own, name.partition("/")[2], repr(mu))
    if physics.engine == FEATHERSTONE:  # dartsim only warns that it has none
        torsional = ET.SubElement(element, "torsional")
        _text(torsional, "coefficient", repr(physics.settings.torsional_friction))


def _add_inertial(link: ET.Element, mass: float, pose: Pose, tensor: Iterable[float]) -> None:
    element = ET.SubElement(link, "inertial")
    _add_pose(element, pose)
    _text(element, "mass", repr(float(mass)))
    inertia = ET.SubElement(element, "inertia")
    for name, value in zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), tensor, strict=True):
        _text(inertia, name, repr(float(value)))


def _add_pose(element: ET.Element, pose: Pose) -> None:
    w, x, y, z = pose.quaternion
    found = ET.SubElement(element, "pose", rotation_format="quat_xyzw")
    found.text = _spaced([*pose.position, x, y, z, w])


def _text(parent: ET.Element, tag: str, text: str) -> None:
    ET.SubElement(parent, tag).text = text


def _spaced(values: Iterable[float] | FloatArray) -> str:
    return " ".join(repr(float(value)) for value in values)
