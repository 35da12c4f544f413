"""What all rigid bodies have: where they are, what they are made of, how they start to move, and
which forces act on them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, Self, cast

import numpy as np

from pytest_simbench.scene.checks import (
    LARGEST,
    SceneError,
    Wire,
    check_name,
    check_number,
    check_numbers,
    check_pose,
)
from pytest_simbench.scene.overlap import Core
from pytest_simbench.scene.pose import FloatArray, Pose, Vector3

ZERO: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Wrench(Wire):
    """A force and a torque on a free body, both constant, in the world frame.

    Attributes:
        force: at the body's centre of mass [N].
        torque: about it [N m].
        start, end: simulated times between which they act [s]; the world is loaded at 0.

    Raises:
        SceneError: a number that is none, or an end that is not after the start.
    """

    force: Vector3 = ZERO
    torque: Vector3 = ZERO
    start: float = 0.0
    end: float = LARGEST

    def __post_init__(self) -> None:
        check_numbers(self.force, 3, "the force [N] of a wrench")
        check_numbers(self.torque, 3, "the torque [N m] of a wrench")
        check_number(self.start, "the start [s] of a wrench", 0.0)
        check_number(self.end, "the end [s] of a wrench", 0.0)
        if self.end <= self.start:
            raise SceneError(f"a wrench starts at {self.start} s and ends at {self.end} s")

    def mean(self, begin: float, end: float) -> FloatArray:
        """Force and torque between two times [s], in the mean, (6,) [N, N m].

        A time step in which a wrench starts or ends has its share: whatever the step, a wrench
        gives a body the momentum force times (end - start).
        """
        share = max(0.0, min(end, self.end) - max(begin, self.start)) / (end - begin)
        return share * np.array([*self.force, *self.torque])


Colour = tuple[float, float, float, float]

WOOD: Colour = (0.72, 0.56, 0.38, 1.0)


@dataclass(frozen=True)
class Solid:
    """A simple solid that a body is drawn with.

    Attributes:
        kind: `box`, `ball`, `tube`, a cylinder along its z axis, or `mesh`.
        extents: its edges, or those of the box around it [m].
        pose: of its centre in the body's frame.
        mesh: its corners [m], and the numbers of those of each triangle, counter-clockwise from
            outside; of a mesh alone.
    """

    kind: Literal["box", "ball", "tube", "mesh"]
    extents: Vector3
    pose: Pose = field(default_factory=Pose)
    mesh: tuple[tuple[Vector3, ...], tuple[tuple[int, int, int], ...]] = ((), ())


class _Placed(Wire, ABC):
    """The fields that all kinds of bodies have and give by position, after those of their kind."""

    name: str
    pose: Pose
    mass: float
    friction: float
    colour: Colour


@dataclass(frozen=True, kw_only=True)
class Body(_Placed):
    """A rigid body, free to move when it has a mass, fixed in the world when it has none.

    One that is `prescribed` has no mass either: it keeps its velocities, whatever touches it.

    Attributes:
        name: unique in its scene.
        pose: of its centre, which is its centre of mass, in the world.
        mass: [kg], spread evenly; 0 fixes the body in the world.
        friction: Coulomb coefficient mu of its surface, sliding; of two surfaces that differ the
            scene's rule makes one (`scene.friction`).
        colour: red, green, blue, alpha in 0..1.
        linear_velocity: of its centre at the start, in the world frame [m/s].
        angular_velocity: of the body at the start, in the world frame [rad/s].
        restitution: Newton's coefficient e: what an impact leaves of the normal velocity. Of
            two surfaces that differ each engine makes one in its own way, which a run tells.
        linear_damping: c of dv/dt = -c v of a free body [1/s].
        angular_damping: the same of its angular velocity [1/s].
        moments: principal moments of inertia about the centre, along the body's axes [kg m^2], of a
            body whose mass is not spread evenly; None: evenly.
        prescribed: the body moves with its velocities all the time, as a belt, a driven plate or a
            pusher does; forces, gravity and contacts change nothing of that.
        wrenches: forces and torques on a free body, each for its time; those at one time add up.

    Raises:
        SceneError: a body that cannot exist; the message names body and value.
    """

    linear_velocity: Vector3 = ZERO
    angular_velocity: Vector3 = ZERO
    restitution: float = 0.0
    linear_damping: float = 0.0
    angular_damping: float = 0.0
    moments: Vector3 | None = None
    prescribed: bool = False
    wrenches: tuple[Wrench, ...] = ()

    optional: ClassVar[tuple[str, ...]] = (
        "linear_velocity", "angular_velocity", "restitution", "linear_damping", "angular_damping",
        "moments", "prescribed", "wrenches",
    )  # fmt: skip

    kinds: ClassVar[dict[str, type[Body]]] = {}
    """Every kind of body, by what `to_wire` calls it."""

    kind: ClassVar[str] = ""
    """What `to_wire` calls it."""

    def __init_subclass__(cls, kind: str = "", **others: Any) -> None:
        super().__init_subclass__(**others)
        if kind:
            Body.kinds[kind], cls.kind = cls, kind

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
                f"{self.name!r} has a velocity and no mass, so it is fixed; give it a mass, or "
                "make it `prescribed`"
            )
        if self.prescribed and (self.mass or self.damping.any()):
            raise SceneError(
                f"{self.name!r} moves as prescribed, so it has no mass and no damping; leave them "
                "out"
            )
        if self.wrenches and not self.mass:
            raise SceneError(f"{self.name!r} has no mass, so no force moves it; give it a mass")
        if self.moments is not None:
            what = f"the moments of inertia [kg m^2] of {self.name!r}"
            check_numbers(self.moments, 3, what, 0.0, above=True)
            if 2 * max(self.moments) > sum(self.moments):
                raise SceneError(f"{what} are {self.moments}; none is larger than the other two")

    @property
    def fixed(self) -> bool:
        """Whether it never moves."""
        return self.mass == 0.0 and not self.prescribed

    @property
    def parts(self) -> tuple[Body, ...]:
        """The convex shapes that it is made of, as fixed bodies whose poses are in its frame."""
        still = {"linear_velocity": ZERO, "angular_velocity": ZERO, "wrenches": ()}
        alone = {"linear_damping": 0.0, "angular_damping": 0.0, "moments": None}
        return (self.changed(pose=Pose(), mass=0.0, prescribed=False, **still, **alone),)

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
        """Edges of the smallest box about its centre, along its axes, that it fits into [m]."""

    @property
    @abstractmethod
    def volume(self) -> float:
        """[m^3]."""

    def inertia(self) -> FloatArray:
        """Principal moments about the centre, along the body's axes, (3,) [kg m^2]."""
        return self.even_inertia() if self.moments is None else np.array(self.moments)

    def even_inertia(self) -> FloatArray:
        """The same of a body whose mass is spread evenly; here of the box around it, m/12 (b^2 +
        c^2) about the axis along a. A compound that moves has `moments`."""
        squares = np.square(self.extents)
        return np.asarray(self.mass / 12.0 * (squares.sum() - squares))

    @abstractmethod
    def solids(self) -> list[Solid]:
        """What the body is drawn with."""

    def core(self, share: float) -> tuple[Core, float]:
        """What is left when a body of one shape loses a layer, and how thick that is [m].

        Of what has edges the layer is `share` of half its shortest edge, and the core with a layer
        around it is the body with its edges rounded. Of spheres and capsules it is the radius, and
        they are whole again. A mesh loses nothing.
        """
        raise NotImplementedError

    def reach(self, directions: FloatArray) -> FloatArray:
        """How far the body reaches from its centre in directions of its frame (n, 3) [m], (n,)."""
        hull, depth = self.core(0.0)
        found: FloatArray = hull.reach(directions) + depth * np.linalg.norm(directions, axis=1)
        return found

    def reach_placed(self, directions: FloatArray) -> FloatArray:
        """The same from the origin of the frame that its pose is given in, in its directions."""
        turned = self.reach(directions @ self.pose.rotation())
        return np.asarray(turned + directions @ np.asarray(self.pose.position))

    def changed(self, **values: Any) -> Self:
        """The same body with some of its fields replaced."""
        return replace(self, **values)

    def with_friction(self, friction: float) -> Self:
        return self.changed(friction=friction)

    def moved_to(self, pose: Pose) -> Self:
        return self.changed(pose=pose)

    def to_wire(self) -> dict[str, Any]:
        """With its kind; a box names none, as before there were other bodies."""
        return ({} if self.kind == "box" else {"kind": self.kind}) | super().to_wire()

    @classmethod
    def from_wire(cls, data: Mapping[str, Any]) -> Self:
        """The body of `to_wire`, of its own kind."""
        told = dict(data)
        kind: Any = cls.kinds[told.pop("kind", "box")]
        return cast("Self", super(Body, kind).from_wire(told))
