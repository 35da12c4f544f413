"""One arm in one world: plan, send, follow, look again.

`pick`, `place` and `throw` are made of the verbs that a task may use too: `go_to`, `go_to_pose`,
`move_straight`, `move_along`, `follow`, `close_hand`, `open_hand`. Waiting is the world's:
`world.wait`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from pytest_simbench.client.world import Motion, World
from pytest_simbench.robot.choosing import Choice, choose
from pytest_simbench.robot.collision import PlanningScene
from pytest_simbench.robot.errors import PlanningError
from pytest_simbench.robot.grasping import grasp_of
from pytest_simbench.robot.kinematics import inverse_kinematics, tool_over, top_down_grasps
from pytest_simbench.robot.model import RobotModel
from pytest_simbench.robot.planning import MotionPlanner
from pytest_simbench.robot.throw import Throw
from pytest_simbench.scene import FloatArray, Pose, Trajectory
from pytest_simbench.tasks.base import CUBE_SIZE

APPROACH = 0.10
"""Height above a grasp or a place from which the tool comes straight down [m] (study code). It,
`IN_HAND` and `PUT_BACK_HEIGHT` go with the scene's scale."""

GRASP_TIME = 0.3
"""From closing the fingers to lifting [s]."""

RELEASE_TIME = 0.2
"""From opening the fingers to retreating [s]."""

IN_HAND = 0.04
"""A cube whose centre is farther than this from the tool centre point is not held [m]."""

PUT_BACK_HEIGHT = 0.005
"""How far above where it came from a cube is let go that could not be placed [m]."""

T = TypeVar("T")


@dataclass(frozen=True)
class Speeds:
    """Shares of the joint velocity limits at which the arm moves.

    Attributes:
        free: with an empty hand.
        carry: with a cube in the hand.
        contact: straight down to a cube, or with one to its place.
    """

    free: float = 1.0
    carry: float = 0.6
    contact: float = 0.3


FULL_SPEED = Speeds(1.0, 1.0, 1.0)
"""As the study moved (code: no velocity scaling)."""


class LostCube(Exception):
    """The cube is not in the hand where it should be; the message is the counted reason."""


class Manipulator:
    """The arm, its planner and what it holds.

    Motions start from the commanded set points, as a controller's do, and are planned against the
    cubes as the simulator has them now.

    Args:
        rng: of the repetition; drives everything random in planning.
        speeds: of its motions.
        scale: of the scene's lengths over those of the study's.

    Attributes:
        world: the simulated world.
        arm: commanded arm joints, (arm,) [rad].
        fingers: commanded finger position [m], of a jaw that turns [rad].
        grasp: how the hand grasps a cube.
        approach: `APPROACH`, scaled [m].
        held: name of the cube in the hand, or None.
    """

    def __init__(
        self,
        world: World,
        rng: np.random.Generator,
        speeds: Speeds | None = None,
        scale: float = 1.0,
    ) -> None:
        robot = world.scene.robot
        if robot is None:
            raise ValueError(f"scene {world.scene.name!r} has no robot")
        self.world = world
        self.gripper = robot.gripper
        self.rng = rng
        self.speeds = speeds or Speeds()
        self.scale = scale
        self.approach = APPROACH * scale
        with world.stopwatch.measuring("plan"):
            self.model = RobotModel(robot)
            self.grasp = grasp_of(robot, CUBE_SIZE * scale, scale)
            self.planning = PlanningScene(self.model, world.scene, scale)
            self.planner = MotionPlanner(self.model, self.planning, rng, world.scene.gravity)
        self.arm = robot.column("initial_position")[: self.model.arm]
        self.home = self.arm.copy()
        self.fingers = self.gripper.opened
        self.held: str | None = None
        self._released: tuple[str, ...] = ()
        self._origin = Pose()
        self._grip = Pose()
        self._released_at = world.time

    def pick(self, name: str) -> None:
        """Grasp a cube from above and lift it by `approach`.

        Raises:
            PlanningError: it cannot be reached.
            LostCube: it is not in the hand after lifting.
        """
        cube = self.world.pose(name)
        tools = [tool_over(cube, pose.yaw) for pose in top_down_grasps(cube)]
        down, above = self._plan_choice([self._aside(tool) for tool in tools], ignored=(name,))
        self.go_to(above, speed=self.speeds.free)
        self.move_straight(down, speed=self.speeds.contact, ignored=(name,))
        grasp = self._aside(down, back=True)
        if grasp != down:
            self.move_straight(grasp, speed=self.speeds.contact, ignored=(name,))
        self.close_hand(around=name, seen=cube)
        self.move_straight(
            grasp.translated(z=self.approach), speed=self.speeds.carry, ignored=(name,)
        )
        self.check_held()

    def place(self, target: Pose) -> None:
        """Bring the held cube to `target` [pose of its centre] and let it go there.

        The target's yaw may turn by quarters. Where the cube slipped in the hand it is
        not corrected for: that error is the simulator's.

        Raises:
            PlanningError: the place cannot be reached.
            LostCube: the cube fell on the way.
        """
        grips = [target * Pose.at(0, 0, 0, yaw=k * np.pi / 2) for k in range(-2, 2)]
        tools = [grip * self._grip.inverse() for grip in grips]
        down, above = self._plan_choice(tools)
        self.go_to(above, speed=self.speeds.carry)
        self.check_held()
        self.move_straight(down, speed=self.speeds.contact)
        self.open_hand()

    def throw(
        self, goal: FloatArray, fraction: float, *, feasible: bool
    ) -> tuple[Motion | None, Throw]:
        """Swing to arm joints `goal`, the fingers open at `fraction` of the swing's duration.

        Args:
            feasible: within the limits of the motors; else as the reference study swings.

        Returns:
            The motion, sampled at every step, and what a perfect follower's throw would be.
        """
        gripper = self.gripper
        trajectory, perfect = self._planned(
            lambda: self.planner.throw(
                self.arm, goal, gripper.closed, gripper.opened, fraction, feasible=feasible
            )
        )
        self.held = None
        self.planning.detach()
        return self.follow(trajectory, log_period=0.0), perfect

    def go_to(self, goal: FloatArray, *, speed: float) -> None:
        """Collision-free motion to arm joints `goal`, (arm,) [rad].

        Args:
            speed: share of the joint velocity limits.

        Raises:
            PlanningError: start or goal touch something, or no way was found.
        """
        self._refresh()
        self.follow(
            self._planned(lambda: self.planner.move_to(self.arm, goal, self.fingers, speed=speed))
        )

    def go_to_pose(self, tool: Pose, *, speed: float) -> None:
        """Collision-free motion of the tool centre point to a pose in the world.

        `robot.kinematics.tool_over` gives the pose of a tool that points down.

        Args:
            speed: share of the joint velocity limits.

        Raises:
            PlanningError: the pose is out of reach, touches something, or no way was found.
        """
        self._refresh()
        goal = self._planned(
            lambda: inverse_kinematics(
                self.model, tool, self.arm, self.rng,
                wanted=lambda arm: self.planning.collision(arm) is None,
            )
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
        self._refresh()
        self.follow(
            self._planned(
                lambda: self.planner.move_linear(
                    self.arm, tool, self.fingers, ignored=ignored, speed=speed
                )
            )
        )

    def move_along(
        self,
        poses: Sequence[Pose],
        *,
        tool_speed: float,
        ignored: tuple[str, ...] = (),
        log_period: float | None = None,
    ) -> Motion | None:
        """Motion of the tool centre point through poses in the world, without a stop.

        Args:
            poses: about 1 cm from each other.
            tool_speed: mean speed of the tool centre point [m/s].
            ignored: names of bodies that may be touched, for instance the one to be pushed.
            log_period: as of `follow`.

        Raises:
            PlanningError: the path leaves the workspace, or something else is in the way.
        """
        self._refresh()
        trajectory = self._planned(
            lambda: self.planner.move_along(
                self.arm, poses, self.fingers, tool_speed=tool_speed, ignored=ignored
            )
        )
        return self.follow(trajectory, log_period=log_period)

    def follow(self, trajectory: Trajectory, *, log_period: float | None = None) -> Motion | None:
        """Follow a trajectory of one's own; it must begin at the commanded set points.

        Args:
            log_period: between samples of the motion [s]; 0: each step, None: no samples.
        """
        motion = self.world.follow(trajectory, log_period=log_period)
        self.arm = trajectory.position[-1, : self.model.arm].copy()
        if self.gripper.joints:
            self.fingers = float(trajectory.position[-1, -1])
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
        self.planning.detach()
        self._move_fingers(self.gripper.opened, RELEASE_TIME)

    @property
    def tool(self) -> Pose:
        """Pose of the tool centre point in the world, as commanded."""
        return self.model.tool_pose(self.arm)

    def check_held(self) -> None:
        """See to it that the body in the hand is still there.

        Raises:
            LostCube: it is not.
        """
        if not self._in_hand():
            raise LostCube(f"{self.held} is not in the hand")

    def time_since_release(self) -> float:
        """Simulated seconds since the fingers were told to open."""
        return self.world.time - self._released_at

    def try_retreat(self) -> str | None:
        """Straight up from where a cube was let go, one jaw aside first; a sentence when that is
        not possible.

        The fingers may touch that cube: it may have turned a little between them.
        """
        return self._attempt("retreat", self._retreat)

    def _retreat(self) -> None:
        tool = self.tool
        aside = self._aside(tool)
        if aside != tool:
            self.move_straight(aside, speed=self.speeds.contact, ignored=self._released)
        above = aside.translated(z=self.approach)
        self.move_straight(above, speed=self.speeds.free, ignored=self._released)

    def _aside(self, tool: Pose, back: bool = False) -> Pose:
        """Where a hand that grasps at a tool pose comes down and leaves, or back from there."""
        beside = self.grasp.beside
        if beside == 0.0:
            return tool
        return tool * Pose.at(0.0, beside if back else -beside, 0.0)

    def try_go_home(self) -> str | None:
        """Back to the start position; a sentence when that is not possible."""
        return self._attempt("go home", lambda: self.go_to(self.home, speed=self.speeds.free))

    def recover(self) -> str | None:
        """After a failure: put a held cube back where it came from, open the hand, and leave what
        it stands too near to."""
        if self.held is None:
            return self._leave()  # and the hand is open
        problem = None
        if self._in_hand():
            above = self._origin.translated(z=PUT_BACK_HEIGHT * self.scale)
            problem = self._attempt("put back", lambda: self.place(above))
        if self.held is not None:
            self.open_hand()
        return problem or self.try_retreat()

    def _leave(self) -> str | None:
        """Straight up where something stands too near to plan from here."""
        self._refresh()
        touching = self.planning.collision(self.arm)
        if touching is None:
            return None
        self._released = tuple(name for name in touching if name in self.world.poses())
        return self.try_retreat()

    def _attempt(self, what: str, motion: Callable[[], None]) -> str | None:
        try:
            motion()
        except (PlanningError, LostCube) as error:
            return f"could not {what}: {error}"
        return None

    def _plan_choice(self, tools: list[Pose], ignored: tuple[str, ...] = ()) -> Choice:
        """The tool pose among equivalent ones to go to, and the arm joints `APPROACH` above it."""
        self._refresh()
        return self._planned(
            lambda: choose(
                self.planning, tools, self.approach, self.home, self.arm, self.rng, ignored
            )
        )

    def _move_fingers(self, target: float, hold: float) -> None:
        self.follow(
            self._planned(lambda: self.planner.move_fingers(self.arm, self.fingers, target, hold))
        )

    def _planned(self, plan: Callable[[], T]) -> T:
        with self.world.stopwatch.measuring("plan"):
            return plan()

    def _refresh(self) -> None:
        """Take the cubes' present poses over into the planning scene."""
        with self.world.stopwatch.measuring("plan"):
            self.planning.update(self.world.poses())
            self.planning.opening = self.fingers if self.held is None else self.grasp.touching
            if self.held is not None and self.planning.held != self.held:
                self.planning.attach(self.held, self._grip)

    def _in_hand(self) -> bool:
        if self.held is None:
            return False
        joints = self.world.joints[0, : self.model.arm]
        tool = np.array(self.model.tool_pose(joints).position)
        return bool(
            np.linalg.norm(tool - self.world.pose(self.held).position) < IN_HAND * self.scale
        )
