"""Laws of friction: what sticks, what slides, and how."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import GRAVITY, Law, Reading, rounding, stillness, watch
from pytest_simbench.laws.drives import STRONG, follow
from pytest_simbench.laws.mechanisms import Part, mechanism
from pytest_simbench.scene import Box, FloatArray, Pose, Scene, Trajectory, Vector3

SLAB: Vector3 = (0.1, 0.1, 0.02)
SLAB_AT = Pose.at(0.0, 0.0, SLAB[2] / 2)
WEDGE: Vector3 = (0.3, 0.3, 0.05)


def tilted(slope: float, direction: float) -> Vector3:
    """Gravity that makes the ground a slope [tangent], down towards `direction` [rad]."""
    angle = math.atan(slope)
    pull = GRAVITY * math.sin(angle)
    return (
        pull * math.cos(direction),
        pull * math.sin(direction),
        -GRAVITY * math.cos(angle),
    )


def slope_pose(slope: float, direction: float) -> Pose:
    """A turn that tilts a level plane so that it goes down towards `direction` [rad]."""
    half = math.atan(slope) / 2
    down = Pose(quaternion=(math.cos(half), 0.0, math.sin(half), 0.0))
    return Pose.at(0.0, 0.0, 0.0, yaw=direction) * down


def boundary(values: Sequence[float], moved: Sequence[bool]) -> float:
    """Where rising `values` change from what stays to what moves: in the middle between the two
    neighbours, at an end where all stay or all move."""
    stay = len(values) - sum(moved)
    if 0 < stay < len(values):
        return (values[stay - 1] + values[stay]) / 2
    return values[0] if stay == 0 else values[-1]


SHARES = (0.92, 0.96, 0.98, 1.02, 1.04, 1.08)
"""Of a critical value: a fan of cases on both sides of it."""

BETWEEN = 0.02
"""Tolerance of a fan: half of the gap in which the critical value lies, as a share of it."""


@dataclass(frozen=True)
class StickAngle(Law):
    """A slab on a slope stays up to the angle atan mu and slides above it (Coulomb; Amontons): six
    slopes, from 0.92 to 1.08 mu. It slides where it has gone half as far as the least steep one
    that must. Tolerance: half of the gap between the slopes on either side, 0.02 mu; no step."""

    name = "stick_angle_x"
    phenomenon = "sticking"
    quantity: ClassVar[str] = "tangent of the steepest slope that holds"
    unit: ClassVar[str] = ""

    direction: float = 0.0
    friction: float = 0.5
    seconds: float = 0.8

    def build(self) -> Scene:
        bodies = []
        for k, share in enumerate(SHARES):
            turn = slope_pose(share * self.friction, self.direction)
            place = Pose((0.6 * (k % 2), 0.5 * (k - 2.5), 1.0), turn.quaternion)
            on_top = place * Pose.at(0.0, 0.0, (WEDGE[2] + SLAB[2]) / 2)
            bodies.append(Box(f"slope {k}", WEDGE, place, friction=self.friction))
            bodies.append(Box(f"slab {k}", SLAB, on_top, 1.0, self.friction))
        return Scene(self.name, tuple(bodies), ground_friction=self.friction)

    def measure(self, world: World) -> Reading:
        start = world.bodies[:, :3].copy()
        world.wait(self.seconds)
        moved = np.linalg.norm(world.bodies[:, :3] - start, axis=1)
        steep = math.atan(self.friction)
        pull = GRAVITY * math.cos(steep) * BETWEEN * self.friction
        least = pull * world.time**2 / 4
        slopes = [share * self.friction for share in SHARES]
        found = boundary(slopes, [bool(way > least) for way in moved])
        return Reading(found, self.friction, BETWEEN * self.friction)


@dataclass(frozen=True)
class StickAngleAcross(StickAngle):
    """The same in the direction y."""

    name = "stick_angle_y"
    direction: float = math.pi / 2


@dataclass(frozen=True)
class StickAngleDiagonal(StickAngle):
    """The same along a diagonal, where a friction pyramid holds up to sqrt(2) mu, or only up to
    mu / sqrt(2)."""

    name = "stick_angle_diagonal"
    direction: float = math.pi / 4


@dataclass(frozen=True)
class Creep(Law):
    """A slab on a slope of 0.8 mu stays where it is. Tolerance: an equilibrium, g dt^2; it is
    looked at from 0.2 s on."""

    name = "creep"
    phenomenon = "sticking"
    quantity: ClassVar[str] = "way in 1 s"
    unit: ClassVar[str] = "m"

    friction: float = 0.5
    share: float = 0.8
    direction: float = 0.4

    def build(self) -> Scene:
        slab = Box("slab", SLAB, SLAB_AT, 1.0, self.friction)
        pull = tilted(self.share * self.friction, self.direction)
        return Scene(self.name, (slab,), gravity=pull, ground_friction=self.friction)

    def measure(self, world: World) -> Reading:
        seen = watch(world, 1.2)
        way = seen.bodies[-1, 0, :2] - seen.at(0.2, seen.bodies[:, 0, :2])
        allowed = stillness(seen.dt, 0.1)
        return Reading(float(np.linalg.norm(way)), 0.0, allowed)


@dataclass(frozen=True)
class Carried(Law):
    """A box on a carriage that starts with less than mu g goes with it: it stays where it lies on
    the carriage. Tolerance: an equilibrium in the carriage's frame, g dt^2, and the carriage's
    motion late by one step, a dt^2."""

    name = "carried"
    phenomenon = "sticking"
    quantity: ClassVar[str] = "way on the carriage"
    unit: ClassVar[str] = "m"

    friction: float = 0.5
    acceleration: float = 2.0
    seconds: float = 0.5

    def build(self) -> Scene:
        deck = Part(
            "carriage", (1.0, 0.0, 0.0), mass=5.0, inertia=(0.1,) * 3, slides=True,
            shape=(2.0, 0.4, 0.1), stiffness=1e5, damping=2e3, effort=STRONG,
        )  # fmt: skip
        robot = mechanism("belt", deck, base=Pose.at(0.0, 0.0, 0.5), friction=self.friction)
        box = Box("box", SLAB, Pose.at(0.0, 0.0, 0.55 + SLAB[2] / 2), 0.2, self.friction)
        return Scene(self.name, (box,), robot, ground_friction=self.friction)

    def ride(self) -> Trajectory:
        """The carriage's set points, with the force that its mass asks for."""
        time = np.linspace(0.0, self.seconds, 101)
        a = self.acceleration
        position, velocity = a * time**2 / 2, a * time
        effort = np.full((101, 1), 5.0 * a)
        return Trajectory(float(time[1]), position[:, None], velocity[:, None], effort)

    def measure(self, world: World) -> Reading:
        seen = follow(world, self.ride())
        slid = float(seen.bodies[-1, 0, 0] - seen.joints[-1, 0, 0])
        allowed = stillness(seen.dt, 1.0) + self.acceleration * seen.dt**2
        return Reading(slid, 0.0, allowed)


@dataclass(frozen=True)
class Belt(Carried):
    """On one that starts faster than mu g the box slips, and friction alone moves it: it goes with
    a = mu g. Tolerance: its speed is late by one step at either end of the time T over which it is
    taken: 2 mu g dt / T."""

    name = "belt"
    phenomenon = "sliding"
    quantity: ClassVar[str] = "acceleration"
    unit: ClassVar[str] = "m/s^2"

    acceleration: float = 8.0
    seconds: float = 0.4

    def measure(self, world: World) -> Reading:
        seen = follow(world, self.ride())
        return acceleration(seen.dt, seen.t, seen.bodies[:, 0, 7], 0.1, self.friction * GRAVITY,
                             self.friction * GRAVITY)  # fmt: skip


@dataclass(frozen=True)
class SlideX(Law):
    """Down a slope steeper than mu a slab accelerates by g (sin a - mu cos a) (Coulomb). Tolerance:
    the speed is late by one step at either end of the time T over which it is taken, under the
    largest of the forces: 2 g sin a dt / T."""

    name = "slide_x"
    phenomenon = "sliding"
    quantity: ClassVar[str] = "acceleration"
    unit: ClassVar[str] = "m/s^2"

    direction: float = 0.0
    slope: float = 0.75
    friction: float = 0.5
    seconds: float = 0.8

    def build(self) -> Scene:
        slab = Box("slab", SLAB, SLAB_AT, 1.0, self.friction)
        pull = tilted(self.slope, self.direction)
        return Scene(self.name, (slab,), gravity=pull, ground_friction=self.friction)

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        angle = math.atan(self.slope)
        along = seen.bodies[:, 0, 7:9] @ [math.cos(self.direction), math.sin(self.direction)]
        exact = GRAVITY * (math.sin(angle) - self.friction * math.cos(angle))
        return acceleration(seen.dt, seen.t, along, 0.2, exact, GRAVITY * math.sin(angle))


@dataclass(frozen=True)
class SlideY(SlideX):
    """The same in the direction y."""

    name = "slide_y"
    direction: float = math.pi / 2


@dataclass(frozen=True)
class SlideDiagonal(SlideX):
    """The same along a diagonal, where a friction pyramid differs most from the cone."""

    name = "slide_diagonal"
    direction: float = math.pi / 4


@dataclass(frozen=True)
class SlideStraight(SlideX):
    """A slab slides straight down, at 22.5 degrees to the axes too: friction is against the motion
    (a pyramid's is not, and the slab veers). Tolerance: the speed aside is late by one step, as an
    angle: g sin a dt / v."""

    name = "slide_straight"
    quantity: ClassVar[str] = "angle aside"
    unit: ClassVar[str] = "deg"
    direction: float = math.pi / 8

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        x, y = seen.bodies[-1, 0, 7:9]
        off = math.degrees(math.atan2(y, x) - self.direction)
        angle = math.atan(self.slope)
        exact = GRAVITY * (math.sin(angle) - self.friction * math.cos(angle)) * float(seen.t[-1])
        late = GRAVITY * math.sin(angle) * seen.dt + rounding(1.0, seen.steps)
        return Reading(off, 0.0, math.degrees(late / exact))


@dataclass(frozen=True)
class StoppingDistance(Law):
    """A slab that is given the speed v slides v^2 / (2 mu g). Tolerance: v dt."""

    name = "stopping_distance"
    phenomenon = "sliding"
    quantity: ClassVar[str] = "way"
    unit: ClassVar[str] = "m"

    direction: float = 0.0
    speed: float = 2.0
    friction: float = 0.5

    def build(self) -> Scene:
        velocity = (
            self.speed * math.cos(self.direction),
            self.speed * math.sin(self.direction),
            0.0,
        )
        slab = Box("slab", SLAB, SLAB_AT, 1.0, self.friction, linear_velocity=velocity)
        return Scene(self.name, (slab,), ground_friction=self.friction)

    def measure(self, world: World) -> Reading:
        exact = self.speed**2 / (2 * self.friction * GRAVITY)
        seen = watch(world, 1.5 * self.speed / (self.friction * GRAVITY))
        way = float(np.hypot(*seen.bodies[-1, 0, :2]))
        return Reading(way, exact, self.speed * seen.dt + rounding(1.0, seen.steps))


@dataclass(frozen=True)
class StoppingDistanceDiagonal(StoppingDistance):
    """The same at 30 degrees to an axis. Tolerance as of `StoppingDistance`."""

    name = "stopping_distance_oblique"
    direction: float = math.pi / 6


@dataclass(frozen=True)
class Glide(Law):
    """On ground without friction a slab keeps its speed (Newton's first law). Tolerance: rounding,
    for every consistent method keeps a constant."""

    name = "glide"
    phenomenon = "sliding"
    quantity: ClassVar[str] = "speed"
    unit: ClassVar[str] = "m/s"

    speed: float = 1.0
    seconds: float = 1.0

    def build(self) -> Scene:
        slab = Box("slab", SLAB, SLAB_AT, 1.0, 0.0, linear_velocity=(self.speed, 0.0, 0.0))
        return Scene(self.name, (slab,), ground_friction=0.0)

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        return Reading(
            float(seen.bodies[-1, 0, 7]), self.speed, rounding(2 * self.speed, seen.steps)
        )


def acceleration(
    dt: float, t: FloatArray, speed: FloatArray, begin: float, exact: float, force: float
) -> Reading:
    """The slope of a speed [m/s] from `begin` [s] to the end; `force`: the largest one, for each
    kg [m/s^2]."""
    used = t > begin
    found = float(np.polyfit(t[used], speed[used], 1)[0])
    span = float(t[-1]) - begin
    return Reading(found, exact, 2 * force * dt / span + rounding(1.0, len(t)))
