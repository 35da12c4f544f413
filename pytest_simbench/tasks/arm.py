"""One arm in one world: plan, send, follow, look again.

The verbs that tasks are made of: `go_to`, `go_to_pose`, `move_straight`, `move_along`, `follow`,
`close_hand`, `open_hand`. Waiting is the world's: `world.wait`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from pytest_simbench.client.motion import Motion
from pytest_simbench.client.world import World
from pytest_simbench.motion.collision import PlanningScene
from pytest_simbench.motion.grasping import grasp_of
from pytest_simbench.motion.kinematics import inverse_kinematics
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.planning import MotionPlanner
from pytest_simbench.scene import FloatArray, Pose, Trajectory
from pytest_simbench.tasks.base import CUBE_SIZE, distance

GRASP_TIME = 0.3
"""From closing the fingers to lifting [s]."""

RELEASE_TIME = 0.2
"""From opening the fingers to retreating [s]."""

IN_HAND = 0.04
"""A body that has moved by more than this in the hand is not held any more [m]. It goes with the
scene's scale."""


@dataclass(frozen=True)
class Speeds:
    """Shares of the joint velocity limits at which the arm moves.

    Attributes:
        free: with an empty hand.
        carry: with something in the hand.
        contact: straight down to a body, or with one to its place.
    """

    free: float = 1.0
    carry: float = 0.6
    contact: float = 0.3


FULL_SPEED = Speeds(1.0, 1.0, 1.0)
"""As the study moved (code: no velocity scaling)."""


class LostBody(Exception):
    """A body is not in the hand where it should be; the message is the counted reason."""


class Arm:
    """The arm, its planner and what it holds.

    Motions start from the commanded set points, as a controller's do, and are planned against the
    cubes as the simulator has them now.

    Args:
        rng: of the repetition; drives everything random in planning.
        speeds: of its motions.
        scale: of the scene's lengths over those of the study's.

    Attributes:
        world: the simulated world.
        home: arm joints where it begins, (arm,) [rad].
        arm: commanded arm joints, (arm,) [rad].
        fingers: commanded finger position [m], of a jaw that turns [rad].
        grasp: how the hand grasps: at first a cube, then what it picked last.
        held: name of the body in the hand, or None.
    """

    def __init__(
        self,
        world: World,
        rng: np.random.Generator,
        speeds: Speeds | None = None,
        scale: float = 1.0,
    ) -> None:
        robot = world.scene.arm
        self.world = world
        self.gripper = robot.gripper
        self.rng = rng
        self.speeds = speeds or Speeds()
        self.scale = scale
        with world.stopwatch.measuring("plan"):
            self.model = RobotModel(robot)
            self.grasp = grasp_of(robot, CUBE_SIZE * scale, scale)
            self.planning = PlanningScene(self.model, world.scene, scale)
            self.planner = MotionPlanner(self.model, self.planning, rng, world.scene.gravity)
        self.home = self.arm = self.model.home
        self.fingers = self.gripper.opened
        self.held: str | None = None
        self._released: tuple[str, ...] = ()
        self._origin = Pose()
        self._grip = Pose()
        self._released_at = world.time

    def go_to(self, goal: FloatArray, *, speed: float) -> None:
        """Collision-free motion to arm joints `goal`, (arm,) [rad].

        Args:
            speed: share of the joint velocity limits.

        Raises:
            PlanningError: start or goal touch something, or no way was found.
        """
        with self._planning():
            trajectory = self.planner.move_to(self.arm, goal, self.fingers, speed=speed)
        self.follow(trajectory)

    def go_to_pose(self, tool: Pose, *, speed: float) -> None:
        """Collision-free motion of the tool centre point to a pose in the world.

        `motion.kinematics.tool_over` gives the pose of a tool that points down.

        Args:
            speed: share of the joint velocity limits.

        Raises:
            PlanningError: the pose is out of reach, touches something, or no way was found.
        """
        with self._planning():
            goal = inverse_kinematics(
                self.model, tool, self.arm, self.rng,
                wanted=lambda arm: self.planning.collision(arm) is None,
            )  # fmt: skip
        self.go_to(goal, speed=speed)

    def move_straight(self, tool: Pose, *, speed: float, ignored: tuple[str, ...] = ()) -> None:
        """Motion of the tool centre point along a straight line to a pose in the world.

        Args:
            speed: share of the joint velocity limits.
            ignored: names of bodies that may be touched, for instance the one to be pushed.

        Raises:
            PlanningError: the line leaves the workspace, or something else is in the way.
        """
        with self._planning():
            trajectory = self.planner.move_linear(
                self.arm, tool, self.fingers, ignored=ignored, speed=speed
            )
        self.follow(trajectory)

    def move_along(
        self,
        poses: Sequence[Pose],
        *,
        tool_speed: float,
        ignored: tuple[str, ...] = (),
        log_period: float | None = None,
    ) -> Motion:
        """Motion of the tool centre point through poses in the world, without a stop.

        Args:
            poses: about 1 cm from each other.
            tool_speed: mean speed of the tool centre point [m/s].
            ignored: names of bodies that may be touched, for instance the one to be pushed.
            log_period: as of `follow`.

        Raises:
            PlanningError: the path leaves the workspace, or something else is in the way.
        """
        with self._planning():
            trajectory = self.planner.move_along(
                self.arm, poses, self.fingers, tool_speed=tool_speed, ignored=ignored
            )
        return self.follow(trajectory, log_period=log_period)

    def follow(self, trajectory: Trajectory, *, log_period: float | None = None) -> Motion:
        """Follow a trajectory of one's own; it must begin at the commanded set points.

        Args:
            log_period: between samples of the motion [s]; 0: each step, None: no samples.
        """
        motion = self.world.follow(trajectory, log_period=log_period)
        self.arm = trajectory.position[-1, : self.model.arm].copy()
        if self.gripper.joints:
            self.fingers = float(trajectory.position[-1, self.model.arm])
        return motion

    def close_hand(self, around: str | None = None, seen: Pose | None = None) -> None:
        """Close the fingers, and wait for `GRASP_TIME`.

        Args:
            around: name of the body between them: from now on it is `held`, and is planned for.
            seen: its pose before the hand came; by default where it is before the fingers close.
        """
        if around is not None and seen is None:
            seen = self.world.pose(around)
        self._move_fingers(self.gripper.closed, GRASP_TIME)
        if around is not None and seen is not None:
            self.held, self._origin = around, seen
            self._grip = self.tool.inverse() * seen

    def open_hand(self) -> None:
        """Open the fingers, let go of what they hold, and wait for `RELEASE_TIME`."""
        self._released_at = self.world.time
        self._released = (self.held,) if self.held else self._released
        self.held = None
        self.planning.held = None
        self._move_fingers(self.gripper.opened, RELEASE_TIME)

    @property
    def tool(self) -> Pose:
        """Pose of the tool centre point in the world, as commanded."""
        return self.model.tool_pose(self.arm)

    def check_held(self) -> None:
        """See to it that the body in the hand is still there.

        Raises:
            LostBody: it is not.
        """
        if not self._in_hand():
            raise LostBody(f"{self.held} is not in the hand")

    def time_since_release(self) -> float:
        """Simulated seconds since the fingers were told to open."""
        return self.world.time - self._released_at

    def _move_fingers(self, target: float, hold: float) -> None:
        with self.world.stopwatch.measuring("plan"):
            trajectory = self.planner.move_fingers(self.arm, self.fingers, target, hold)
        self.follow(trajectory)

    @contextmanager
    def _planning(self) -> Iterator[None]:
        """What is done is planning, among the cubes as they lie now; its time is measured."""
        with self.world.stopwatch.measuring("plan"):
            self.planning.update(self.world.poses(), self.world.joints[0])
            self.planning.opening = self.fingers if self.held is None else self.grasp.touching
            if self.held is not None and self.planning.held != self.held:
                self.planning.attach(self.held, self._grip)
            yield

    def _in_hand(self) -> bool:
        if self.held is None:
            return False
        tool = self.model.tool_pose(self.world.joints[0, : self.model.arm])
        return distance(tool * self._grip, self.world.pose(self.held)) < IN_HAND * self.scale
