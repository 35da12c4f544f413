"""Task 2 of the reference study: throw a cube at a pyramid of six."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from pytest_simbench.client.world import Motion, World
from pytest_simbench.measure.metrics import Metric
from pytest_simbench.robot.panda import panda
from pytest_simbench.robot.planning import PlanningError
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.tasks.base import (
    CUBE_SIZE,
    STUDY_TOLERANCE,
    Count,
    Jitter,
    Outcome,
    Task,
    cube,
    generators,
)
from pytest_simbench.tasks.manipulator import LostCube, Manipulator
from pytest_simbench.tasks.throw_analysis import OUT_OF_HAND, free_flight, landing_x

PROJECTILE = Pose.at(0.5, 0.0, CUBE_SIZE / 2)
"""The cube to be thrown lies on the ground (study code)."""

PYRAMID_X = 1.4
PYRAMID = (
    (-0.065, 0.025), (0.0, 0.025), (0.065, 0.025), (-0.0335, 0.075), (0.0335, 0.075), (0.0, 0.125),
)  # fmt: skip
"""y and z of the six cubes of the pyramid [m] (study code)."""

WIND_UP = (0.0, -1.65, 0.0, -0.1, 0.0, 3.6, 0.8)
THROW_END = (0.0, 0.9, 0.0, -1.1, 0.0, 1.9, 0.8)
"""Arm joints before and after the throw [rad] (study code)."""

LANDING_HEIGHT = 0.05
REFERENCE_LANDING_X = 1.352
"""Where the cube of a perfect follower crosses z = 0.05 [m] (Pinocchio and Ruckig)."""

GREEN, RED = (0.25, 0.60, 0.30, 1.0), (0.80, 0.25, 0.20, 1.0)


@dataclass(frozen=True)
class Throwing(Task):
    """Throw one cube at the pyramid.

    Attributes:
        release_fraction: share of the throw's duration at which the fingers open (study: 0.5).
        wind_up_speed: share of the joint velocity limits while winding up.
        settle: from the throw to the count [s] (study: 60).
    """

    name: ClassVar[str] = "throwing"
    study_timeout: ClassVar[float] = 600.0
    references: ClassVar[Mapping[str, float]] = {"landing_x": REFERENCE_LANDING_X}

    release_fraction: float = 0.5
    wind_up_speed: float = 0.25
    settle: float = 60.0

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (
            Metric("moved", "moved", kind="share", of=len(PYRAMID), study=True,
                   doc=f"cubes of the pyramid off by more than 5 cm, {self.settle:g} s after"),
            Metric("hit", "hit", kind="yes_no", doc="at least one cube of the pyramid moved"),
            Metric("lost_in_transit", "lost in transit", kind="yes_no", better="lower",
                   doc="the cube left the hand before its release"),
            Metric("landing_x", "landing x", unit="m", better=None,
                   doc="where its free flight crosses z = 0.05"),
            Metric("landing_error", "landing error", unit="m", better="lower",
                   doc="distance of that from a perfect follower's"),
            Metric("release_speed", "release speed", unit="m/s", better=None,
                   doc="of the cube as its free flight begins"),
            Metric("release_velocity_error", "release velocity error", unit="m/s", better="lower",
                   doc="against a perfect follower"),
            Metric("release_position_error", "release position error", unit="m", better="lower",
                   doc="against a perfect follower"),
            Metric("release_time_error", "release late by", unit="s", better="lower",
                   doc="start of the free flight after the commanded opening"),
        )  # fmt: skip

    def smoke(self) -> Throwing:
        return replace(self, settle=2.0)

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        rng = generators(seed)[0]
        cubes = [cube("projectile", jitter.disturbed(PROJECTILE, rng), RED)]
        for number, (y, z) in enumerate(PYRAMID, start=1):
            pose = jitter.disturbed(Pose.at(PYRAMID_X, y, z), rng)
            cubes.append(cube(f"pyramid_{number}", pose, GREEN))
        return Scene("throwing", tuple(cubes), panda())

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        with world.phase("settle start"):
            world.wait(1.0)
        before = world.poses()
        manipulator = Manipulator(world, generators(seed)[2])
        world.mark("start")
        metrics: dict[str, float | None] = {metric.name: None for metric in self.metrics}
        details: dict[str, object] = {}
        try:
            with world.phase("pick"):
                manipulator.pick("projectile")
            with world.phase("wind up"):
                manipulator.go_to(np.array(WIND_UP), speed=self.wind_up_speed)
            with world.phase("throw"):
                metrics |= self._throw(manipulator, details)
            metrics["lost_in_transit"] = float(bool(details.get("lost")))
        except LostCube as error:
            metrics["lost_in_transit"], details["lost"] = 1.0, str(error)
        except PlanningError as error:
            details["failed_pick"] = str(error)
        world.mark("end")
        with world.phase("settle"):
            world.wait(self.settle)
        moved = [n for n in before if n != "projectile" and _moved(before[n], world.pose(n))]
        count(len(moved), len(PYRAMID))
        metrics["moved"], metrics["hit"] = len(moved) / len(PYRAMID), float(bool(moved))
        details["moved"] = moved
        details["projectile_end"] = list(world.pose("projectile").position)
        return Outcome(metrics, details)

    def _throw(
        self, manipulator: Manipulator, details: dict[str, object]
    ) -> dict[str, float | None]:
        world = manipulator.world
        assert world.scene.robot is not None
        started = world.time
        trajectory, reference = manipulator.plan_throw(np.array(THROW_END), self.release_fraction)
        motion = Motion.joined(
            [
                motion
                for motion in (
                    world.follow(trajectory, log_period=0.0),
                    world.wait(1.0, log_period=0.0),
                )
                if motion is not None
            ]
        )
        index = [body.name for body in world.scene.free_bodies].index("projectile")
        cube_states = motion.bodies[:, index]
        tool = manipulator.tool_positions(motion.joints[:, 0])
        gravity = np.asarray(world.scene.gravity)
        time = motion.time - started
        apart = np.linalg.norm(cube_states[:, :3] - tool, axis=1)
        early = (apart > OUT_OF_HAND) & (time < reference.time)
        if early.any():
            details["lost"] = f"left the hand {time[np.argmax(early)]:.3f} s into the throw"
        fingers = motion.joints[:, 0, world.scene.robot.finger_indices]
        flight = free_flight(time, cube_states[:, :3], cube_states[:, 7:10], tool, fingers, gravity)
        if flight is None:
            return {}
        position, velocity = cube_states[flight.first, :3], cube_states[flight.first, 7:10]
        last = cube_states[flight.last]
        landing = landing_x(last[:3], last[7:10], gravity, LANDING_HEIGHT)
        details["release"] = {
            "time": float(time[flight.first]),
            "position": position,
            "velocity": velocity,
            "reference_time": reference.time,
            "reference_position": reference.position,
            "reference_velocity": reference.velocity,
        }
        return {
            "landing_x": landing,
            "landing_error": abs(landing - REFERENCE_LANDING_X),
            "release_speed": float(np.linalg.norm(velocity)),
            "release_velocity_error": float(np.linalg.norm(velocity - reference.velocity)),
            "release_position_error": float(np.linalg.norm(position - reference.position)),
            "release_time_error": float(time[flight.first] - reference.time),
        }


def _moved(before: Pose, after: Pose) -> bool:
    """As the study counts: farther than 5 cm in x or in y."""
    x, y, _ = np.abs(np.subtract(after.position, before.position))
    return bool(x > STUDY_TOLERANCE or y > STUDY_TOLERANCE)
