"""Real tosses of a cube, simulated from where the hand let go: how far from the truth?

A repetition is one toss. It starts as the real one did, and position and attitude are compared at
every sample of the real one until it lies at rest. The measure is the literature's (Acosta, Yang,
Posa, RA-L 2022, arXiv 2110.00541). docs/reality.md has what was published.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from pytest_simbench.client.motion import Motion
from pytest_simbench.client.world import World
from pytest_simbench.data import tosses as cube
from pytest_simbench.data.measured import Half
from pytest_simbench.data.tosses import Toss, Tosses
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Box, FloatArray, Scene
from pytest_simbench.tasks.base import Count, Jitter, Outcome
from pytest_simbench.tasks.measured import MeasuredTask, poses_at

ACRYLIC = (0.25, 0.45, 0.80, 1.0)

CUBE = "cube"


@dataclass(frozen=True)
class Tossing(MeasuredTask[Toss]):
    """Toss a cube as it was really tossed.

    Lengths and velocities are taken as the source has them, though all its lengths read 2 % short
    (docs/reality.md).

    Attributes:
        tosses: the real ones.
        half: which of them: by default those on which no settings were chosen.
        friction: Coulomb coefficient of cube and table.
        most: how many of them; None: all.
    """

    name: ClassVar[str] = "tossing"
    data: ClassVar[str] = cube.NAME
    smallest: ClassVar[int | None] = 5
    references: ClassVar[Mapping[str, float]] = {"position_error": 0.0, "rotation_error": 0.0}

    tosses: Tosses
    half: Half = "held_out"
    friction: float = cube.FRICTION
    most: int | None = None

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (
            Metric("position_error", "position error", unit="%", better="lower", least=0,
                   doc="distance of the cube's centre from the real one's, mean over the time of "
                       "the toss, in percent of the cube's edge"),
            Metric("rotation_error", "rotation error", unit="deg", better="lower", least=0,
                   doc="angle of the cube to the real one, mean over the time of the toss"),
        )  # fmt: skip

    @property
    def chosen(self) -> tuple[Toss, ...]:
        """The tosses that repetitions go through, in the order of their numbers."""
        return self.tosses.half(self.half)[: self.most]

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        toss = self.real(seed)
        box = Box(
            CUBE,
            (cube.EDGE,) * 3,
            toss.start,
            cube.MASS,
            self.friction,
            ACRYLIC,
            moments=(cube.INERTIA,) * 3,
            linear_velocity=toss.linear_velocity,
            angular_velocity=toss.angular_velocity,
        )
        return Scene("tossing", (box,), ground_friction=self.friction)

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        toss = self.real(seed)
        start = Motion(np.array([world.time]), world.joints[None], world.bodies[None])
        with world.phase("toss"):
            flown = world.wait(toss.duration, log_period=0.0)
        motion = Motion.joined([start, flown])
        errors = off(toss, motion.time, motion.bodies[:, 0])
        distance, angle = (float(np.mean(error)) for error in errors)
        return Outcome(
            {
                "position_error": 100 * distance / cube.EDGE,
                "rotation_error": float(np.rad2deg(angle)),
            },
            {"toss": toss.index, "at_end": [float(error[-1]) for error in errors]},
        )


def off(toss: Toss, time: FloatArray, states: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How far a simulated cube is from the real one at each of its samples.

    Between two steps it moves evenly, and at the end it may be half a step short.

    Args:
        toss: the real one.
        time: of the steps [s], (n,), from 0.
        states: of the simulated cube, (n, 13) or wider: position, quaternion w, x, y, z.

    Returns:
        distances [m] and angles [rad], each as long as the toss.
    """
    at = np.minimum(toss.time, time[-1])
    position, turned = poses_at(at, time, states)
    distance = np.linalg.norm(position - toss.state[:, :3], axis=1)
    real = Rotation.from_quat(toss.state[:, 3:7], scalar_first=True)
    return distance, np.asarray((real.inv() * turned).magnitude())
