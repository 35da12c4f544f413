"""A third task, not of the study: push a block with the closed hand, along a line or round a curve.

The hand moves slowly, so theory says where the block goes: it stays at rest against the hand, on a
line always, and on a curve that is not too sharp (`smallest_turning_radius`). What a simulator adds
to that (creep along the hand, a turn, a lead, a tilt) is its error.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.optimize import brentq

from pytest_simbench.client.motion import Motion
from pytest_simbench.client.world import World
from pytest_simbench.description.robot_files import robot_cache
from pytest_simbench.motion.collision import PlanningScene
from pytest_simbench.motion.errors import PlanningError, Unreachable
from pytest_simbench.motion.kinematics import inverse_kinematics, tool_over, tool_path
from pytest_simbench.motion.model import RobotModel, scale_of
from pytest_simbench.motion.panda import panda
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Box, FloatArray, Pose, Robot, Scene, Vector3
from pytest_simbench.tasks.arm import Arm
from pytest_simbench.tasks.base import Count, Jitter, Moment, Outcome, Randomness, Task, distance
from pytest_simbench.tasks.manipulator import APPROACH

BLOCK_SIZE = (0.10, 0.10, 0.05)
"""[m]. It slides before it tips wherever the hand touches it: mu times its height is a quarter of
its length."""

BLOCK_MASS = 0.2
"""[kg]: light wood, 0.4 g/cm^3. The arm's springs give way by less than 1 mm to push it."""

FRICTION = 0.5
"""Of ground, block and hand. With 1.0, as between the study's cubes, a hand that gives way jams on
the block's edge: it is pressed down, and the harder it pushes, the harder."""

START = Pose.at(0.45, 0.0, BLOCK_SIZE[2] / 2)
"""Of the block: on the ground, in the middle of where arms of 0.85 m work."""

TOOL_HEIGHT = 0.035
"""Of the tool centre point [m]: the fingertips touch the upper half of the block, and what is wider
above them clears it by 9 mm."""

GAP = 0.01
"""Between hand and block before the push [m]."""

SPACING = 0.01
"""Of the way points [m]."""

SAMPLING = 0.02
"""Between samples of the block's way [s]."""

TIPPED = math.radians(10.0)
"""A block is tipped beyond this tilt [rad]: what it creeps and sinks is a tenth of it."""

RED = (0.80, 0.25, 0.20, 1.0)


@dataclass(frozen=True)
class Pushing(Task):
    """Push a block.

    Attributes:
        length: of the way of the block's centre [m]. This, like all lengths here, is that of an arm
            of full reach; a smaller one has a smaller scene (`scale`).
        turn: by which the block's heading turns on the way, evenly [rad]; 0: a straight line.
        tool_speed: mean speed of the hand [m/s], scaled as the lengths are. At 0.05 a block that is
            let go slides on by 0.25 mm (v^2 / 2 mu g), so the push is quasi-static.
        settle: from the end of the push to the count [s].
        robot: that pushes; None: the Panda.
    """

    name: ClassVar[str] = "pushing"
    counted: ClassVar[str] = "blocks pushed"
    moments: ClassVar[tuple[Moment, ...]] = (Moment("before the push", "push"),)

    length: float = 0.2
    turn: float = 0.0
    tool_speed: float = 0.05
    settle: float = 1.0
    robot: Robot | None = None

    @cached_property
    def arm(self) -> Robot:
        """The robot that pushes, its surface as slippery as the block's."""
        return replace(self.robot or panda(), friction=FRICTION)

    @cached_property
    def scale(self) -> float:
        """All lengths and the speed over those of an arm of full reach: 0.5 for the SO-101."""
        return scale_of(self.arm)

    @cached_property
    def way(self) -> float:
        """How far the block's centre goes [m]."""
        return self.length * self.scale

    @cached_property
    def block(self) -> Vector3:
        """Edges of the block [m]."""
        x, y, z = BLOCK_SIZE
        return x * self.scale, y * self.scale, z * self.scale

    @cached_property
    def begin(self) -> Pose:
        """Of the block."""
        return Pose.at(*(self.scale * part for part in START.position))

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (
            Metric("position_error", "position error", unit="m", better="lower", least=0,
                   doc="distance of the block's centre from the end of its way, "
                       f"{self.settle:g} s after the push"),
            Metric("heading_error", "heading error", unit="deg", better="lower", least=0,
                   doc="angle of the block to the end of its way, then"),
            Metric("path_error", "path error", unit="m", better="lower", least=0,
                   doc="largest distance of the block's centre from its way during the push"),
            Metric("tipped", "tipped", kind="yes_no", better="lower",
                   doc="the block tilted by more than 10 degrees at any time"),
        )  # fmt: skip

    @property
    def references(self) -> Mapping[str, float]:  # type: ignore[override]
        """Of quasi-static theory, where it keeps the block at rest against the hand."""
        if abs(self.turn) * self.sharpest > self.way:
            return {}
        return {"position_error": 0.0, "heading_error": 0.0, "path_error": 0.0}

    @property
    def sharpest(self) -> float:
        """Radius of the sharpest curve round which the hand can push the block [m]."""
        _, width = _front(self.arm)
        return smallest_turning_radius(self.block[0], self.block[1], width)

    def smoke(self) -> Pushing:
        return replace(self, length=self.length / 4, turn=self.turn / 4)

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        pose = jitter.disturbed(self.begin, Randomness.of(seed).start)
        block = Box("block", self.block, pose, BLOCK_MASS * self.scale**3, FRICTION, RED)
        return Scene("pushing", (block,), self.arm, ground_friction=FRICTION)

    def at(self, way: float) -> Pose:
        """The block when its centre has gone so far along its way [m]; before the start, which is
        at 0, the way is straight."""
        if way <= 0.0 or self.turn == 0.0:
            return self.begin.translated(x=way)
        radius, angle = self.way / self.turn, way / self.way * self.turn
        moved = self.begin.translated(x=radius * math.sin(angle), y=radius * (1 - math.cos(angle)))
        return moved * Pose.at(0.0, 0.0, 0.0, yaw=angle)

    def tools(self) -> list[Pose]:
        """Tool poses of the push, from behind the block to the end of its way."""
        depth, _ = _front(self.arm)
        height = TOOL_HEIGHT * self.scale
        behind = Pose.at(-self.block[0] / 2 - depth, 0.0, height - self.begin.position[2])
        gap = GAP * self.scale
        steps = math.ceil((GAP + self.length) / SPACING)
        ways = np.linspace(-gap, self.way, steps + 1)
        return [tool_over(self.at(float(way)) * behind, self._heading(float(way))) for way in ways]

    def problem(self) -> str | None:
        """The way is out of reach."""
        robot, rng = self.arm, np.random.default_rng(0)
        model = RobotModel(robot)
        first, *others = self.tools()
        over = first.translated(z=APPROACH * self.scale)
        try:
            above = inverse_kinematics(model, over, model.home, rng)
            tool_path(model, inverse_kinematics(model, first, above), others)
        except Unreachable as error:
            return f"robot {robot.name!r} cannot push the block: {error}; place its base elsewhere"
        return None

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        with world.phase("settle start"):
            world.wait(0.2)
        hand = Arm(world, Randomness.of(seed).planner)
        first, *others = self.tools()
        pushed: Motion | None = None
        details: dict[str, object] = {}
        world.mark("start")
        try:
            with world.phase("approach"):
                hand.close_hand()
                above = first.translated(z=APPROACH * self.scale)
                hand.go_to_pose(above, speed=hand.speeds.free)
                hand.move_straight(first, speed=hand.speeds.contact)
            with world.phase("push"):
                pushed = hand.move_along(
                    others,
                    tool_speed=self.tool_speed * self.scale,
                    ignored=("block",),
                    log_period=SAMPLING,
                )
        except PlanningError as error:
            details["failed_push"] = str(error)
        world.mark("end")
        with world.phase("settle"):
            world.wait(self.settle)
        return self._score(world.pose("block"), pushed, count, details)

    def _score(
        self, end: Pose, pushed: Motion | None, count: Count, details: dict[str, object]
    ) -> Outcome:
        goal = self.at(self.way)
        error = distance(end, goal)
        rows = np.empty((0, 13)) if pushed is None else pushed.bodies[:, 0]
        tilt = max(_tilt(pose) for pose in (end, *map(Pose.from_array, rows)))
        count(int(error < GAP * self.scale), 1)
        return Outcome(
            {
                "position_error": error,
                "heading_error": math.degrees(abs((goal.inverse() * end).yaw)),
                "path_error": self._off_the_way(rows[:, :3]) if len(rows) else None,
                "tipped": float(tilt > TIPPED),
            },
            {**details, "end": [*end.position, *end.quaternion], "largest_tilt": tilt},
        )

    def _heading(self, way: float) -> float:
        return max(0.0, way) / self.way * self.turn

    def _off_the_way(self, positions: FloatArray) -> float:
        """Largest distance on the ground from the way [m]."""
        ways = np.linspace(0.0, self.way, 1 + math.ceil(self.way / 1e-4))  # to 0.05 mm
        points = np.array([self.at(float(way)).position[:2] for way in ways])
        gaps = np.linalg.norm(positions[:, None, :2] - points[None], axis=2)
        return float(gaps.min(axis=1).max())


@dataclass(frozen=True)
class CurvePushing(Pushing):
    """Push a block round a curve, by default of 45 degrees and a radius of 25 cm. It is a task of
    its own: a line and a curve are no rivals in a table."""

    name: ClassVar[str] = "pushing_curve"

    turn: float = 0.785


@robot_cache
def _front(robot: Robot) -> tuple[float, float]:
    """Of the closed hand where it can touch the block."""
    planning = PlanningScene(RobotModel(robot), Scene("front", (), robot))
    return planning.front((BLOCK_SIZE[2] - TOOL_HEIGHT) * scale_of(robot))


def _tilt(pose: Pose) -> float:
    """Of the block's top from the horizontal [rad], up to pi: a block on its side is no upright
    one, as a cube would be."""
    return math.acos(float(np.clip(pose.rotation()[2, 2], -1.0, 1.0)))


def lever(points: FloatArray, radius: float) -> float:
    """How far beside the centre the pushing force must act, in a curve of the centre along the
    block's heading [m].

    Args:
        points: that bear equal shares of the load, x along the heading, from the centre [m],
            (n, 2).
        radius: of the curve [m].
    """
    x, y = points.T
    velocity = np.stack([1.0 - y / radius, x / radius])
    resisting = velocity / np.linalg.norm(velocity, axis=0)
    torque = x * resisting[1] - y * resisting[0]
    return float(torque.sum() / resisting[0].sum())


def smallest_turning_radius(length: float, width: float, contact: float) -> float:
    """The sharpest curve on which a block that stands on its corners stays at rest against the hand
    that pushes it [m].

    A flat pusher keeps a block at rest against itself as long as the force that the motion needs
    acts within their contact (Lynch and Mason, Stable Pushing, 1996). Friction under the block
    decides where that is: each point that bears it resists with mu times its load against its own
    velocity (Coulomb; Goyal, Ruina, Papadopoulos, Planar sliding with dry friction, 1991). How the
    load is spread does not matter for mu, but for the lever. It is greatest where the corners bear
    all, as they do in engines.

    Args:
        length, width: edges of the block on the plane, along and across its heading [m].
        contact: width of the face that pushes, at the block's middle [m].
    """
    corners = np.array([[x, y] for x in (-length / 2, length / 2) for y in (-width / 2, width / 2)])
    farthest = length**2 / contact  # from where on the lever is (length / 2)^2 / radius
    return float(
        brentq(lambda r: lever(corners, r) - contact / 2, 0.51 * width, 10 * farthest + width)
    )
