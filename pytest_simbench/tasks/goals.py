"""Tasks of a policy: bring the tool, a block or a cube to a goal that each seed draws anew.

Lengths are those of an arm of full reach; a smaller one has a smaller scene, as in `pushing`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.motion.model import grasping_scale_of, scale_of
from pytest_simbench.motion.panda import panda
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Box, Pose, Robot, Scene
from pytest_simbench.scene.policy import Observation, checked, name_of
from pytest_simbench.tasks.base import Count, Jitter, Outcome, Randomness, Task, cube
from pytest_simbench.tasks.pushing import BLOCK_MASS, BLOCK_SIZE, FRICTION, RED
from pytest_simbench.tasks.recorded import digest, recorded

HELD = 0.5
"""What is at its goal for so long [s] has come to stay."""

SETTLE = 0.2
"""Before the policy acts [s]."""

GREEN = (0.25, 0.65, 0.35, 1.0)


@dataclass(frozen=True)
class GoalTask(Task):
    """A policy acts until what it moves has stayed at the goal, or its time is over.

    Attributes:
        policy: whatever has `act`, or a function of an observation; see `scene.policy`.
        seconds: that it has [s], to the nearest period of the policy.
        tolerance: within which what is moved is at its goal [m].
        rate: how often the policy is asked [Hz]; None: as it says itself.
        command_latency, observation_delay: see `World.control` [s].
        inside: run the policy in the worker; it then acts for all of its time.
        settle: from the end of its time to the count [s].
        robot: None: the Panda.
    """

    shares_worker: ClassVar[bool] = True
    counted: ClassVar[str] = "goals reached"
    references: ClassVar[Mapping[str, float]] = {"success": 1.0, "distance": 0.0}
    moved: ClassVar[str | None] = None
    """Name of the body that is brought to the goal; None: the tool."""

    policy: Any
    seconds: float = 10.0
    tolerance: float = 0.02
    rate: float | None = None
    command_latency: float = 0.0
    observation_delay: float = 0.0
    inside: bool = False
    settle: float = 0.5
    robot: Robot | None = None

    def __post_init__(self) -> None:
        checked(self.tolerance, "the tolerance [m] of a goal", above=True)

    @cached_property  # asked at each observation
    def arm(self) -> Robot:
        """The robot that acts."""
        return self.robot or panda()

    @cached_property
    def scale(self) -> float:
        """All lengths over those of an arm of full reach."""
        return scale_of(self.arm)

    @property
    def metrics(self) -> tuple[Metric, ...]:
        what = "the tool" if self.moved is None else f"the {self.moved}"
        near = 100 * self.tolerance * self.scale
        return (
            Metric("success", "success", kind="yes_no", better="higher",
                   doc=f"{what} is within {near:g} cm of the goal at the end"),
            Metric("distance", "distance", unit="m", better="lower", least=0,
                   doc=f"of {what} from the goal at the end"),
            Metric("time", "time to goal", unit="s", better="lower", least=0,
                   doc="simulated time until it stayed there, of those that succeed"),
        )  # fmt: skip

    def smoke(self) -> GoalTask:
        return replace(self, seconds=min(self.seconds, 2.0))

    def parameters(self) -> dict[str, Any]:
        """The policy by its name, and by a digest of its source and of what it holds."""
        names = [item.name for item in fields(self) if item.name not in ("policy", "robot")]
        return {
            **{f"task.{name}": recorded(getattr(self, name)) for name in names},
            "task.policy": name_of(self.policy),
            "task.policy_digest": digest(self.policy),
        }

    @abstractmethod
    def goal(self, seed: int) -> Pose:
        """Where what is moved shall be."""

    def draw(self, seed: int, low: Any, high: Any) -> Any:
        """Numbers of a seed between two rows of bounds; each call gives the same."""
        return _drawn(seed, tuple(low), tuple(high)).copy()

    def distance(self, seen: Observation | World, seed: int) -> float:
        """Of what is moved from its goal [m]."""
        at = seen.tool if self.moved is None else seen.pose(self.moved)
        return float(np.linalg.norm(np.subtract(at.position, self.goal(seed).position)))

    def reached(self, seen: Observation | World, seed: int) -> bool:
        """Whether it is there."""
        return self.distance(seen, seed) <= self.tolerance * self.scale

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        with world.phase("settle start"):
            world.wait(SETTLE)
        began, stayed = world.time, self.stays(seed)
        world.mark("start")
        with world.phase("act"):
            world.control(
                self.policy,
                until=self.seconds if self.inside else stayed,
                at_most=self.seconds,
                rate=self.rate,
                seed=seed,
                command_latency=self.command_latency,
                observation_delay=self.observation_delay,
                inside=self.inside,
                goal=self.goal(seed),
            )
        world.mark("end")
        acted = world.time - began
        with world.phase("settle"):
            world.wait(self.settle)
        success = self.reached(world, seed)
        count(int(success), 1)
        metrics = {"success": float(success), "distance": self.distance(world, seed)}
        since = stayed.since if success else None
        ended = None if since is None or began + acted - since < HELD - 1e-9 else since - began
        return Outcome(
            {**metrics, "time": ended},
            {"goal": [*self.goal(seed).position], "acted": acted},
            reasons=() if success else (f"{self.moved or 'tool'} not at its goal",),
        )

    def stays(self, seed: int) -> Stays:
        """Whether what is moved has been at the goal for long enough, asked again and again."""
        return Stays(self, seed)


@dataclass
class Stays:
    """Tells it of each observation; `since` is the time [s] of the first one of the stay."""

    task: GoalTask
    seed: int
    since: float | None = None

    def __call__(self, seen: Observation) -> bool:
        if not self.task.reached(seen, self.seed):
            self.since = None
        elif self.since is None:
            self.since = seen.time
        return self.since is not None and seen.time - self.since >= HELD - 1e-9


@dataclass(frozen=True)
class Reaching(GoalTask):
    """Bring the tool to a point in front of the arm."""

    name: ClassVar[str] = "reaching"

    seconds: float = 5.0

    def goal(self, seed: int) -> Pose:
        return Pose.at(*self.scale * self.draw(seed, [0.35, -0.25, 0.15], [0.60, 0.25, 0.50]))

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        return Scene("reaching", (), self.arm)


@dataclass(frozen=True)
class PushingToGoal(GoalTask):
    """Push a block along the ground to a place up to 15 cm away, in any direction but towards the
    arm: 120 degrees to both sides of straight ahead."""

    name: ClassVar[str] = "pushing_to_goal"
    moved: ClassVar[str | None] = "block"

    seconds: float = 20.0

    @cached_property
    def arm(self) -> Robot:
        """Its surface is as slippery as the block's."""
        return replace(self.robot or panda(), friction=FRICTION)

    def begin(self, seed: int) -> Pose:
        """Of the block."""
        x, y, *_ = self.draw(seed, *self._bounds)
        return Pose.at(*np.multiply(self.scale, (x, y, BLOCK_SIZE[2] / 2)))

    def goal(self, seed: int) -> Pose:
        *_, way, angle = self.draw(seed, *self._bounds)
        way *= self.scale
        return self.begin(seed).translated(way * np.cos(angle), way * np.sin(angle))

    @property
    def _bounds(self) -> tuple[list[float], list[float]]:
        """Of the block's x and y [m], and of length [m] and direction [rad] of its way."""
        return [0.42, -0.08, 0.08, -2.1], [0.50, 0.08, 0.15, 2.1]

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        x, y, z = np.multiply(self.scale, BLOCK_SIZE)
        pose = jitter.disturbed(self.begin(seed), Randomness.of(seed).start)
        block = Box("block", (x, y, z), pose, BLOCK_MASS * self.scale**3, FRICTION, RED)
        return Scene("pushing to goal", (block,), self.arm, ground_friction=FRICTION)


@dataclass(frozen=True)
class PickAndPlace(GoalTask):
    """Pick a cube up from the ground, and put it on a block as high as itself."""

    name: ClassVar[str] = "pick_and_place"
    moved: ClassVar[str | None] = "cube"

    seconds: float = 20.0
    tolerance: float = 0.025

    @cached_property
    def scale(self) -> float:
        return grasping_scale_of(self.arm)

    def _places(self, seed: int) -> Any:
        """x and y of the cube, and of the block [m]."""
        return self.scale * self.draw(seed, [0.40, -0.20, 0.45, 0.08], [0.55, -0.06, 0.55, 0.20])

    def goal(self, seed: int) -> Pose:
        *_, x, y = self._places(seed)
        return Pose.at(x, y, 0.075 * self.scale)

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        size = 0.05 * self.scale
        x, y, *block = self._places(seed)
        pose = jitter.disturbed(Pose.at(x, y, size / 2), Randomness.of(seed).start)
        under = Pose.at(block[0], block[1], size / 2)
        stand = Box("stand", (2 * size, 2 * size, size), under, colour=GREEN)
        return Scene("pick and place", (cube("cube", pose, RED, self.scale), stand), self.arm)


@lru_cache(64)
def _drawn(seed: int, low: tuple[float, ...], high: tuple[float, ...]) -> Any:
    return Randomness.of(seed).order.uniform(low, high)
