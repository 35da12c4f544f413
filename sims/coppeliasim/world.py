"""The scene as shapes and joints of CoppeliaSim.

A shape's frame is that of its mesh, whatever frame it was asked for in. So each part keeps the
scene's frame in it. Bodies are in a tree of their own each; the robot's links and joints are one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from ctypes import byref, c_double, c_longlong
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from pytest_simbench.description.links import link_poses
from pytest_simbench.description.mesh_check import read_stl
from pytest_simbench.description.urdf import Link, MovingJoint, Shape
from pytest_simbench.scene import Body, Box, Capsule, ConvexMesh, Cylinder, FloatArray, Pose, Sphere
from pytest_simbench.scene.pose import turn_of_z
from pytest_simbench.simulator import NotSupportedError, PreparedRobot

from .library import (
    ENGINES,
    SCENE,
    address,
    call,
    doubles,
    get_float,
    get_pose,
    get_vector,
    integers,
    set_bool,
    set_float,
    set_floats,
    set_int,
    set_pose,
    set_vector,
)
from .settings import CoppeliaSimSettings

CUBOID, SPHEROID, CYLINDER, CAPSULE = 3, 4, 5, 8
"""Kinds of primitive shapes (simConst.h)."""

REVOLUTE, PRISMATIC, DYNAMIC = 10, 11, 5
"""Kinds of joints, and the mode in which an engine moves them."""

EVERYTHING, OTHERS = 0xFFFF, 0xFF00
"""Masks of what a shape touches: all, and what is not of its own tree."""

SIGMOID = (0.5, 2.0)
"""Middle and power of MuJoCo's impedance, its own defaults."""

CONES = ("pyramidal", "elliptic")
"""Friction cones of MuJoCo, as the program numbers them."""

GROUND_SIZE = (20.0, 20.0, 1.0)
"""Edges of the block whose upper side is the ground [m]."""

CARRIER = 0.01
"""Edge of the block that stands for a link without shapes, and touches nothing [m]."""

TRIES, FILLERS = 5, 200
"""Shapes that may be made until one lies behind all others in memory, and small ones before each
but the first to fill the gaps. A new process has taken up to 2 and 24."""


@dataclass(frozen=True)
class Part:
    """The ground, a body or a link.

    Attributes:
        handle: of its shape.
        frame: the scene's, in the shape's.
        touches: whether it has shapes that touch anything.
    """

    handle: int
    frame: Pose
    touches: bool = True

    def pose(self) -> Pose:
        """Of the scene's frame, in the world."""
        return get_pose(self.handle) * self.frame

    def velocity(self) -> tuple[FloatArray, FloatArray]:
        """Of its centre of mass [m/s], and angular [rad/s], in the world, (3,) each."""
        linear, angular = doubles([0.0] * 3), doubles([0.0] * 3)
        call("simGetVelocity_D", self.handle, linear, angular)
        return np.array(linear), np.array(angular)

    def weight(self) -> tuple[float, FloatArray, FloatArray]:
        """Mass [kg], its centre (3,) [m] and the inertia about it (3, 3) [kg m^2], in the shape's
        frame."""
        mass, matrix, place = c_double(), doubles([0.0] * 9), doubles([0.0] * 12)
        call("simGetShapeMass_D", self.handle, byref(mass))
        call("simGetShapeInertia_D", self.handle, matrix, place)
        return mass.value, np.reshape(place, (3, 4))[:, 3], np.reshape(matrix, (3, 3))

    def centre(self) -> FloatArray:
        """Of mass, in the world [m], (3,)."""
        pose = get_pose(self.handle)
        return np.asarray(pose.rotation() @ self.weight()[1] + np.asarray(pose.position))

    def put(self, pose: Pose) -> None:
        set_pose(self.handle, pose * self.frame.inverse())


class Shapes:
    """Makes shapes whose addresses in memory ascend.

    Bullet 2.78, ODE and Newton are given bodies in the order of these addresses, and their results
    depend on the order: with shapes as they come, two processes would differ. MuJoCo's do not.
    """

    def __init__(self, engine: str) -> None:
        self._ordered = engine != "mujoco"
        self._last, self._rejected = 0, list[int]()

    def made(self, make: Callable[[], int]) -> int:
        """A shape's handle. Where memory is full of gaps, as in a process that had worlds before,
        all shapes from there on are as they come."""
        for _ in range(TRIES):
            handle = make()
            if not self._ordered or address(handle) > self._last:
                self._last = address(handle)
                return handle
            self._rejected.append(handle)
            self._fill()
        self._ordered = False
        return make()

    def _fill(self) -> None:
        """Fill gaps in memory, until a shape lies behind the last one."""
        for _ in range(FILLERS):
            self._rejected.append(_primitive(CUBOID, (CARRIER,) * 3))
            if address(self._rejected[-1]) > self._last:
                return

    def close(self) -> None:
        """Take off the scene what was made in vain."""
        if self._rejected:
            call("simRemoveObjects", integers(self._rejected), len(self._rejected))


@dataclass(frozen=True)
class Surface:
    """How an engine is told of surfaces."""

    settings: CoppeliaSimSettings

    @property
    def engine(self) -> str:
        return self.settings.engine

    @property
    def friction_name(self) -> str:
        """Property of a shape that is its friction."""
        return {
            "bullet": "bullet.frictionOld",
            "bullet283": "bullet.friction",
            "ode": "ode.friction",
        }[self.engine]

    def tell(self, handle: int, friction: float, restitution: float) -> None:
        """A pair's friction is the product of two, in MuJoCo the larger one."""
        root = float(np.sqrt(friction))
        if self.engine == "mujoco":
            set_floats(handle, "mujoco.friction", [friction, 0.0, 0.0])
            set_floats(handle, "mujoco.solref", self.settings.solref)
            set_floats(handle, "mujoco.solimp", [*self.settings.solimp, *SIGMOID])
            return
        if self.engine == "newton":
            set_float(handle, "newton.staticFriction", root)
            set_float(handle, "newton.kineticFriction", root)
            set_float(handle, "newton.restitution", restitution)
            return
        set_float(handle, self.friction_name, root)
        if self.engine != "ode":
            set_float(handle, "bullet.restitution", float(np.sqrt(restitution)))
            set_bool(handle, "bullet.stickyContact", self.settings.sticky)

    def damp(self, handle: int, damping: FloatArray) -> None:
        """Linear and angular damping c of dv/dt = -c v [1/s]; MuJoCo knows none of bodies."""
        if self.engine == "mujoco":
            return
        family, suffix, period = self._damping
        for kind, value in zip(("linear", "angular"), damping, strict=True):
            set_float(handle, f"{family}.{kind}{suffix}", float(1 - np.exp(-value * period)))

    def thrown(self, part: Part) -> tuple[FloatArray, FloatArray]:
        """Of a body before the first step: linear [m/s] and angular velocity [rad/s], (3,) each."""
        linear = get_vector(part.handle, "initLinearVelocity")
        angular = get_vector(part.handle, "initAngularVelocity")
        if self.engine == "mujoco":
            angular = get_pose(part.handle).rotation() @ angular
        return linear, angular

    def damping(self, handle: int) -> FloatArray:
        """As of `damp`."""
        family, suffix, period = self._damping
        lost = [get_float(handle, f"{family}.{kind}{suffix}") for kind in ("linear", "angular")]
        return np.asarray(-np.log1p(-np.asarray(lost)) / period)

    @property
    def _damping(self) -> tuple[str, str, float]:
        """Of the properties: their family, the end of their names, and the time [s] in which they
        say what is lost."""
        return {
            "ode": ("ode", "Damping", self.settings.timestep),
            "newton": ("newton", "Drag", 1.0),
        }.get(self.engine, ("bullet", "Damping", 1.0))


def set_engine(s: CoppeliaSimSettings, gravity: Sequence[float]) -> None:
    """Choose the engine, and what holds for the whole scene."""
    kind, _ = ENGINES[s.engine]
    pair = integers(kind)
    call("simSetIntArrayProperty", c_longlong(SCENE), b"dynamicsEngine", pair, len(pair))
    set_float(SCENE, "timeStep", s.timestep)
    set_float(SCENE, "dynamicsStepSize", s.timestep)
    set_vector(SCENE, "gravity", gravity)
    set_int(SCENE, "bullet.iterations", s.iterations)
    set_int(SCENE, "mujoco.cone", CONES.index(s.cone))
    set_floats(SCENE, "mujoco.kinematicWeldSolref", s.solref)
    set_floats(SCENE, "mujoco.kinematicWeldSolimp", [*s.solimp, *SIGMOID])


def add_ground(shapes: Shapes, surface: Surface, friction: float, restitution: float) -> Part:
    """A block whose upper side is the plane z = 0."""
    handle = shapes.made(lambda: _primitive(CUBOID, GROUND_SIZE))
    part = Part(handle, Pose.at(0.0, 0.0, GROUND_SIZE[2] / 2))
    _set_up(part, surface, friction, restitution, mask=EVERYTHING)
    part.put(Pose())
    return part


def add_body(shapes: Shapes, surface: Surface, body: Body) -> Part:
    """A body, fixed, prescribed or free."""
    handle = shapes.made(
        lambda: (
            _group([_placed(_solid(part), part.pose) for part in body.parts])
            if len(body.parts) > 1
            else _solid(body.parts[0])
        )
    )
    part = Part(handle, get_pose(handle).inverse())
    _set_up(part, surface, body.friction, body.restitution, mask=EVERYTHING)
    if body.mass:
        _set_weight(part, body.mass, np.zeros(3), np.diag(body.inertia()))
        set_bool(handle, "dynamic", True)
        surface.damp(handle, np.asarray(body.damping))
        set_vector(handle, "initLinearVelocity", body.linear_velocity)
        turning = np.asarray(body.angular_velocity)
        if surface.engine == "mujoco":  # takes it in the body's axes
            turning = part.frame.rotation() @ body.pose.rotation().T @ turning
        set_vector(handle, "initAngularVelocity", turning)
    elif body.prescribed:
        set_bool(handle, "kinematic", True)
    part.put(body.pose)
    return part


def add_links(
    shapes: Shapes, surface: Surface, prepared: PreparedRobot
) -> tuple[dict[str, Part], dict[str, int]]:
    """The robot's links, and handles of its joints, by name; at the initial positions."""
    robot = prepared.robot
    positions = {joint.name: joint.initial_position for joint in robot.joints}
    poses = link_poses(prepared, positions)
    links = {
        name: _add_link(shapes, surface, link, robot.friction, poses[name])
        for name, link in prepared.links.items()
    }
    joints = {}
    for joint in prepared.joints:  # parents first
        where = poses[joint.parent] * joint.origin
        handle = _add_joint(joint, where, prepared.limits[joint.name], positions[joint.name])
        call("simSetObjectParent", handle, links[joint.parent].handle, True)
        call("simSetObjectParent", links[joint.child].handle, handle, True)
        joints[joint.name] = handle
    for joint in prepared.joints:
        set_bool(links[joint.child].handle, "dynamic", True)
        borne = 1.0 - prepared.gravity[joint.child]
        set_float(links[joint.child].handle, "mujoco.gravcomp", borne)
    return links, joints


def _add_link(shapes: Shapes, surface: Surface, link: Link, friction: float, pose: Pose) -> Part:
    def make() -> int:
        if not link.shapes:
            return _primitive(CUBOID, (CARRIER,) * 3)
        return _group([_placed(_geometry(shape), shape.pose) for shape in link.shapes])

    handle = shapes.made(make)
    part = Part(handle, get_pose(handle).inverse(), bool(link.shapes))
    _set_up(part, surface, friction, 0.0, mask=OTHERS)
    if link.mass:
        _set_weight(part, link.mass, link.centre, link.inertia)
    surface.damp(handle, np.zeros(2))
    part.put(pose)
    return part


def _add_joint(joint: MovingJoint, where: Pose, limits: FloatArray, position: float) -> int:
    kind = REVOLUTE if joint.kind == "revolute" else PRISMATIC
    handle = call("simCreateJoint_D", kind, DYNAMIC, 0, None, None, None)
    lower, upper = map(float, limits)
    call("simSetJointInterval_D", handle, False, doubles([lower, upper - lower]))
    set_pose(handle, where * Pose(quaternion=turn_of_z(np.asarray(joint.axis))))
    set_float(handle, "jointPosition", position)
    return handle


def _set_up(
    part: Part, surface: Surface, friction: float, restitution: float, *, mask: int
) -> None:
    set_bool(part.handle, "dynamic", False)
    set_bool(part.handle, "respondable", part.touches)
    set_int(part.handle, "respondableMask", mask)
    set_bool(part.handle, "setToDynamicWithParent", False)
    surface.tell(part.handle, friction, restitution)


def _set_weight(part: Part, mass: float, centre: FloatArray, inertia: FloatArray) -> None:
    """Mass [kg], its centre [m] and the inertia about it [kg m^2], in the scene's frame."""
    turn = part.frame.rotation()
    matrix = np.column_stack([np.eye(3), turn @ centre + np.asarray(part.frame.position)])
    call("simSetShapeMass_D", part.handle, c_double(mass))
    call("simSetShapeInertia_D", part.handle, doubles(turn @ inertia @ turn.T), doubles(matrix))


def _solid(body: Body) -> int:
    """The shape of a body; those of the program are along z too."""
    match body:
        case Box():
            return _primitive(CUBOID, body.size)
        case Sphere():
            return _primitive(SPHEROID, (2 * body.radius,) * 3)
        case Cylinder():
            return _primitive(CYLINDER, (2 * body.radius, 2 * body.radius, body.length))
        case Capsule():
            width = 2 * body.radius
            return _primitive(CAPSULE, (width, width, body.length + width))
        case ConvexMesh():
            return _mesh(np.asarray(body.vertices), chain(*body.hull.triangles))
    raise NotSupportedError(f"coppeliasim has no {type(body).__name__}")


def _geometry(shape: Shape) -> int:
    if shape.size is not None:
        return _primitive(CUBOID, shape.size)
    corners = read_stl(Path(shape.mesh or "").read_bytes()).reshape(-1, 3)
    return _mesh(corners, range(len(corners)))


def _primitive(kind: int, size: tuple[float, ...]) -> int:
    return call("simCreatePrimitiveShape_D", kind, doubles(size), 0)


def _mesh(corners: FloatArray, triangles: Iterable[int]) -> int:
    """Of corners (n, 3) [m], three numbers of them for each triangle."""
    numbers, flat = integers(list(triangles)), doubles(corners)
    data = (flat, len(flat), numbers, len(numbers))
    return call("simCreateMeshShape_D", 0, c_double(0.0), *data, None)


def _placed(handle: int, pose: Pose) -> int:
    """Move a shape from where it was made."""
    set_pose(handle, pose * get_pose(handle))
    return handle


def _group(handles: list[int]) -> int:
    if len(handles) == 1:
        return handles[0]
    return call("simGroupShapes", integers(handles), len(handles))
