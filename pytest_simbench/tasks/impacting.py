"""Real impacts of a square on a table: is the simulated velocity after it the real one?

A repetition is one impact of one corner. It starts shortly before it, as the real one's free flight
says, and ends while the real one flies freely again. docs/reality.md has what the data can bear.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.data import impacts as square
from pytest_simbench.data.impacts import Impact, Impacts
from pytest_simbench.data.measured import Half
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Box, FloatArray, Pose, Scene
from pytest_simbench.tasks.base import Count, Jitter, Outcome
from pytest_simbench.tasks.measured import MeasuredTask

BEFORE, AFTER = 0.010, 0.020
"""From the start to the impact, and from it to the comparison [s]: a contact that takes some steps
has ended, and the real square is within its arc of 36 ms."""

FRICTION, RESTITUTION = 0.12, 0.45
"""What suits Poisson's impact law best on the impacts that are not held out (docs/reality.md)."""

MASS = 0.1
"""[kg]. The source has none, and none is needed: it cancels."""

THICK = 0.1
"""Of the table, which lies on the ground [m]."""

AMBER, GREY = (0.85, 0.60, 0.20, 1.0), (0.60, 0.60, 0.60, 1.0)


@dataclass(frozen=True)
class Impacting(MeasuredTask[Impact]):
    """Let a square strike the table with a corner as it really did.

    It is a cube that strikes with a whole edge, and nothing holds it in its plane: whatever leaves
    the plane is an error too. The table is a box, since a half-space can take an edge by one of its
    ends (docs/reality.md).

    Attributes:
        impacts: the real ones.
        half: which of them: by default those on which nothing was chosen.
        friction: Coulomb coefficient of square and table.
        restitution: Newton's coefficient of both; engines without restitution take no notice.
        most: how many impacts; None: all.
    """

    name: ClassVar[str] = "impacting"
    data: ClassVar[str] = square.NAME
    smallest: ClassVar[int | None] = 5
    references: ClassVar[Mapping[str, float]] = {"velocity_error": 0.0, "relative_error": 0.0}

    impacts: Impacts
    half: Half = "held_out"
    friction: float = FRICTION
    restitution: float = RESTITUTION
    most: int | None = None

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (
            Metric("velocity_error", "velocity error", unit="m/s", better="lower", least=0,
                   doc="of the velocity after the impact; one of rotation counts as that speed of "
                       "the centre which has the same energy"),
            Metric("relative_error", "relative error", unit="%", better="lower", least=0,
                   doc="the velocity error in percent of the real velocity right after the impact"),
        )  # fmt: skip

    @property
    def chosen(self) -> tuple[Impact, ...]:
        """The impacts that repetitions go through, in the order of their numbers."""
        return self.impacts.half(self.half)[: self.most]

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        impact = self.real(seed)
        place, velocity = impact.flying(BEFORE)
        x, z, angle = map(float, place - [impact.place[0], -THICK, 0.0])
        turned = (math.cos(angle / 2), 0.0, -math.sin(angle / 2), 0.0)
        table = Box(
            "table",
            (1.0, 1.0, THICK),
            Pose.at(0.0, 0.0, THICK / 2),
            0.0,
            self.friction,
            GREY,
            restitution=self.restitution,
        )
        box = Box(
            "square",
            (square.SIDE,) * 3,
            Pose((x, 0.0, z), turned),
            MASS,
            self.friction,
            AMBER,
            moments=(MASS * square.MOMENT,) * 3,
            restitution=self.restitution,
            linear_velocity=(float(velocity[0]), 0.0, float(velocity[1])),
            angular_velocity=(0.0, -float(velocity[2]), 0.0),
        )
        return Scene(
            self.name,
            (box, table),
            ground_friction=self.friction,
            ground_restitution=self.restitution,
        )

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        impact = self.real(seed)
        with world.phase("impact"):
            world.wait(BEFORE + AFTER)
        (state,) = world.bodies
        real = impact.left(world.time - BEFORE)
        error = off(state, real)
        return Outcome(
            {
                "velocity_error": error,
                "relative_error": 100 * error / float(np.linalg.norm(impact.after * square.SCALE)),
            },
            {
                "impact": impact.number,
                "after": [float(state[7]), float(state[9]), -float(state[11])],
                "real_after": real.tolist(),
                "aside": abs(float(state[1])),
            },
        )


def off(state: FloatArray, real: FloatArray) -> float:
    """How far a cube's velocity is from a real one in the plane [m/s].

    Args:
        state: a row of `World.bodies`, (13,).
        real: velocities of x, z [m/s] and of the angle from x to z [rad/s], (3,).
    """
    x, z, turn = real
    apart = state[7:13] - [x, 0.0, z, 0.0, -turn, 0.0]
    return float(np.linalg.norm(apart * np.repeat([1.0, square.SCALE[2]], 3)))
