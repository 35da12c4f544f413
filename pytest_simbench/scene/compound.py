"""Bodies of several shapes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from pytest_simbench.scene.body import WOOD, Body, Colour, Solid
from pytest_simbench.scene.checks import SceneError
from pytest_simbench.scene.pose import FloatArray, Pose, Vector3, vector3


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

    def even_inertia(self) -> FloatArray:
        """Of the box around it; a body that moves has `moments`."""
        squares = np.square(self.extents)
        return np.asarray(self.mass / 12.0 * (squares.sum() - squares))

    def with_friction(self, friction: float) -> Compound:
        shapes = tuple(shape.with_friction(friction) for shape in self.shapes)
        return self.changed(friction=friction, shapes=shapes)

    def solids(self) -> list[Solid]:
        placed = [(shape.pose, solid) for shape in self.shapes for solid in shape.solids()]
        return [replace(solid, pose=pose * solid.pose) for pose, solid in placed]

    def reach(self, directions: FloatArray) -> FloatArray:
        return np.asarray(np.max([shape.reach_placed(directions) for shape in self.shapes], axis=0))
