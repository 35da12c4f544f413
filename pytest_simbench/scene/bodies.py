"""Rigid bodies: what they are made of, where they are and how they move at the start."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from pytest_simbench.scene.checks import (
    SceneError,
    check_name,
    check_number,
    check_numbers,
    check_pose,
)
from pytest_simbench.scene.overlap import overlaps
from pytest_simbench.scene.pose import FloatArray, Pose, Vector3

Colour = tuple[float, float, float, float]

WOOD: Colour = (0.72, 0.56, 0.38, 1.0)


STILL: Vector3 = (0.0, 0.0, 0.0)


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

    Raises:
        SceneError: a body that cannot exist; the message names body and value.
    """

    linear_velocity: Vector3 = STILL
    angular_velocity: Vector3 = STILL

    def __post_init__(self) -> None:
        check_name(self.name, "a body")
        check_pose(self.pose, repr(self.name))
        check_number(self.mass, f"the mass [kg] of {self.name!r}", 0.0)
        check_number(self.friction, f"the friction of {self.name!r}", 0.0)
        check_numbers(self.colour, 4, f"the colour of {self.name!r}", 0.0)
        check_numbers(self.linear_velocity, 3, f"the linear velocity [m/s] of {self.name!r}")
        check_numbers(self.angular_velocity, 3, f"the angular velocity [rad/s] of {self.name!r}")
        if self.fixed and any((*self.linear_velocity, *self.angular_velocity)):
            raise SceneError(
                f"{self.name!r} has a velocity and no mass, so it is fixed; give it a mass"
            )

    @property
    def fixed(self) -> bool:
        return self.mass == 0.0

    @property
    def velocity(self) -> FloatArray:
        """Linear, then angular velocity at the start, as in body states, (6,) [m/s, rad/s]."""
        return np.array([*self.linear_velocity, *self.angular_velocity])

    @abstractmethod
    def inertia(self) -> FloatArray:
        """Principal moments about the centre, along the body's axes, (3,) [kg m^2]."""

    def moved_to(self, pose: Pose) -> Self:
        values: dict[str, Any] = {"pose": pose}  # a field of every kind of body
        return replace(self, **values)

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
        return data

    @classmethod
    def from_wire(cls, data: dict[str, Any]) -> Box:
        """The body of `to_wire`."""
        values: dict[str, Any] = {
            name: tuple(v) if isinstance(v, list) else v for name, v in data.items()
        }
        values["pose"] = Pose.from_wire(data["pose"])
        return Box(**values)


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

    def inertia(self) -> FloatArray:
        """m/12 (b^2 + c^2) about the axis along a."""
        squares = np.square(self.size)
        return np.asarray(self.mass / 12.0 * (squares.sum() - squares))

    def to_wire(self) -> dict[str, Any]:
        data = super().to_wire()
        return {"name": data.pop("name"), "size": list(self.size), **data}


def penetration(a: Box, b: Box) -> float:
    """How deep two boxes overlap [m]; 0 or less when they are apart or touch."""
    offset = np.subtract(b.pose.position, a.pose.position)
    half_a, half_b = np.asarray(a.size) / 2, np.asarray(b.size) / 2
    if np.linalg.norm(offset) > np.linalg.norm(half_a) + np.linalg.norm(half_b):
        return 0.0
    turn_a, turn_b = a.pose.rotation(), b.pose.rotation()
    return float(overlaps(offset[None], turn_a[None], half_a[None], turn_b[None], half_b[None])[0])
