"""Laws of sliding: how friction moves and stops what slides, or lies on a belt. And of meshes: one
beside the box that it is."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import GRAVITY, Law, Reading, Watched, rounding, watch
from pytest_simbench.laws.sticking import SLAB, SLAB_AT, Carried, acceleration, slab_on
from pytest_simbench.scene import Body, Box, ConvexMesh, Pose, Scene, Vector3


@dataclass(frozen=True)
class SlideX(Law, phenomenon="sliding", quantity="acceleration", unit="m/s^2"):
    """Down a slope steeper than mu a slab accelerates by g (sin a - mu cos a) (Coulomb). Tolerance:
    the speed is late by one step at either end of the time T over which it is taken, under the
    largest of the forces: 2 g sin a dt / T."""

    direction: float = 0.0
    slope: float = 0.75
    friction: float = 0.5
    seconds: float = 0.8

    def build(self) -> Scene:
        return slab_on(self.name, self.slope, self.direction, self.friction)

    def read(self, seen: Watched) -> Reading:
        angle = math.atan(self.slope)
        along = seen.bodies[:, 0, 7:9] @ [math.cos(self.direction), math.sin(self.direction)]
        exact = GRAVITY * (math.sin(angle) - self.friction * math.cos(angle))
        return acceleration(seen, along, 0.2, exact, GRAVITY * math.sin(angle))


@dataclass(frozen=True)
class SlideY(SlideX):
    """The same in the direction y."""

    direction: float = math.pi / 2


@dataclass(frozen=True)
class SlideDiagonal(SlideX):
    """The same along a diagonal, where a friction pyramid differs most from the cone."""

    direction: float = math.pi / 4


@dataclass(frozen=True)
class SlideStraight(SlideX, quantity="angle aside", unit="deg"):
    """A slab slides straight down, at 22.5 degrees to the axes too: friction is against the motion
    (a pyramid's is not, and the slab veers). Tolerance: the speed aside is late by one step, as an
    angle: g sin a dt / v."""

    direction: float = math.pi / 8

    def read(self, seen: Watched) -> Reading:
        x, y = seen.bodies[-1, 0, 7:9]
        off = math.degrees(math.atan2(y, x) - self.direction)
        angle = math.atan(self.slope)
        exact = GRAVITY * (math.sin(angle) - self.friction * math.cos(angle)) * seen.end
        late = GRAVITY * math.sin(angle) * seen.dt + rounding(1.0, seen.steps)
        return Reading(off, 0.0, math.degrees(late / exact))


@dataclass(frozen=True)
class StoppingDistance(Law, phenomenon="sliding", quantity="way", unit="m"):
    """A slab that is given the speed v slides v^2 / (2 mu g). Tolerance: v dt."""

    direction: float = 0.0
    speed: float = 2.0
    friction: float = 0.5

    def build(self) -> Scene:
        cos, sin = math.cos(self.direction), math.sin(self.direction)
        velocity = (self.speed * cos, self.speed * sin, 0.0)
        slab = Box("slab", SLAB, SLAB_AT, 1.0, self.friction, linear_velocity=velocity)
        return Scene(self.name, (slab,), ground_friction=self.friction)

    def measure(self, world: World) -> Reading:
        exact = self.speed**2 / (2 * self.friction * GRAVITY)
        seen = watch(world, 1.5 * self.speed / (self.friction * GRAVITY))
        way = float(np.hypot(*seen.bodies[-1, 0, :2]))
        return seen.reading(way, exact, self.speed, 1.0)


@dataclass(frozen=True)
class StoppingDistanceOblique(StoppingDistance):
    """The same at 30 degrees to an axis. Tolerance as of `StoppingDistance`."""

    direction: float = math.pi / 6


@dataclass(frozen=True)
class Glide(Law, phenomenon="sliding", quantity="speed", unit="m/s"):
    """On ground without friction a slab keeps its speed (Newton's first law). Tolerance: rounding,
    for every consistent method keeps a constant."""

    speed: float = 1.0
    seconds: float = 1.0

    def build(self) -> Scene:
        slab = Box("slab", SLAB, SLAB_AT, 1.0, 0.0, linear_velocity=(self.speed, 0.0, 0.0))
        return Scene(self.name, (slab,), ground_friction=0.0)

    def read(self, seen: Watched) -> Reading:
        return seen.reading(seen.bodies[-1, 0, 7], self.speed, 0.0, 2 * self.speed)


@dataclass(frozen=True)
class Belt(Carried, phenomenon="sliding", quantity="acceleration", unit="m/s^2"):
    """On one that starts faster than mu g the box slips, and friction alone moves it: it goes with
    a = mu g. Tolerance: its speed is late by one step at either end of the time T over which it is
    taken: 2 mu g dt / T."""

    acceleration: float = 8.0
    seconds: float = 0.4

    def read(self, seen: Watched) -> Reading:
        pull = self.friction * GRAVITY
        return acceleration(seen, seen.bodies[:, 0, 7], 0.1, pull, pull)


TOP = 0.5
"""Height of the belt's upper side [m]."""


@dataclass(frozen=True)
class BeltSpeed(Law, phenomenon="sliding", quantity="way", unit="m"):
    """A box laid on a running belt slips until it has the belt's speed: a distance x = v^2 / (2 mu
    g) from where it was laid (Coulomb's friction does the work of the kinetic energy), and goes on
    with the belt from v / (mu g) on. Its place is read when it goes with the belt. Tolerance: its
    speed is late by one step all the time, v dt."""

    speed: float = 0.8
    friction: float = 0.4
    seconds: float = 0.6

    def body(self) -> Body:
        return Box("box", (0.1, 0.1, 0.05), Pose.at(0.0, 0.0, TOP + 0.025), 0.5, self.friction)

    def build(self) -> Scene:
        place, speed = Pose.at(0.0, 0.0, TOP - 0.05), (self.speed, 0.0, 0.0)
        belt = Box("belt", (4.0, 0.4, 0.1), place, friction=self.friction)
        belt = replace(belt, linear_velocity=speed, prescribed=True)
        return Scene(self.name, (belt, self.body()), ground_friction=self.friction)

    def read(self, seen: Watched) -> Reading:
        t, slips = seen.end, self.speed / (self.friction * GRAVITY)
        exact = self.speed * (t - slips / 2)
        return seen.reading(seen.bodies[-1, 1, 0], exact, self.speed, 1.0)


def block(size: Vector3) -> tuple[Vector3, ...]:
    """Corners of a box about its centre [m]."""
    x, y, z = (edge / 2 for edge in size)
    return tuple((a, b, c) for a in (-x, x) for b in (-y, y) for c in (-z, z))


@dataclass(frozen=True)
class MeshTwin(
    Law, phenomenon="sliding", quantity="distance of the mesh from where the box is", unit="m"
):
    """A box, and a mesh with its corners beside it, fall, land flat, slide and stop alike: it is
    one body. Each is thrown from the height h with the speed v. Tolerance: each may land and stop
    late by one step, 2 v dt each."""

    size: Vector3 = (0.2, 0.2, 0.05)
    height: float = 0.01
    speed: float = 1.0
    friction: float = 0.5
    seconds: float = 0.4

    def build(self) -> Scene:
        corners, z = block(self.size), self.size[2] / 2
        thrown = Pose.at(0.0, 0.0, z + self.height), 1.0, self.friction
        box = Box("box", self.size, *thrown, linear_velocity=(self.speed, 0.0, 0.0))
        mesh = ConvexMesh("mesh", corners, *thrown, linear_velocity=(self.speed, 0.0, 0.0))
        beside = mesh.moved_to(mesh.pose.translated(y=3 * self.size[1]))
        return Scene(self.name, (box, beside), ground_friction=self.friction)

    def read(self, seen: Watched) -> Reading:
        apart = seen.bodies[-1, 1, :3] - seen.bodies[-1, 0, :3] - [0.0, 3 * self.size[1], 0.0]
        return seen.reading(float(np.linalg.norm(apart)), 0.0, 4 * self.speed, 1.0)
