"""Task 1 of the reference study: 21 cubes on a table, 15 of them to be stacked in 3 towers of 5.

All lengths here are those of the study's scene. That of a smaller arm is smaller
(`motion.model.grasping_scale_of`): places, cubes and thresholds shrink alike.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any, ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.motion.errors import PlanningError
from pytest_simbench.motion.grasping import grasping
from pytest_simbench.motion.model import grasping_scale_of
from pytest_simbench.motion.panda import panda
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Box, Pose, Robot, Scene
from pytest_simbench.scene.checks import check_count
from pytest_simbench.tasks.arm import FULL_SPEED, LostBody, Speeds
from pytest_simbench.tasks.base import (
    CUBE_SIZE,
    STUDY_TOLERANCE,
    Count,
    Jitter,
    Outcome,
    Randomness,
    Task,
    aside,
    cube,
    distance,
    scaled,
)
from pytest_simbench.tasks.manipulator import Manipulator, cannot_handle
from pytest_simbench.tasks.waiting import Slack, settle

TABLE_TOP = 0.30
"""Height of the table top [m] (study code, Webots)."""

TABLE = Box("table", (0.914, 0.914, TABLE_TOP), Pose.at(0.6, 0.0, TABLE_TOP / 2))
"""0.914 x 0.914 m, centred at x = 0.6 (study code, Webots), as a solid block."""

GRID = tuple(product((0.2, 0.3, 0.4), (-0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3)))
"""x and y of the 21 cubes [m] (study code)."""

TOWERS = ((0.5, -0.2), (0.5, 0.0), (0.5, 0.2))
"""x and y of the towers [m] (study code)."""

STRICT_DISTANCE = 0.01
STRICT_TILT = float(np.deg2rad(5.0))
"""A cube is strictly in its place within 1 cm in x, y and z, tilted by less than 5 degrees."""

UNTOUCHED_DISTANCE = 0.01
"""A cube that nobody handled counts as moved beyond this distance [m]."""

BLUE, RED = (0.20, 0.40, 0.75, 1.0), (0.80, 0.25, 0.20, 1.0)


@dataclass(frozen=True)
class Place:
    """Where a cube is to stand: its tower and level, counted from 0, and the pose."""

    tower: int
    level: int
    pose: Pose


@dataclass(frozen=True)
class Stacking(Task):
    """Stack `towers` towers of `levels` cubes; `study()` does it by the study's rules. The lengths
    are those of the study's scene; a smaller arm has a smaller one (`scale`).

    Attributes:
        towers: how many of the three.
        levels: cubes in each.
        spare_cubes: whether another cube is taken when a pick failed, as long as there are any; if
            not, its place stays empty.
        release_height: how far above its resting height a cube is let go [m].
        check_delay: to the count of *placed*, from the release or the retreat [s].
        count_after_retreat: whether the hand retreats before `check_delay` begins; if not, it
            waits and retreats after the count.
        finger_closed: position commanded to each finger to grasp [m]; None: the hand's own.
        speeds: of the arm.
        settle: from the end of the task to the count at the end [s].
        full_wait: wait all of it, else only while something can change (`waiting`).
        robot: that stacks; None: the Panda.
    """

    name: ClassVar[str] = "stacking"
    study_timeout: ClassVar[float] = 900.0
    counted: ClassVar[str] = "cubes placed"

    towers: int = 3
    levels: int = 5
    spare_cubes: bool = True
    release_height: float = 0.005
    check_delay: float = 0.5
    count_after_retreat: bool = False
    finger_closed: float | None = None
    speeds: Speeds = field(default_factory=Speeds)
    settle: float = 60.0
    full_wait: bool = False
    robot: Robot | None = None

    def __post_init__(self) -> None:
        check_count(self.towers, f"the number of towers of {self.name}", len(TOWERS))
        most = len(GRID) // self.towers
        check_count(self.levels, f"the number of levels of {self.name}", most)

    @cached_property
    def arm(self) -> Robot:
        """The robot that stacks, on its stand, its hand opening and closing as the task has it."""
        robot = self.robot or panda()
        if robot.stand is not None:
            robot = replace(robot, base=robot.stand)
        robot = grasping(robot, CUBE_SIZE * self.scale, self.scale)
        if self.finger_closed is None:
            return robot
        return replace(robot, gripper=replace(robot.gripper, closed=self.finger_closed))

    @cached_property
    def scale(self) -> float:
        """All lengths of the scene over those of the study's: 0.4 for the SO-101."""
        return grasping_scale_of(self.robot or panda())

    def parameters(self) -> dict[str, Any]:
        return super().parameters() | {"task.finger_closed": self.arm.gripper.closed}

    @property
    def cubes(self) -> int:
        """How many cubes are to be stacked."""
        return self.towers * self.levels

    @property
    def metrics(self) -> tuple[Metric, ...]:
        n = self.cubes
        loose, strict, moved = (
            f"{100 * limit * self.scale:g} cm"
            for limit in (STUDY_TOLERANCE, STRICT_DISTANCE, UNTOUCHED_DISTANCE)
        )
        counted = "the hand has retreated" if self.count_after_retreat else "release"
        return (
            Metric("placed", "placed", kind="share", of=n, study=True,
                   doc=f"within {loose} in x and y of the target, "
                       f"{self.check_delay:g} s after {counted}"),
            Metric("at_end", "at the end", kind="share", of=n, study=True,
                   doc=f"the same, {self.settle:g} s after the task ended"),
            Metric("placed_strict", "placed, strict", kind="share", of=n,
                   doc=f"within {strict} in x, y and z of the target and tilted by less than "
                       "5 degrees"),
            Metric("at_end_strict", "at the end, strict", kind="share", of=n,
                   doc=f"the same, {self.settle:g} s after the task ended"),
            Metric("towers", "towers complete", kind="share", of=self.towers,
                   doc="towers all of whose cubes are strictly in place at the end"),
            Metric("untouched_moved", "untouched moved", unit="cubes", better="lower", least=0,
                   doc=f"cubes nobody handled that are more than {moved} away from their start"),
            Metric("failed_picks", "failed picks", unit="picks", better="lower", least=0,
                   doc="cubes that could not be reached, planned for, or held"),
        )  # fmt: skip

    def smoke(self) -> Stacking:
        return replace(self, towers=1, levels=2, settle=2.0)

    def study(self) -> Stacking:
        """As the study counted (its code): one attempt for each place; dropped from about 2 cm; the
        hand opens, retreats, and 0.5 s later the cube is counted; fingers 0.020 m closed; full
        speed; again counted 60 s after the end."""
        return replace(
            self,
            spare_cubes=False,
            release_height=0.02,
            check_delay=0.5,
            count_after_retreat=True,
            finger_closed=0.02,
            speeds=FULL_SPEED,
            settle=60.0,
            full_wait=True,
        )

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        rng = Randomness.of(seed).start
        cubes = [
            cube(
                f"cube_{number:02d}",
                jitter.disturbed(start, rng),
                BLUE if number % 2 else RED,
                self.scale,
            )
            for number, start in enumerate(self._starts(), start=1)
        ]
        return Scene("stacking", (self.table, *cubes), self.arm)

    @property
    def table(self) -> Box:
        """The table of the scene's scale."""
        x, y, z = (self.scale * edge for edge in TABLE.size)
        return replace(TABLE, size=(x, y, z), pose=scaled(TABLE.pose.position, self.scale))

    def _starts(self) -> list[Pose]:
        return [scaled((x, y, TABLE_TOP + CUBE_SIZE / 2), self.scale) for x, y in GRID]

    def problem(self) -> str | None:
        """The hand is too narrow for the cubes, or a cube or a place out of reach."""
        drop = self.release_height * self.scale
        ends = [place.pose.translated(z=drop) for place in self.places()]
        return cannot_handle(self.arm, (self.table,), [*self._starts(), *ends], self.scale)

    def places(self) -> list[Place]:
        """Targets in the order in which they are filled."""
        return [
            Place(
                tower,
                level,
                scaled((*TOWERS[tower], TABLE_TOP + CUBE_SIZE * (level + 0.5)), self.scale),
            )
            for tower in range(self.towers)
            for level in range(self.levels)
        ]

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        randomness = Randomness.of(seed)
        with world.phase("settle start"):
            world.wait(0.2)
        start = world.poses()
        unused = [str(name) for name in randomness.order.permutation(sorted(start))]
        manipulator = Manipulator(world, randomness.planner, self.speeds, self.scale)
        picks = _Picks()
        world.mark("start")
        for place in self.places():
            while unused:
                done = self._stack(manipulator, unused.pop(0), place, picks)
                if done or not self.spare_cubes:
                    break
            count(len(picks.stacked), self.cubes)
        with world.phase("go home"):
            picks.note_motion(manipulator.try_go_home())
        world.mark("end")
        with world.phase("settle"):
            _, wait = settle(
                world,
                self.settle,
                lambda motion: self._slacks(start, world.poses(), picks),
                full=self.full_wait,
            )
        return replace(self._score(start, world.poses(), picks), wait=wait)

    def _slacks(
        self, start: Mapping[str, Pose], now: Mapping[str, Pose], picks: _Picks
    ) -> Iterator[Slack]:
        """Of every count of `_score` at the end."""
        for name, pose in now.items():
            if name in picks.stacked:
                place, _ = picks.stacked[name]
                loose = STUDY_TOLERANCE * self.scale - aside(place.pose, pose)
                yield Slack(name, "at_end", abs(loose))
                yield Slack(name, "at_end_strict", abs(_strictly(place, pose, self.scale)))
            if name not in picks.handled:
                moved = distance(pose, start[name]) - UNTOUCHED_DISTANCE * self.scale
                yield Slack(name, "untouched_moved", abs(moved))

    def _stack(self, manipulator: Manipulator, name: str, place: Place, picks: _Picks) -> bool:
        """Bring one cube to its place and count it; False when it could not be done."""
        world = manipulator.world
        where = f"cube {len(picks.stacked) + 1} of {self.cubes}"
        try:
            with world.phase(f"pick {where}"):
                manipulator.pick(name)
            picks.handled.add(name)
            with world.phase(f"place {where}"):
                manipulator.place(place.pose.translated(z=self.release_height * self.scale))
        except (PlanningError, LostBody) as error:
            picks.fail(name, place, error)
            if manipulator.held is not None:
                picks.handled.add(name)
            with world.phase(f"recover from {where}"):
                picks.note_motion(manipulator.recover())
            return False
        pause = self.check_delay - manipulator.time_since_release()
        if self.count_after_retreat:
            pause = self.check_delay
            self._retreat(manipulator, where, picks)
        with world.phase(f"check {where}"):
            world.wait(max(0.0, pause))
        picks.stacked[name] = (place, world.pose(name))
        if not self.count_after_retreat:
            self._retreat(manipulator, where, picks)
        return True

    def _retreat(self, manipulator: Manipulator, where: str, picks: _Picks) -> None:
        with manipulator.world.phase(f"retreat {where}"):
            picks.note_motion(manipulator.try_retreat())

    def _score(self, start: Mapping[str, Pose], end: Mapping[str, Pose], picks: _Picks) -> Outcome:
        stacked, n = picks.stacked, self.cubes
        ends = {name: (place, end[name]) for name, (place, _) in stacked.items()}
        standing = [item[0].tower for item in ends.values() if _strict(*item, self.scale)]
        complete = sum(standing.count(tower) == self.levels for tower in range(self.towers))
        untouched = {name: distance(end[name], start[name]) for name in end.keys() - picks.handled}
        least = UNTOUCHED_DISTANCE * self.scale
        moved = {name: untouched[name] for name in end if untouched.get(name, 0.0) > least}
        return Outcome(
            {
                "placed": sum(_placed(*item, self.scale) for item in stacked.values()) / n,
                "at_end": sum(_placed(*item, self.scale) for item in ends.values()) / n,
                "placed_strict": sum(_strict(*item, self.scale) for item in stacked.values()) / n,
                "at_end_strict": len(standing) / n,
                "towers": complete / self.towers,
                "untouched_moved": float(len(moved)),
                "failed_picks": float(len(picks.failed)),
            },
            {
                "picks": [
                    {
                        "cube": name,
                        "tower": place.tower,
                        "level": place.level,
                        "placed_error": error_of(place.pose, pose),
                        "end_error": error_of(place.pose, end[name]),
                    }
                    for name, (place, pose) in stacked.items()
                ],
                "failed_picks": picks.failed,
                "untouched_moved": moved,
                "notes": picks.notes,
            },
            reasons=tuple(pick["reason"] for pick in picks.failed),
        )


@dataclass
class _Picks:
    """What happened to which cube."""

    stacked: dict[str, tuple[Place, Pose]] = field(default_factory=dict)
    handled: set[str] = field(default_factory=set)
    failed: list[dict[str, Any]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def fail(self, name: str, place: Place, error: Exception) -> None:
        self.failed.append(
            {"cube": name, "tower": place.tower, "level": place.level, "reason": str(error)}
        )

    def note_motion(self, problem: str | None) -> None:
        if problem:
            self.notes.append(problem)


def _placed(place: Place, pose: Pose, scale: float = 1.0) -> bool:
    """Within the study's distance, scaled, and as it measures: height and order do not matter."""
    return aside(place.pose, pose) <= STUDY_TOLERANCE * scale


def _strict(place: Place, pose: Pose, scale: float = 1.0) -> bool:
    return _strictly(place, pose, scale) >= 0.0


def _strictly(place: Place, pose: Pose, scale: float) -> float:
    """How far a corner must move to leave what is strictly the place [m]; below 0: outside."""
    off = np.abs(np.subtract(pose.position, place.pose.position)).max()
    corner = np.sqrt(0.75) * CUBE_SIZE * scale
    return float(min(STRICT_DISTANCE * scale - off, (STRICT_TILT - pose.tilt()) * corner))


def error_of(target: Pose, pose: Pose) -> Sequence[float]:
    """Offset in x, y, z [m] and tilt [rad], rounded for the record."""
    offset = np.subtract(pose.position, target.position)
    return [*(round(float(value), 6) for value in offset), round(pose.tilt(), 5)]
