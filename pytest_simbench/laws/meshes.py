"""Laws of convex meshes: a wheel without a rim, and a mesh beside the box that it is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import GRAVITY, Law, Reading, rounding, watch
from pytest_simbench.scene import Box, ConvexMesh, Pose, Scene, Vector3


@dataclass(frozen=True)
class RimlessWheel(Law):
    """A regular prism of n sides rolls on its edges: a step of a wheel without a rim.

    It turns about an edge (r to the axis, J about it) until the next edge strikes, 2 pi / n
    further. That one is where all impulses act, so angular momentum about it stays, and of the
    speed there is left k = (J + m r^2 cos(2 pi / n)) / (J + m r^2) (McGeer, Passive dynamic
    walking, Int. J. Robotics Research 9 (1990) 62). Before and after it energy stays, with a = m g
    r / (J + m r^2): w0^2 + 2 a (cos x0 - cos x) = w^2, x from the vertical. J = m r^2 (2 + cos(2 pi
    / n)) / 6 of a regular polygon. Measured where the axis is above the new edge. Friction 1 holds
    the edges, and w^2 r stays below g cos x, so that none lifts off.

    Tolerance: each of the two falls is late by one step, a dt, and its rate one step late all the
    time, a w T dt; the impact is late by one step, a dt; an error of the speed before is k of it
    after, and grows by w / w_top until the top.
    """

    name = "rimless_wheel"
    phenomenon = "rolling"
    quantity: ClassVar[str] = "angular speed above the next edge"
    unit: ClassVar[str] = "rad/s"

    sides: int = 8
    radius: float = 0.2
    width: float = 0.2
    lean: float = 0.1
    speed: float = 4.5

    def build(self) -> Scene:
        turns = 2 * np.pi * np.arange(self.sides) / self.sides
        vertices = tuple(
            (float(self.radius * np.sin(turn)), y, float(-self.radius * np.cos(turn)))
            for turn in turns
            for y in (-self.width / 2, self.width / 2)
        )
        x, z = self.radius * math.sin(self.lean), self.radius * math.cos(self.lean)
        half = self.lean / 2
        wheel = ConvexMesh(
            "wheel",
            vertices,
            Pose((x, 0.0, z), (math.cos(half), 0.0, math.sin(half), 0.0)),
            1.0,
            linear_velocity=(self.speed * z, 0.0, -self.speed * x),
            angular_velocity=(0.0, self.speed, 0.0),
        )
        return Scene(self.name, (wheel,))

    def exact(self) -> tuple[float, float, float]:
        """Angular speed above the next edge, and just before and after the impact [rad/s]."""
        step = 2 * math.pi / self.sides
        own = (2 + math.cos(step)) / 6  # of J, in m r^2
        fall = 2 * self.pull
        before = math.sqrt(self.speed**2 + fall * (math.cos(self.lean) - math.cos(step / 2)))
        after = before * (own + math.cos(step)) / (own + 1)
        return math.sqrt(after**2 - fall * (1 - math.cos(step / 2))), before, after

    @property
    def pull(self) -> float:
        """a, the largest angular acceleration [rad/s^2]."""
        return GRAVITY / self.radius / ((2 + math.cos(2 * math.pi / self.sides)) / 6 + 1)

    def measure(self, world: World) -> Reading:
        step = 2 * math.pi / self.sides
        top, before, after = self.exact()
        first, second = (step / 2 - self.lean) / self.speed, step / 2 / top  # at most [s]
        seen = watch(world, first + second + 0.1)
        halves = np.arctan2(seen.bodies[:, 0, 5], seen.bodies[:, 0, 3])
        angles = np.unwrap(2 * halves, period=2 * math.pi)
        reached = seen.crossings(angles, step)
        found = float(seen.at(reached[0], seen.bodies[:, 0, 11])) if len(reached) else 0.0
        late, rate = self.pull * seen.dt, self.pull * before * seen.dt
        off = (after / before) * (late + rate * first) + late
        allowed = (after / top) * off + late + rate * second + rounding(before, seen.steps)
        return Reading(found, top, allowed)


@dataclass(frozen=True)
class MeshTwin(Law):
    """A box, and a mesh with its corners beside it, fall, land flat, slide and stop alike: it is
    one body. Each is thrown from the height h with the speed v. Tolerance: each may land and stop
    late by one step, 2 v dt each."""

    name = "mesh_twin"
    phenomenon = "sliding"
    quantity: ClassVar[str] = "distance of the mesh from where the box is"
    unit: ClassVar[str] = "m"

    size: Vector3 = (0.2, 0.2, 0.05)
    height: float = 0.01
    speed: float = 1.0
    friction: float = 0.5
    seconds: float = 0.4

    def build(self) -> Scene:
        x, y, z = (edge / 2 for edge in self.size)
        corners = tuple((a, b, c) for a in (-x, x) for b in (-y, y) for c in (-z, z))
        thrown = Pose.at(0.0, 0.0, z + self.height), 1.0, self.friction
        box = Box("box", self.size, *thrown, linear_velocity=(self.speed, 0.0, 0.0))
        mesh = ConvexMesh("mesh", corners, *thrown, linear_velocity=(self.speed, 0.0, 0.0))
        beside = mesh.moved_to(mesh.pose.translated(y=3 * self.size[1]))
        return Scene(self.name, (box, beside), ground_friction=self.friction)

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        apart = seen.bodies[-1, 1, :3] - seen.bodies[-1, 0, :3] - [0.0, 3 * self.size[1], 0.0]
        allowed = 4 * self.speed * seen.dt + rounding(1.0, seen.steps)
        return Reading(float(np.linalg.norm(apart)), 0.0, allowed)
