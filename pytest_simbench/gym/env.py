"""A Gymnasium environment: episodes of one task on one simulator, in a worker that is kept."""

from __future__ import annotations

import weakref
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import InvalidAction, ResetNeeded, UnsupportedMode
from gymnasium.spaces import Box, Dict
from numpy.typing import NDArray

from pytest_simbench.client.closed_loop import ClosedLoop, Looking
from pytest_simbench.client.errors import Diverged, WorkerError
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.motion.servo import Servo
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.scene.plausibility import implausible
from pytest_simbench.scene.policy import Command, Rhythm
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks.base import Jitter
from pytest_simbench.tasks.goals import GoalTask

ACTIONS = ("tool", "joints")
REWARDS = ("dense", "sparse")

SPEED, TURN = 0.5, 1.5
"""Of the tool under the largest action [m/s], [rad/s]: at 10 Hz 5 cm a step, as much as in
Gymnasium-Robotics' Fetch."""

JOINT_SPEED = 1.0
"""Of a joint under the largest action [rad/s]: half of what the Panda's slowest can (2.175)."""

PICTURE = 480, 480
"""Width and height [pixels]."""

SETTLE = 0.2
"""Before an episode [s], as in the task's own `perform`."""

Seen = dict[str, FloatArray]


class TaskEnv(gymnasium.Env[Any, Any]):
    """One task on one simulator; `making.make` makes it.

    An observation has the parts of a goal environment, so that hindsight replay can be used:
    `observation`, and the place that is reached and the one that is wanted, (3,) each [m].
    An episode ends when the goal was held (terminated), its time is over, or the simulation
    crashed (truncated; `info["crashed"]` says why, and the next reset starts a new worker).

    Args:
        task: its policy is not asked.
        case: simulator and settings.
        rhythm: of the steps.
        actions, reward, render_mode: see `making.make`.
    """

    def __init__(
        self,
        task: GoalTask,
        case: Case,
        rhythm: Rhythm,
        actions: str = "tool",
        reward: str = "dense",
        render_mode: str | None = None,
    ) -> None:
        draws = Capability.OFFSCREEN in adapter(case.simulator).info.capabilities
        modes = ["rgb_array"] if draws else []
        self.metadata = {"render_modes": modes, "render_fps": rhythm.rate}
        self.render_mode = render_mode
        self.task, self.rhythm, self._actions, self._reward = task, rhythm, actions, reward
        self._looking = Looking(picture=PICTURE if render_mode else None)
        self._jitter = Jitter(Jitter.distance * case.jitter, Jitter.angle * case.jitter)
        folder = TemporaryDirectory(prefix="simbench-gym-")  # for the worker's log
        self._handle = SimulatorHandle(replace(case, folder=Path(folder.name)))
        weakref.finalize(self, _tidy, self._handle, folder)
        self._loop: ClosedLoop | None = None
        self._observed: Seen = {}
        self._info: dict[str, Any] = {}
        self._used = False
        scene = task.scene(0, Jitter(0.0, 0.0))
        self._servo = Servo(scene)
        robot, self._arm = self._servo.model.robot, self._servo.model.arm
        numbers = 3 * len(robot.joints) + 9 + 15 * len(scene.free_bodies)
        seen, place = (Box(-np.inf, np.inf, (n,), np.float64) for n in (numbers, 3))
        self.observation_space = Dict(observation=seen, achieved_goal=place, desired_goal=place)
        self._fingers = len(robot.finger_indices) > 0
        moved = 4 if actions == "tool" else self._arm
        self.action_space = Box(-1.0, 1.0, (moved + self._fingers,), np.float64)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Seen, dict[str, Any]]:
        """A new episode: the scene and the goal of the seed, or of one that chance draws.

        Raises:
            WorkerError: the simulator cannot be started, or cannot load the scene.
        """
        super().reset(seed=seed)
        self._seed = seed if seed is not None else int(self.np_random.integers(2**31))
        self._leave()
        used = self._used
        try:
            self._begin()
        except WorkerError:
            self.close()
            if not used:
                raise
            self._begin()  # in a new worker
        self._used = True
        return self._observed, self._info

    def _begin(self) -> None:
        task, rhythm = self.task, self.rhythm
        world = self._world = self._handle.world(task.scene(self._seed, self._jitter))
        world.process.deadline = None  # silence alone ends a worker
        world.process.where.seed = self._seed
        with world.phase("settle start"):
            world.wait(SETTLE)
        world.process.where.phase = "act"
        self._servo = Servo(world.scene)
        self._left = max(1, round(task.seconds * rhythm.rate))
        self._loop = ClosedLoop(
            world.process, world.scene, rhythm,
            timestep=self._handle.constructed.settings["timestep"],
            seconds=(self._left + 1) / rhythm.rate,  # it is asked after the last step, too
            kinematics=self._servo, looking=self._looking, goal=task.goal(self._seed),
        )  # fmt: skip
        self._position = self._loop.now.told[0]
        self._stays = task.stays(self._seed)
        self._look(self._loop)

    def step(self, action: FloatArray) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Act for one period.

        Raises:
            ResetNeeded: no episode has begun, or it is over.
            InvalidAction: of another shape, or not finite.
        """
        if self._loop is None:
            raise ResetNeeded("no episode is under way: call reset()")
        command = self._command(checked(action, self.action_space))
        crashed = ""
        try:
            self._loop.reply(command)
            self._look(self._loop)
        except WorkerError as error:
            crashed = error.what
            self.close()
            self._observed = {name: row.copy() for name, row in self._observed.items()}
            self._info = {**self._info, "crashed": crashed}
        except BaseException:  # Ctrl-C: an answer is under way that nobody waits for
            self.close()
            raise
        self._left -= 1
        terminated = self._held and not crashed
        truncated = not terminated and (bool(crashed) or self._left == 0)
        if terminated or truncated:
            self._leave()
        seen, info = self._observed, self._info
        reward = self.compute_reward(seen["achieved_goal"], seen["desired_goal"], info)
        return seen, float(reward), terminated, truncated, info

    def _command(self, action: FloatArray) -> Command:
        period, model, width = 1 / self.rhythm.rate, self._servo.model, None
        if self._fingers:
            hand = model.robot.gripper
            finger = np.interp(action[-1], (-1.0, 1.0), (hand.closed, hand.opened))
            width = float(finger / self._servo.finger(1.0))
        if self._actions == "tool":
            x, y, z, yaw = period * np.array([SPEED, SPEED, SPEED, TURN]) * action[:4]
            return Command(tool_change=(x, y, z, 0.0, 0.0, yaw), gripper=width)
        wanted = self._position[: self._arm] + period * JOINT_SPEED * action[: self._arm]
        self._position = np.clip(wanted, model.lower, model.upper)
        return Command(position=self._position, gripper=width)

    def _look(self, loop: ClosedLoop) -> None:
        """Take in what there is to see. A delay does not delay what counts."""
        shown, now, task, seed = loop.observation, loop.now, self.task, self._seed
        if wrong := implausible(self._world.scene, now.bodies):
            raise Diverged(wrong, self._world.process.where)
        self._held = self._stays(now)
        self._picture = now.picture
        self._info = {
            "is_success": bool(task.reached(now, seed)),
            "distance": task.distance(now, seed),
            "time": now.time,
            "seed": seed,
        }
        tool = shown.tool
        moved = tool if task.moved is None else shown.pose(task.moved)
        bodies = ((*told(Pose.from_array(row)), *row[7:]) for row in shown.bodies)
        rows = shown.position, shown.velocity, shown.told[0], told(tool), *bodies
        self._observed = {
            "observation": np.concatenate([np.asarray(row) for row in rows]),
            "achieved_goal": np.array(moved.position),
            "desired_goal": np.array(task.goal(seed).position),
        }

    def compute_reward(self, achieved_goal: Any, desired_goal: Any, info: Any) -> Any:
        """Of one place or of many, (..., 3)."""
        distance = np.linalg.norm(np.subtract(achieved_goal, desired_goal), axis=-1)
        if self._reward == "dense":
            return -distance
        return np.where(distance <= self.task.tolerance * self.task.scale, 0.0, -1.0)

    def render(self) -> NDArray[np.uint8] | None:
        """The picture of the newest state, (height, width, 3)."""
        if self._looking.picture is None:
            raise UnsupportedMode("make the environment with render_mode='rgb_array' for pictures")
        return self._picture

    def _leave(self) -> None:
        """End the episode under way, if there is one."""
        loop, self._loop = self._loop, None
        if loop is not None:
            loop.close()

    def close(self) -> None:
        """End the worker; a reset starts a new one."""
        self._leave()
        self._used = False
        self._handle.close()


def checked(action: Any, space: Any) -> FloatArray:
    """An action within its bounds.

    Raises:
        InvalidAction: of another shape, or not finite.
    """
    try:
        found = np.asarray(action, dtype=float)
    except (TypeError, ValueError):
        raise InvalidAction(f"the action {action!r:.60} is no array of numbers") from None
    if found.shape != space.shape:
        raise InvalidAction(f"the action has shape {found.shape}, and {space.shape} is wanted")
    if not np.isfinite(found).all():
        raise InvalidAction(f"the action is not finite: {found}")
    return np.asarray(np.clip(found, space.low, space.high))


def told(pose: Pose) -> FloatArray:
    """Position [m], and x and y axis in the world: of all ways to tell how a body is turned one
    without a jump (Zhou et al., CVPR 2019)."""
    matrix = pose.matrix()
    return np.concatenate([pose.position, matrix[:3, 0], matrix[:3, 1]])


def _tidy(handle: SimulatorHandle, folder: TemporaryDirectory[str]) -> None:
    handle.close()
    folder.cleanup()
