"""The kinds of rigid bodies: of one shape, and of several."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from pytest_simbench.scene.body import WOOD, Body, Colour, Solid
from pytest_simbench.scene.checks import SceneError, check_number, check_numbers
from pytest_simbench.scene.overlap import Corners, Hull
from pytest_simbench.scene.polytope import EVEN, MOST, Polytope, polytope
from pytest_simbench.scene.pose import FloatArray, Pose, Vector3, vector3


@dataclass(frozen=True)
class Box(Body, kind="box"):
    """A box; `size` is its full edge lengths x, y, z [m]."""

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

    def solids(self) -> list[Solid]:
        return [Solid("box", self.size)]

    def core(self, share: float) -> tuple[Hull, float]:
        half = np.asarray(self.size) / 2
        depth = share * float(half.min())
        return Hull(half - depth), depth


@dataclass(frozen=True)
class Sphere(Body, kind="sphere"):
    """A ball; its radius is in [m]."""

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


@dataclass(frozen=True)
class _Tube(Body):
    """A body around a piece of its own z axis."""

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


class Cylinder(_Tube, kind="cylinder"):
    """A cylinder along its own z axis; `radius` and `length` are in [m]."""

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


class Capsule(_Tube, kind="capsule"):
    """A cylinder along its own z axis with half a ball on each end; `radius` and `length`, of the
    cylinder between the half balls, are in [m]."""

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


@dataclass(frozen=True)
class ConvexMesh(Body, kind="convex_mesh"):
    """A body with flat faces, the convex hull of its vertices: a wedge, a prism, a rock.

    Its frame is that in which it turns most simply: the origin is its centre of mass, and its axes
    are the principal axes of inertia, as engines, and `moments`, have it. `scene.principal` makes
    such vertices, and the pose of their frame, of any points.

    Attributes:
        vertices: its corners in its frame [m], 4 to `polytope.MOST`, in any order.
    """

    name: str
    vertices: tuple[Vector3, ...]
    pose: Pose
    mass: float = 0.0
    friction: float = 1.0
    colour: Colour = WOOD

    def __post_init__(self) -> None:
        super().__post_init__()
        own = f"of {self.name!r}"
        if not isinstance(self.vertices, tuple) or not 4 <= len(self.vertices) <= MOST:
            raise SceneError(f"the vertices {own} must be a tuple of 4 to {MOST} corners [m]")
        for vertex in self.vertices:
            check_numbers(vertex, 3, f"a vertex [m] {own}")
        try:
            hull = self.hull
        except SceneError as error:
            raise SceneError(f"{self.name!r}: {error}") from None
        inside = set(range(len(self.vertices))) - set(hull.corners)
        if inside:
            raise SceneError(
                f"vertex {self.vertices[min(inside)]} {own} is no corner of the convex hull of all "
                "of them; leave it out, or have `principal` leave it out"
            )
        if np.abs(hull.centroid).max() > EVEN * hull.size:
            raise SceneError(
                f"the vertices {own} have their centre of mass at {hull.centroid.tolist()} [m], "
                "which must be the origin: move them there (`principal` does)"
            )
        if not hull.aligned:
            raise SceneError(
                f"the axes {own} are not its principal axes of inertia: turn its vertices to them "
                "(`principal` does)"
            )

    @property
    def hull(self) -> Polytope:
        """Faces and triangles between its vertices."""
        return polytope(self.vertices)

    @property
    def extents(self) -> Vector3:
        return vector3(2 * np.abs(self.vertices).max(axis=0))

    @property
    def volume(self) -> float:
        return self.hull.volume

    def even_inertia(self) -> FloatArray:
        """The sum over tetrahedra, see `Polytope.inertia`."""
        return np.asarray(self.mass * np.diag(self.hull.inertia))

    def solids(self) -> list[Solid]:
        return [Solid("mesh", self.extents, mesh=(self.vertices, tuple(self.hull.triangles)))]

    def core(self, share: float) -> tuple[Corners, float]:
        return Corners(np.array(self.vertices)), 0.0


@dataclass(frozen=True)
class Compound(Body, kind="compound"):
    """A body of several shapes, rigidly joined: a bowl, a table with legs. They may overlap.

    Its frame is that of `moments`: the origin is its centre of mass, the axes are principal ones.

    Attributes:
        shapes: fixed bodies of one shape each, their poses in its frame, with its friction and
            restitution. Their names are unique among them.
        file_frame: the frame that a file gives it, in its own; who reads the file knows it.
    """

    name: str
    shapes: tuple[Body, ...]
    pose: Pose
    mass: float = 0.0
    friction: float = 1.0
    colour: Colour = WOOD
    file_frame: Pose = field(default_factory=Pose)

    optional = (*Body.optional, "file_frame")

    def __post_init__(self) -> None:
        super().__post_init__()
        own, names = f"of {self.name!r}", [shape.name for shape in self.shapes]
        if not self.shapes:
            raise SceneError(f"{self.name!r} has no shapes; give it one at least")
        for shape in self.shapes:
            if isinstance(shape, Compound) or not shape.fixed:
                raise SceneError(
                    f"the shape {shape.name!r} {own} must be one shape without a mass: the mass is "
                    "that of the whole"
                )
            if names.count(shape.name) > 1:
                raise SceneError(f"{names.count(shape.name)} shapes {own} are named {shape.name!r}")
            surface = (shape.friction, shape.restitution)
            if surface != (self.friction, self.restitution):
                raise SceneError(
                    f"the shape {shape.name!r} {own} has friction and restitution {surface}, and "
                    f"the body {(self.friction, self.restitution)}: all shapes of a body have its"
                )
        if self.mass and self.moments is None:
            raise SceneError(f"{self.name!r} has several shapes and no `moments`; give them")

    @property
    def parts(self) -> tuple[Body, ...]:
        return self.shapes

    @property
    def extents(self) -> Vector3:
        axes = np.concatenate([np.eye(3), -np.eye(3)])
        return vector3(2 * self.reach(axes).reshape(2, 3).max(axis=0))

    @property
    def volume(self) -> float:
        """The sum over its shapes: what two of them share counts twice."""
        return sum(shape.volume for shape in self.shapes)

    def with_friction(self, friction: float) -> Compound:
        shapes = tuple(shape.with_friction(friction) for shape in self.shapes)
        return self.changed(friction=friction, shapes=shapes)

    def solids(self) -> list[Solid]:
        placed = [(shape.pose, solid) for shape in self.shapes for solid in shape.solids()]
        return [replace(solid, pose=pose * solid.pose) for pose, solid in placed]

    def reach(self, directions: FloatArray) -> FloatArray:
        return np.asarray(np.max([shape.reach_placed(directions) for shape in self.shapes], axis=0))
