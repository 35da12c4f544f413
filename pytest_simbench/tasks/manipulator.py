"""The arm that picks and places bodies of any shape, and throws cubes. And whether a robot can
grasp what a task has, which is asked before anything runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pytest_simbench.client.motion import Motion
from pytest_simbench.motion.collision import PlanningScene
from pytest_simbench.motion.errors import PlanningError
from pytest_simbench.motion.grasping import CLEARANCE, GRASP_LINK, Choice, Grasp, choose, grasp_of
from pytest_simbench.motion.grips import grips, turns
from pytest_simbench.motion.kinematics import top_down_grasps
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.throw import Throw
from pytest_simbench.scene import Body, Box, FloatArray, Pose, Robot, Scene, Vector3
from pytest_simbench.tasks.arm import Arm, LostBody
from pytest_simbench.tasks.base import CUBE_SIZE

APPROACH = 0.10
"""Height above a grasp or a place from which the tool comes straight down [m] (study code). It
and `PUT_BACK_HEIGHT` go with the scene's scale."""

PUT_BACK_HEIGHT = 0.005
"""How far above where it came from a cube is let go that could not be placed [m]."""


class Manipulator(Arm):
    """An arm with what the tasks do to bodies."""

    @property
    def approach(self) -> float:
        """`APPROACH`, scaled [m]."""
        return APPROACH * self.scale

    def pick(self, name: str, way: Vector3 | None = None) -> None:
        """Grasp a body from above and lift it by `approach`.

        Args:
            way: on which it is then to be carried straight [m]; the arm comes as can do so.

        Raises:
            Ungraspable: the hand cannot hold it as it lies; nothing has moved.
            PlanningError: it cannot be reached.
            LostBody: it is not in the hand after lifting.
        """
        seen = self.world.pose(name)
        grasp = self.reach_for(self.world.scene.body(name).moved_to(seen), (name,), way)
        self.close_hand(around=name, seen=seen)
        self.move_straight(
            grasp.translated(z=self.approach), speed=self.speeds.carry, ignored=(name,)
        )
        self.check_held()

    def reach_for(self, body: Body, ignored: tuple[str, ...], way: Vector3 | None = None) -> Pose:
        """Bring the open hand from above to where it grasps a body, or a part of something that is
        described as one; the pose of the tool there.

        Args:
            ignored: what may be touched: bodies, and links beside the arm.
            way: as of `pick`.

        Raises:
            Ungraspable: the hand cannot hold it as it lies; nothing has moved.
            PlanningError: it cannot be reached.
        """
        with self.world.stopwatch.measuring("plan"):
            widths = {grip.tool: grip.width for grip in grips(self.model.robot, body, self.scale)}
        down, above = self._plan_choice([self._aside(tool) for tool in widths], ignored, way)
        self.go_to(above, speed=self.speeds.free)
        self.move_straight(down, speed=self.speeds.contact, ignored=ignored)
        grasp = self._aside(down, back=True)
        if grasp != down:
            self.move_straight(grasp, speed=self.speeds.contact, ignored=ignored)
        if self.model.has_parallel_fingers:
            self.grasp = Grasp(widths[down] / 2)
        return grasp

    def place(self, target: Pose) -> None:
        """Bring the held body to `target` [pose of its centre] and let it go there.

        Raises:
            PlanningError: the place cannot be reached.
            LostBody: it fell on the way.
        """
        self.bring(target)
        self.open_hand()

    def bring(self, target: Pose) -> None:
        """Bring the held body to `target` [pose of its centre] from above.

        It may be turned about its own z axis by what leaves its shape as it is: a cube by quarters.
        Where it slipped in the hand it is not corrected for: that error is the simulator's.

        Raises:
            PlanningError: the place cannot be reached.
            LostBody: it fell on the way.
        """
        if self.held is None:
            raise LostBody("nothing is in the hand")
        ways = turns(self.world.scene.body(self.held))
        tools = [target * Pose.at(0, 0, 0, yaw=yaw) * self._grip.inverse() for yaw in ways]
        down, above = self._plan_choice(tools)
        self.go_to(above, speed=self.speeds.carry)
        self.check_held()
        self.move_straight(down, speed=self.speeds.contact)

    def throw(self, goal: FloatArray, fraction: float, *, feasible: bool) -> tuple[Motion, Throw]:
        """Swing to arm joints `goal`, the fingers open at `fraction` of the swing's duration.

        Args:
            feasible: within the limits of the motors; else as the reference study swings.

        Returns:
            The motion, sampled at every step, and what a perfect follower's throw would be.
        """
        gripper = self.gripper
        with self.world.stopwatch.measuring("plan"):
            trajectory, perfect = self.planner.throw(
                self.arm, goal, gripper.closed, gripper.opened, fraction, feasible=feasible
            )
        self.held = None
        self.planning.held = None
        return self.follow(trajectory, log_period=0.0), perfect

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
        with self._planning():
            touching = self.planning.collision(self.arm)
        if touching is None:
            return None
        self._released = tuple(name for name in touching if name in self.world.poses())
        return self.try_retreat()

    def _attempt(self, what: str, motion: Callable[[], None]) -> str | None:
        try:
            motion()
        except (PlanningError, LostBody) as error:
            return f"could not {what}: {error}"
        return None

    def _plan_choice(
        self, tools: list[Pose], ignored: tuple[str, ...] = (), way: Vector3 | None = None
    ) -> Choice:
        """The tool pose among equivalent ones to go to, and the arm joints `APPROACH` above it."""
        with self._planning():
            return choose(
                self.planning, tools, self.approach, self.home, self.arm, self.rng, ignored, way
            )


def cannot_handle(
    robot: Robot, fixed: Sequence[Box], places: Sequence[Pose], scale: float
) -> str | None:
    """Why a robot cannot grasp and place cubes from above at some places, in one sentence, or None.

    Args:
        robot: with its base.
        fixed: what stands in the way.
        places: of the cubes' centres.
        scale: of the scene over the study's.
    """
    model = RobotModel(robot)
    size = CUBE_SIZE * scale
    if not model.has_parallel_fingers and not model.has_one_jaw:
        return (
            f"robot {robot.name!r} has no hand with two parallel fingers to grasp a cube, nor one "
            "with a jaw that turns"
        )
    needed = size / 2 + CLEARANCE * scale
    if model.has_parallel_fingers and robot.gripper.opened < needed:
        return (
            f"robot {robot.name!r} opens its fingers to {robot.gripper.opened:g} m from the middle "
            f"and needs {needed:g} m for a cube of {size:g} m"
        )
    if model.has_one_jaw and robot.tool_frame != GRASP_LINK:  # `grasping` left it as it is
        return (
            f"robot {robot.name!r} opens its jaw to {robot.gripper.opened:g} rad, too little for a "
            f"cube of {size:g} m"
        )
    aside = Pose.at(0.0, -grasp_of(robot, size, scale).beside, 0.0)
    planning = PlanningScene(model, Scene("reach", tuple(fixed), robot), scale)
    rng = np.random.default_rng(0)
    for place in places:
        tools = [tool * aside for tool in top_down_grasps(place)]
        try:
            choose(planning, tools, APPROACH * scale, model.home, model.home, rng)
        except PlanningError as error:
            x, y, z = place.position
            return (
                f"robot {robot.name!r} cannot handle a cube at ({x:.2f}, {y:.2f}, {z:.2f}): "
                f"{error}; place its base elsewhere"
            )
    return None
