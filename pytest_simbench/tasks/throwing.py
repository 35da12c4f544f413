"""Task 2 of the reference study: throw a cube at a pyramid of six.

A cube of the pyramid counts as moved when the thrown cube did it (`impact`); what moves for another
reason has a metric of its own. How the throw left the hand is told apart from how it flew: the
landing is computed from the state at the release, and what the simulated flight makes of it is
the integrator's part.

All lengths here are those of the study's scene. That of a smaller arm is smaller
(`motion.model.grasping_scale_of`), and its throw slower: speeds of flights go with the square root.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from pytest_simbench.client.motion import Motion
from pytest_simbench.client.world import World
from pytest_simbench.description.robot_files import robot_cache
from pytest_simbench.motion.errors import PlanningError, RobotError
from pytest_simbench.motion.grasping import grasping
from pytest_simbench.motion.model import RobotModel, grasping_scale_of
from pytest_simbench.motion.panda import panda
from pytest_simbench.motion.throw import LANDING_HEIGHT, Throw, feasible_swing, released, swing_of
from pytest_simbench.motion.timing import synchronised_move
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import STANDARD_GRAVITY, Pose, Robot, Scene
from pytest_simbench.tasks.arm import LostBody, Speeds
from pytest_simbench.tasks.base import (
    CUBE_SIZE,
    STUDY_TOLERANCE,
    Count,
    Jitter,
    Moment,
    Outcome,
    Randomness,
    Task,
    aside,
    cube,
    scaled,
)
from pytest_simbench.tasks.manipulator import Manipulator, cannot_handle
from pytest_simbench.tasks.throw_analysis import Thrown, impact
from pytest_simbench.tasks.waiting import Slack, settle

PROJECTILE = Pose.at(0.5, 0.0, CUBE_SIZE / 2)
"""The cube to be thrown lies on the ground (study code)."""

PYRAMID_X = 1.4
PYRAMID = (
    (-0.065, 0.025), (0.0, 0.025), (0.065, 0.025), (-0.0335, 0.075), (0.0335, 0.075), (0.0, 0.125),
)  # fmt: skip
"""y and z of the six cubes of the pyramid [m] (study code)."""

AFTER_THROW = 1.0
"""For so long after the swing the motion is sampled at every step [s]: flight and impact."""

STUDY_SPEEDS = Speeds(free=0.5, carry=0.5, contact=0.5)
"""Of every motion before the throw, the wind-up too (study code, throw_moveit.cpp; other versions
of it and REFERENCE_STUDY know 0.1 for the wind-up)."""

SETTLE_START = 1.0
"""Before anything begins [s]."""

GREEN, RED = (0.25, 0.60, 0.30, 1.0), (0.80, 0.25, 0.20, 1.0)


@dataclass(frozen=True)
class Throwing(Task):
    """Throw one cube at the pyramid.

    Attributes:
        release_fraction: share of the throw's duration at which the fingers open (study: 0.5).
        wind_up_speed: share of the joint velocity limits while winding up.
        speeds: of the arm while picking the cube up.
        feasible: the swing keeps within the limits of the arm's motors; else it is the study's,
            which does not.
        by_throw: only what the thrown cube moved counts as moved; else, as in the study, every cube
            that is elsewhere in the end.
        settle: from the throw to the count [s] (study: 60).
        full_wait: wait all of it, else only while something can change (`waiting`).
        robot: that throws; None: the Panda.
    """

    name: ClassVar[str] = "throwing"
    counted: ClassVar[str] = "cubes moved"
    moments: ClassVar[tuple[Moment, ...]] = (
        Moment("in the grip", "wind up"),
        Moment("after the swing", "throw", 1),
    )
    pictured: ClassVar[tuple[str, ...]] = ("throw",)

    release_fraction: float = 0.5
    wind_up_speed: float = 0.25
    speeds: Speeds = field(default_factory=Speeds)
    feasible: bool = True
    by_throw: bool = True
    settle: float = 60.0
    full_wait: bool = False
    robot: Robot | None = None

    @cached_property
    def arm(self) -> Robot:
        """The robot that throws, its tool centre point in the middle of the cube."""
        robot = self.robot or panda()
        return grasping(robot, CUBE_SIZE * self.scale, self.scale, wide=True)

    @cached_property
    def scale(self) -> float:
        """All lengths of the scene over those of the study's: 0.4 for the SO-101."""
        return grasping_scale_of(self.robot or panda())

    @property
    def metrics(self) -> tuple[Metric, ...]:
        by_throw = ", by the thrown cube" if self.by_throw else ""
        far = f"{100 * STUDY_TOLERANCE * self.scale:g} cm"
        height = f"z = {LANDING_HEIGHT * self.scale:g}"
        return (
            Metric("moved", "moved", kind="share", of=len(PYRAMID), study=True, better=None,
                   doc=f"cubes of the pyramid off by more than {far}, {self.settle:g} s after"
                       f"{by_throw}"),
            Metric("hit", "hit", kind="yes_no", doc="at least one cube of the pyramid moved"),
            Metric("moved_otherwise", "moved otherwise", unit="cubes", better="lower", least=0,
                   doc=f"cubes of the pyramid off by more than {far}, not by the thrown cube"),
            Metric("lost_in_transit", "lost in transit", kind="yes_no", better="lower",
                   doc="the cube left the hand before its release"),
            Metric("landing_x", "landing x", unit="m", better=None,
                   doc=f"where a ballistic flight from the release crosses {height}"),
            Metric("landing_error", "landing error", unit="m", better="lower", least=0,
                   doc="distance of that from a perfect follower's"),
            Metric("flight_error", "flight error", unit="m", better="lower", least=0,
                   doc="distance from that to where the simulated flight, up to its first contact, "
                       f"crosses {height}"),
            Metric("release_speed", "release speed", unit="m/s", better=None,
                   doc="of the cube as its free flight begins"),
            Metric("release_velocity_error", "release velocity error", unit="m/s", better="lower",
                   least=0, doc="against a perfect follower"),
            Metric("release_position_error", "release position error", unit="m", better="lower",
                   least=0, doc="against a perfect follower"),
            Metric("release_time_error", "release late by", unit="s", better="lower",
                   doc="start of the free flight after the commanded opening"),
            Metric("limits", "limits", unit="%", better=None, least=0,
                   doc="the throw as executed: largest share of the arm's limits of velocity, "
                       "acceleration and torque"),
        )  # fmt: skip

    @property
    def references(self) -> Mapping[str, float]:  # type: ignore[override]
        """Of a perfect follower, from the trajectory."""
        throw = perfect_throw(self.arm, self.release_fraction, self.feasible, self.scale)
        landing = throw.landing(np.array(STANDARD_GRAVITY))
        assert landing is not None
        return {"landing_x": landing, "release_speed": float(np.linalg.norm(throw.velocity))}

    def smoke(self) -> Throwing:
        return replace(self, settle=2.0)

    def study(self) -> Throwing:
        """The study's throw and count; each difference stands in docs/study.md."""
        return replace(
            self,
            wind_up_speed=0.5,
            speeds=STUDY_SPEEDS,
            feasible=False,
            by_throw=False,
            full_wait=True,
        )

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        rng = Randomness.of(seed).start
        start = jitter.disturbed(scaled(PROJECTILE.position, self.scale), rng)
        cubes = [cube("projectile", start, RED, self.scale)]
        for number, (y, z) in enumerate(PYRAMID, start=1):
            pose = jitter.disturbed(scaled((PYRAMID_X, y, z), self.scale), rng)
            cubes.append(cube(f"pyramid_{number}", pose, GREEN, self.scale))
        return Scene("throwing", tuple(cubes), self.arm)

    def problem(self) -> str | None:
        """It has no swing, or cannot pick the cube up."""
        try:
            swing_of(self.arm)
        except RobotError as error:
            return str(error)
        start = scaled(PROJECTILE.position, self.scale)
        return cannot_handle(self.arm, (), [start], self.scale)

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        with world.phase("settle start"):
            world.wait(SETTLE_START)
        before = world.poses()
        manipulator = Manipulator(world, Randomness.of(seed).planner, self.speeds, self.scale)
        world.mark("start")
        metrics: dict[str, float | None] = {metric.name: None for metric in self.metrics}
        details: dict[str, object] = {}
        reasons: list[str] = []
        thrown: Thrown | None = None
        try:
            with world.phase("pick"):
                manipulator.pick("projectile")
            with world.phase("wind up"):
                manipulator.go_to(swing_of(self.arm)[0], speed=self.wind_up_speed)
            with world.phase("throw"):
                thrown = self._throw(manipulator)
            metrics |= thrown.metrics()
            details |= thrown.details()
            reasons += [str(details[key]) for key in ("lost", "kept") if key in details]
        except LostBody as error:
            metrics["lost_in_transit"], details["lost"] = 1.0, str(error)
            reasons.append(str(error))
        except PlanningError as error:
            details["failed_pick"] = str(error)
            reasons.append(str(error))
        world.mark("end")
        far = STUDY_TOLERANCE * self.scale
        pyramid = [name for name in before if name != "projectile"]
        pushed: dict[str, float] = {}

        def pushes(settling: Motion) -> dict[str, float]:
            return {} if thrown is None else _pushes(thrown, settling, world.scene, self.scale)

        def slacks(settling: Motion) -> Iterator[Slack]:
            nonlocal pushed
            pushed = pushes(settling)
            for name in pyramid:
                off = aside(before[name], world.pose(name))
                yield Slack(name, "moved", abs(off - far))
                if off > far and name in pushed:
                    yield Slack(name, "moved by the throw", abs(pushed[name]))

        with world.phase("settle"):
            settling, wait = settle(world, self.settle, slacks, full=self.full_wait)
        off = [name for name in pyramid if aside(before[name], world.pose(name)) > far]
        if not wait.bound:
            pushed = pushes(settling)
        hit = [name for name in off if pushed.get(name, 0.0) > 0.0]
        moved = hit if self.by_throw else off
        count(len(moved), len(PYRAMID))
        metrics["moved"], metrics["hit"] = len(moved) / len(PYRAMID), float(bool(moved))
        metrics["moved_otherwise"] = float(len(off) - len(hit))
        details["moved"] = moved
        details["moved_otherwise"] = [name for name in off if name not in hit]
        details["projectile_end"] = list(world.pose("projectile").position)
        return Outcome(metrics, details, wait=wait, reasons=tuple(reasons))

    def _throw(self, manipulator: Manipulator) -> Thrown:
        """Swing, let go, and look on."""
        world = manipulator.world
        started = world.time
        swing, perfect = manipulator.throw(
            swing_of(self.arm)[1], self.release_fraction, feasible=self.feasible
        )
        motion = Motion.joined([swing, world.wait(AFTER_THROW, log_period=0.0)])
        thrown = Thrown(
            manipulator.model, motion, world.scene, "projectile", started, perfect, self.scale
        )
        if thrown.flight is not None:
            world.note("release", float(motion.time[thrown.flight.first]))
            if thrown.flight.last < len(motion) - 1:
                world.note("impact", float(motion.time[thrown.flight.last]))
        return thrown


@robot_cache
def perfect_throw(
    robot: Robot, release_fraction: float, feasible: bool, scale: float = 1.0
) -> Throw:
    """The swing and the release of a perfect follower."""
    model = RobotModel(robot)
    start, goal = swing_of(robot)
    held = cube("projectile", PROJECTILE, RED, scale)
    timed, duration = (
        feasible_swing(model, start, goal, np.array(STANDARD_GRAVITY), held)
        if feasible
        else synchronised_move(start, goal, model.limits)
    )
    return released(model, timed, duration, release_fraction, scale)


def _pushes(thrown: Thrown, settling: Motion, scene: Scene, scale: float) -> dict[str, float]:
    """Of each body whose motion the thrown cube began (see `impact`): how much farther the throw
    carried it than it crept on since [m]; infinite where the throw took it out of its place. Above
    0 the throw moved it; what creeps a little farther is its doing."""
    log = Motion.joined([thrown.motion, settling])
    names = [body.name for body in scene.free_bodies]
    own = names.index("projectile")
    others = [index for index in range(len(names)) if index != own]
    found = impact(
        log.time, log.bodies[:, own, :7], log.bodies[:, others, :7], CUBE_SIZE * scale, thrown.free
    )
    first, rest, last = (log.bodies[row, others, :3] for row in (0, found.rest, -1))
    carried, since = (np.linalg.norm(b - a, axis=1) for a, b in ((first, rest), (rest, last)))
    away = np.abs(rest - first)[:, :2].max(axis=1) > STUDY_TOLERANCE * scale
    more = np.where(away, np.inf, carried - since)
    return {names[others[i]]: float(more[i]) for i in found.caused}
