"""Rigid bodies: what they are made of, where they are and how they move at the start."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Self

import numpy as np

from pytest_simbench.scene.checks import (
    SceneError,
    check_name,
    check_number,
    check_numbers,
    check_pose,
)
from pytest_simbench.scene.overlap import Hull, distance, overlaps
from pytest_simbench.scene.pose import FloatArray, Pose, Vector3

Colour = tuple[float, float, float, float]

WOOD: Colour = (0.72, 0.56, 0.38, 1.0)


STILL: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Solid:
    """A simple solid that a body is drawn with.

    Attributes:
        kind: `box`, `ball`, or `tube`, a cylinder along its z axis.
        extents: its edges, or those of the box around it [m].
        pose: of its centre in the body's frame.
    """

    kind: Literal["box", "ball", "tube"]
    extents: Vector3
    pose: Pose = field(default_factory=Pose)


class _Placed(ABC):
    """The fields that all kinds of bodies have and give by position, after those of their kind."""

    name: str
    pose: Pose
    mass: float
    friction: float
    colour: Colour


@dataclass(frozen=True, kw_only=True)
class Body(_Placed):
    """A rigid body, free to move when it has a mass, fixed in the world when it has none.

    Attributes:
        name: unique in its scene.
        pose: of its centre, which is its centre of mass, in the world.
        mass: [kg], spread evenly; 0 fixes the body in the world.
        friction: Coulomb coefficient mu of its surface, sliding. Every surface of a scene has the
            same one, so that the engines' different rules for combining two do not matter.
        colour: red, green, blue, alpha in 0..1.
        linear_velocity: of a free body's centre at the start, in the world frame [m/s].
        angular_velocity: of a free body at the start, in the world frame [rad/s].
        restitution: Newton's coefficient e: what an impact leaves of the normal velocity. All
            surfaces of a scene that bounce have the same one, as with friction.
        linear_damping: c of dv/dt = -c v of a free body [1/s].
        angular_damping: the same of its angular velocity [1/s].
        moments: principal moments of inertia about the centre, along the body's axes [kg m^2], of a
            body whose mass is not spread evenly; None: evenly.

    Raises:
        SceneError: a body that cannot exist; the message names body and value.
    """

    linear_velocity: Vector3 = STILL
    angular_velocity: Vector3 = STILL
    restitution: float = 0.0
    linear_damping: float = 0.0
    angular_damping: float = 0.0
    moments: Vector3 | None = None

    def __post_init__(self) -> None:
        check_name(self.name, "a body")
        check_pose(self.pose, repr(self.name))
        check_number(self.mass, f"the mass [kg] of {self.name!r}", 0.0)
        check_number(self.friction, f"the friction of {self.name!r}", 0.0)
        check_numbers(self.colour, 4, f"the colour of {self.name!r}", 0.0)
        check_numbers(self.linear_velocity, 3, f"the linear velocity [m/s] of {self.name!r}")
        check_numbers(self.angular_velocity, 3, f"the angular velocity [rad/s] of {self.name!r}")
        check_number(self.restitution, f"the restitution of {self.name!r}", 0.0, 1.0)
        for kind, value in zip(("linear", "angular"), self.damping.tolist(), strict=True):
            check_number(value, f"the {kind} damping [1/s] of {self.name!r}", 0.0)
        if self.fixed and any((*self.linear_velocity, *self.angular_velocity)):
            raise SceneError(
                f"{self.name!r} has a velocity and no mass, so it is fixed; give it a mass"
            )
        if self.moments is not None:
            what = f"the moments of inertia [kg m^2] of {self.name!r}"
            check_numbers(self.moments, 3, what, 0.0, above=True)
            if 2 * max(self.moments) > sum(self.moments):
                raise SceneError(f"{what} are {self.moments}; none is larger than the other two")

    @property
    def fixed(self) -> bool:
        return self.mass == 0.0

    @property
    def velocity(self) -> FloatArray:
        """Linear, then angular velocity at the start, as in body states, (6,) [m/s, rad/s]."""
        return np.array([*self.linear_velocity, *self.angular_velocity])

    @property
    def damping(self) -> FloatArray:
        """Linear and angular, (2,) [1/s]."""
        return np.array([self.linear_damping, self.angular_damping])

    @property
    @abstractmethod
    def extents(self) -> Vector3:
        """Edges of the smallest box along the body's axes that it fits into [m]."""

    @property
    @abstractmethod
    def volume(self) -> float:
        """[m^3]."""

    def inertia(self) -> FloatArray:
        """Principal moments about the centre, along the body's axes, (3,) [kg m^2]."""
        return self.even_inertia() if self.moments is None else np.array(self.moments)

    @abstractmethod
    def even_inertia(self) -> FloatArray:
        """The same of a body whose mass is spread evenly."""

    @abstractmethod
    def solids(self) -> list[Solid]:
        """What the body is drawn with."""

    @abstractmethod
    def core(self, share: float) -> tuple[Hull, float]:
        """What is left when the body loses a layer, and how thick that is [m].

        Of what has edges the layer is `share` of half its shortest edge, and the core with a layer
        around it is the body with its edges rounded. Of spheres and capsules it is the radius, and
        they are whole again.
        """

    def reach(self, directions: FloatArray) -> FloatArray:
        """How far the body reaches from its centre in directions of its frame (n, 3) [m], (n,)."""
        hull, depth = self.core(0.0)
        found: FloatArray = hull.reach(directions) + depth * np.linalg.norm(directions, axis=1)
        return found

    def changed(self, **values: Any) -> Self:
        """The same body with some of its fields replaced."""
        return replace(self, **values)

    def moved_to(self, pose: Pose) -> Self:
        return self.changed(pose=pose)

    def to_wire(self) -> dict[str, Any]:
        """As plain data; what is as by default is left out, but for what a box always had."""
        data = {
            "name": self.name,
            "pose": self.pose.to_wire(),
            "mass": self.mass,
            "friction": self.friction,
            "colour": list(self.colour),
        }
        if self.linear_velocity != STILL:
            data["linear_velocity"] = list(self.linear_velocity)
        if self.angular_velocity != STILL:
            data["angular_velocity"] = list(self.angular_velocity)
        for name in ("restitution", "linear_damping", "angular_damping"):
            if getattr(self, name):
                data[name] = getattr(self, name)
        if self.moments is not None:
            data["moments"] = list(self.moments)
        return data

    @classmethod
    def from_wire(cls, data: dict[str, Any]) -> Body:
        """The body of `to_wire`, of its own kind."""
        values: dict[str, Any] = {
            name: tuple(v) if isinstance(v, list) else v for name, v in data.items()
        }
        values["pose"] = Pose.from_wire(data["pose"])
        kind: Any = KINDS[values.pop("kind", "box")]
        made: Body = kind(**values)
        return made


@dataclass(frozen=True)
class Box(Body):
    """A box.

    Attributes:
        size: full edge lengths x, y, z [m].
    """

    name: str
    size: Vector3
    pose: Pose
    mass: float = 0.0
    friction: float = 1.0
    colour: Colour = WOOD

    def __post_init__(self) -> None:
        super().__post_init__()
        check_numbers(self.size, 3, f"the size [m] of {self.name!r}", 0.0, above=True)

    @property
    def extents(self) -> Vector3:
        return self.size

    @property
    def volume(self) -> float:
        return float(np.prod(self.size))

    def even_inertia(self) -> FloatArray:
        """m/12 (b^2 + c^2) about the axis along a."""
        squares = np.square(self.size)
        return np.asarray(self.mass / 12.0 * (squares.sum() - squares))

    def solids(self) -> list[Solid]:
        return [Solid("box", self.size)]

    def core(self, share: float) -> tuple[Hull, float]:
        half = np.asarray(self.size) / 2
        depth = share * float(half.min())
        return Hull(half - depth), depth

    def to_wire(self) -> dict[str, Any]:
        data = super().to_wire()
        return {"name": data.pop("name"), "size": list(self.size), **data}


@dataclass(frozen=True)
class Sphere(Body):
    """A ball.

    Attributes:
        radius: [m].
    """

    name: str
    radius: float
    pose: Pose
    mass: float = 0.0
    friction: float = 1.0
    colour: Colour = WOOD

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number(self.radius, f"the radius [m] of {self.name!r}", 0.0, above=True)

    @property
    def extents(self) -> Vector3:
        return (2 * self.radius,) * 3

    @property
    def volume(self) -> float:
        return 4 / 3 * math.pi * self.radius**3

    def even_inertia(self) -> FloatArray:
        """2/5 m r^2."""
        return np.full(3, 0.4 * self.mass * self.radius**2)

    def solids(self) -> list[Solid]:
        return [Solid("ball", self.extents)]

    def core(self, share: float) -> tuple[Hull, float]:
        return Hull(np.zeros(3)), self.radius

    def to_wire(self) -> dict[str, Any]:
        return {"kind": "sphere", "radius": self.radius, **super().to_wire()}


@dataclass(frozen=True)
class Cylinder(Body):
    """A cylinder along its own z axis.

    Attributes:
        radius: [m].
        length: along the axis [m].
    """

    name: str
    radius: float
    length: float
    pose: Pose
    mass: float = 0.0
    friction: float = 1.0
    colour: Colour = WOOD

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number(self.radius, f"the radius [m] of {self.name!r}", 0.0, above=True)
        check_number(self.length, f"the length [m] of {self.name!r}", 0.0, above=True)

    @property
    def extents(self) -> Vector3:
        return (2 * self.radius, 2 * self.radius, self.length)

    @property
    def volume(self) -> float:
        return math.pi * self.radius**2 * self.length

    def even_inertia(self) -> FloatArray:
        """m r^2 / 2 about the axis, m (3 r^2 + l^2) / 12 across it."""
        across = self.mass * (3 * self.radius**2 + self.length**2) / 12
        return np.array([across, across, self.mass * self.radius**2 / 2])

    def solids(self) -> list[Solid]:
        return [Solid("tube", self.extents)]

    def core(self, share: float) -> tuple[Hull, float]:
        depth = share * min(self.radius, self.length / 2)
        return Hull(np.array([0.0, 0.0, self.length / 2 - depth]), self.radius - depth), depth

    def to_wire(self) -> dict[str, Any]:
        shape = {"kind": "cylinder", "radius": self.radius, "length": self.length}
        return {**shape, **super().to_wire()}


@dataclass(frozen=True)
class Capsule(Body):
    """A cylinder along its own z axis with half a ball on each end.

    Attributes:
        radius: [m].
        length: of the cylinder between the half balls [m].
    """

    name: str
    radius: float
    length: float
    pose: Pose
    mass: float = 0.0
    friction: float = 1.0
    colour: Colour = WOOD

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number(self.radius, f"the radius [m] of {self.name!r}", 0.0, above=True)
        check_number(self.length, f"the length [m] of {self.name!r}", 0.0, above=True)

    @property
    def extents(self) -> Vector3:
        return (2 * self.radius, 2 * self.radius, self.length + 2 * self.radius)

    @property
    def volume(self) -> float:
        return math.pi * self.radius**2 * (self.length + 4 / 3 * self.radius)

    def even_inertia(self) -> FloatArray:
        """Of a cylinder and two half balls, these by Steiner's theorem about the middle; a half
        ball's centre of mass lies 3/8 r behind its flat side."""
        r, length = self.radius, self.length
        tube = self.mass * length / (length + 4 / 3 * r)
        ball = self.mass - tube
        across = tube * (3 * r**2 + length**2) / 12
        across += ball * (0.4 * r**2 + length**2 / 4 + 3 / 8 * r * length)
        return np.array([across, across, tube * r**2 / 2 + 0.4 * ball * r**2])

    def solids(self) -> list[Solid]:
        edge = 2 * self.radius
        ends = [Pose.at(0.0, 0.0, end * self.length / 2) for end in (-1, 1)]
        balls = [Solid("ball", (edge, edge, edge), pose) for pose in ends]
        return [Solid("tube", (edge, edge, self.length)), *balls]

    def core(self, share: float) -> tuple[Hull, float]:
        return Hull(np.array([0.0, 0.0, self.length / 2])), self.radius

    def to_wire(self) -> dict[str, Any]:
        shape = {"kind": "capsule", "radius": self.radius, "length": self.length}
        return {**shape, **super().to_wire()}


KINDS: Mapping[str, type[Body]] = {
    "box": Box,
    "sphere": Sphere,
    "cylinder": Cylinder,
    "capsule": Capsule,
}
"""By what `to_wire` calls them."""


def penetration(a: Body, b: Body, share: float = 0.1) -> float:
    """How deep two bodies overlap [m]; 0 or less when they are apart or touch.

    Exact for two boxes, and among spheres and capsules. A box or cylinder beside one of these, and
    two cylinders, count as if their edges were rounded by `share` of their shortest half edge: two
    bodies that do not overlap are never said to. The depth is then at most those radii.
    """
    offset = np.subtract(b.pose.position, a.pose.position)
    half_a, half_b = np.asarray(a.extents) / 2, np.asarray(b.extents) / 2
    if np.linalg.norm(offset) > np.linalg.norm(half_a) + np.linalg.norm(half_b):
        return 0.0
    turn_a, turn_b = a.pose.rotation(), b.pose.rotation()
    if not (isinstance(a, Box) and isinstance(b, Box)):
        (core_a, depth_a), (core_b, depth_b) = a.core(share), b.core(share)
        return depth_a + depth_b - distance(offset, core_a, turn_a, core_b, turn_b)
    return float(overlaps(offset[None], turn_a[None], half_a[None], turn_b[None], half_b[None])[0])
