"""A law of planar pushing: a body that is pushed beside its centre turns."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.integrate import solve_ivp

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import GRAVITY, Law, Reading, rounding, watch
from pytest_simbench.scene import ConvexMesh, FloatArray, Pose, Scene, Wrench

SIDE, HEIGHT = 0.2, 0.04
"""Of the prism: a side of its triangle, and how high it is [m]."""

INSIDE = SIDE / math.sqrt(12)
"""From the prism's axis to its sides [m]."""

MOMENT = SIDE**2 / 12
"""Of inertia of 1 kg of it about its axis [kg m^2]."""

FEET: FloatArray = np.array([[-INSIDE, -SIDE / 2], [-INSIDE, SIDE / 2], [2 * INSIDE, 0.0]])
"""The corners that the prism stands on, from its axis (3, 2) [m]."""


@dataclass(frozen=True)
class PushTurns(Law):
    """A block that slides is pushed beside its centre, and turns as its limit surface says.

    The friction that the ground can give a sliding body is a surface in the space of force and
    torque, at the point whose normal is the body's twist (Goyal, Ruina and Papadopoulos, Planar
    sliding with dry friction, Wear 143 (1991) 307). Of most bodies nobody knows how their weight is
    spread over the ground. This one is a prism that stands on three corners, so it is known: each
    is pulled with mu N against its velocity, and what pulls below the centre of mass shifts the
    weight. The push is `push` times the friction of a straight slide, along x, on a line that is
    `aside` of the centre. Newton's and Euler's equations are integrated by DOP853 with a relative
    tolerance of 1e-9. Tolerance: late by one step, w dt, and the rate is late by one step all the
    time T, T dt times the largest angular acceleration.
    """

    name = "push_turns"
    phenomenon = "pushing"
    quantity: ClassVar[str] = "angle turned"
    unit: ClassVar[str] = "rad"

    push: float = 1.2
    aside: float = 0.02
    speed: float = 0.3
    friction: float = 0.4
    seconds: float = 0.6

    @property
    def force(self) -> float:
        """Of the push on a prism of 1 kg [N]."""
        return self.push * self.friction * GRAVITY

    def build(self) -> Scene:
        vertices = [(x, y, z) for x, y in FEET.tolist() for z in (-HEIGHT / 2, HEIGHT / 2)]
        prism = ConvexMesh(
            "prism",
            tuple(vertices),
            Pose.at(0.0, 0.0, HEIGHT / 2),
            1.0,
            self.friction,
            linear_velocity=(self.speed, 0.0, 0.0),
            wrenches=(
                Wrench(force=(self.force, 0.0, 0.0), torque=(0.0, 0.0, -self.aside * self.force)),
            ),
        )
        return Scene(self.name, (prism,), ground_friction=self.friction)

    def acceleration(self, angle: float, twist: FloatArray) -> FloatArray:
        """Of the prism: linear along x and y, and angular, (3,) [m/s^2, rad/s^2].

        Args:
            angle: that it has turned [rad].
            twist: velocity along x and y, and rate of turning, (3,) [m/s, rad/s].
        """
        cos, sin = math.cos(angle), math.sin(angle)
        feet = FEET @ np.array([[cos, sin], [-sin, cos]])
        across = feet @ np.array([[0.0, 1.0], [-1.0, 0.0]])  # each turned by 90 degrees
        velocities = twist[:2] + twist[2] * across
        along = velocities / np.linalg.norm(velocities, axis=1, keepdims=True)
        tips = feet - self.friction * HEIGHT / 2 * along
        loads = np.linalg.solve(np.vstack([np.ones(3), tips.T]), [GRAVITY, 0.0, 0.0])
        pulls = -self.friction * loads[:, None] * along
        x, y = pulls.sum(axis=0)
        turning = (across * pulls).sum() - self.aside * self.force
        return np.array([x + self.force, y, turning / MOMENT])

    def exact(self, seconds: float) -> FloatArray:
        """Angle [rad], rate [rad/s] and angular acceleration [rad/s^2] over a time, (3, 100)."""

        def change(_: float, state: FloatArray) -> FloatArray:
            return np.concatenate([state[3:], self.acceleration(state[2], state[3:])])

        times, start = np.linspace(0.0, seconds, 100), [0.0, 0.0, 0.0, self.speed, 0.0, 0.0]
        found = solve_ivp(change, (0.0, seconds), start, "DOP853", times, rtol=1e-9, atol=1e-12).y
        pulled = [self.acceleration(state[2], state[3:])[2] for state in found.T]
        return np.array([found[2], found[5], pulled])

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        row, time = seen.bodies[-1, 0], float(seen.t[-1])
        angle, rate, pulled = self.exact(time)
        allowed = (abs(rate[-1]) + float(np.abs(pulled).max()) * time) * seen.dt
        found = 2 * math.atan2(float(row[6]), float(row[3]))
        return Reading(found, float(angle[-1]), float(allowed) + rounding(1.0, seen.steps))
