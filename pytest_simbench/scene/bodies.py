"""Boxes: the only rigid bodies that the tasks need beside the robot and the ground."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pytest_simbench.scene.checks import check_name, check_number, check_numbers, check_pose
from pytest_simbench.scene.overlap import overlaps
from pytest_simbench.scene.pose import FloatArray, Pose, Vector3

Colour = tuple[float, float, float, float]

WOOD: Colour = (0.72, 0.56, 0.38, 1.0)


@dataclass(frozen=True)
class Box:
    """A box, free to move when it has a mass, fixed in the world when it has none.

    Attributes:
        name: unique in its scene.
        size: full edge lengths x, y, z [m].
        pose: of its centre, in the world.
        mass: [kg]; 0 fixes the box in the world.
        friction: Coulomb coefficient mu of its surface, sliding. Every surface of a scene has the
            same one, so that the engines' different rules for combining two do not matter.
        colour: red, green, blue, alpha in 0..1.

    Raises:
        SceneError: a box that cannot exist; the message names box and value.
    """

    name: str
    size: Vector3
    pose: Pose
    mass: float = 0.0
    friction: float = 1.0
    colour: Colour = WOOD

    def __post_init__(self) -> None:
        check_name(self.name, "a body")
        check_numbers(self.size, 3, f"the size [m] of {self.name!r}", 0.0, above=True)
        check_pose(self.pose, repr(self.name))
        check_number(self.mass, f"the mass [kg] of {self.name!r}", 0.0)
        check_number(self.friction, f"the friction of {self.name!r}", 0.0)
        check_numbers(self.colour, 4, f"the colour of {self.name!r}", 0.0)

    @property
    def fixed(self) -> bool:
        return self.mass == 0.0

    def inertia(self) -> FloatArray:
        """Principal moments about the centre (3,) [kg m^2]: m/12 (b^2 + c^2), homogeneous box."""
        squares = np.square(self.size)
        return np.asarray(self.mass / 12.0 * (squares.sum() - squares))

    def moved_to(self, pose: Pose) -> Box:
        return replace(self, pose=pose)

    def to_wire(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "size": list(self.size),
            "pose": self.pose.to_wire(),
            "mass": self.mass,
            "friction": self.friction,
            "colour": list(self.colour),
        }

    @classmethod
    def from_wire(cls, data: dict[str, Any]) -> Box:
        return cls(
            name=data["name"],
            size=tuple(data["size"]),
            pose=Pose.from_wire(data["pose"]),
            mass=data["mass"],
            friction=data["friction"],
            colour=tuple(data["colour"]),
        )


def penetration(a: Box, b: Box) -> float:
    """How deep two boxes overlap [m]; 0 or less when they are apart or touch."""
    offset = np.subtract(b.pose.position, a.pose.position)
    half_a, half_b = np.asarray(a.size) / 2, np.asarray(b.size) / 2
    if np.linalg.norm(offset) > np.linalg.norm(half_a) + np.linalg.norm(half_b):
        return 0.0
    turn_a, turn_b = a.pose.rotation(), b.pose.rotation()
    return float(overlaps(offset[None], turn_a[None], half_a[None], turn_b[None], half_b[None])[0])
