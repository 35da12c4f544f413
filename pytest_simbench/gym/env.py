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

from pytest_simbench.client.closed_loop import ClosedLoop, Looking
from pytest_simbench.client.errors import Diverged, WorkerError
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.motion.kinematics import Servo
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.scene.plausibility import implausible
from pytest_simbench.scene.policy import Command, Rhythm
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks.base import Jitter
from pytest_simbench.tasks.goals import SETTLE, GoalTask

ACTIONS = ("tool", "joints")
REWARDS = ("dense", "sparse")

SPEED, TURN, JOINT_SPEED = 0.5, 1.5, 1.0
"""Of the tool [m/s], [rad/s] and of a joint [rad/s] under the largest action. At 10 Hz the tool
goes 5 cm, as far as in Gymnasium-Robotics' Fetch; the Panda's slowest joint can do 2.175 rad/s."""

PICTURE = 480, 480
"""Width and height [pixels]."""


class TaskEnv(gymnasium.Env[Any, Any]):
    """One task on one simulator; `making.make` makes it.

    Observations have the parts of a goal environment, so that hindsight replay can be used:
    `observation`, and the place that is reached and the one that is wanted, (3,) each [m].
    An episode ends once the goal was held (terminated), its time is over, or the simulation
    crashed (truncated; `info["crashed"]` says why, and the next reset starts a new worker).

    Args:
        task: its policy is not asked.
        actions, reward, render_mode: see `making.make`.
    """

    def __init__(
        self,
        task: GoalTask,
        case: Case,
        rhythm: Rhythm,
        actions: str,
        reward: str,
        render_mode: str | None,
    ) -> None:
        draws = Capability.OFFSCREEN in adapter(case.simulator).info.capabilities
        modes = ["rgb_array"] if draws else []
        self.metadata = {"render_modes": modes, "render_fps": rhythm.rate}
        self.render_mode = render_mode
        self._looking = Looking(picture=PICTURE if render_mode else None)
        self.task, self.rhythm, self._actions, self._reward = task, rhythm, actions, reward
        self._jitter = Jitter(Jitter.distance * case.jitter, Jitter.angle * case.jitter)
        folder = TemporaryDirectory(prefix="simbench-gym-")  # for the worker's log
        handle = self._handle = SimulatorHandle(replace(case, folder=Path(folder.name)))
        weakref.finalize(self, folder.cleanup)
        weakref.finalize(self, handle.close)  # the newest goes first
        self._loop: ClosedLoop | None = None
        self._picture: Any = None
        self._observed: dict[str, FloatArray]
        self._info: dict[str, Any]
        scene = task.scene(0, Jitter(0.0, 0.0))
        servo = self._servo = Servo(scene)
        joints, self._hand = len(servo.model.robot.joints), servo.model.robot.gripper
        numbers = 3 * joints + 9 + 15 * len(scene.free_bodies)
        seen, place = (Box(-np.inf, np.inf, (n,), np.float64) for n in (numbers, 3))
        self.observation_space = Dict(observation=seen, achieved_goal=place, desired_goal=place)
        moved = 4 if actions == "tool" else servo.model.arm
        self.action_space = Box(-1.0, 1.0, (moved + (joints > servo.model.arm),), np.float64)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """A new episode: the scene and the goal of the seed, or of one that chance draws.

        Raises:
            WorkerError: the simulator cannot be started or cannot load the scene, tried twice.
        """
        super().reset(seed=seed)
        self._seed = seed if seed is not None else int(self.np_random.integers(2**31))
        self._leave()
        try:
            self._begin()
        except WorkerError:
            self.close()
            self._begin()  # in a new worker
        return self._observed, self._info

    def _begin(self) -> None:
        task, rate = self.task, self.rhythm.rate
        world = self._world = self._handle.world(task.scene(self._seed, self._jitter))
        world.process.deadline = None  # silence alone ends a worker
        world.process.where.seed = self._seed
        with world.phase("settle start"):
            world.wait(SETTLE)
        world.process.where.phase = "act"
        self._servo, self._left = Servo(world.scene), max(1, round(task.seconds * rate))
        loop = self._loop = ClosedLoop(
            world.process, world.scene, self.rhythm,
            timestep=self._handle.constructed.settings["timestep"],
            seconds=(self._left + 1) / rate,  # it is asked after the last step, too
            kinematics=self._servo, looking=self._looking, goal=task.goal(self._seed),
        )  # fmt: skip
        self._position, self._stays = loop.now.told[0], task.stays(self._seed)
        self._look(loop)

    def step(self, action: FloatArray) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Act for one period.

        Raises:
            ResetNeeded: no episode has begun, or it is over.
            InvalidAction: of another shape, or not finite.
        """
        if self._loop is None:
            raise ResetNeeded("no episode is under way: call reset()")
        command, crashed = self._command(checked(action, self.action_space)), False
        try:
            self._loop.reply(command)
            self._look(self._loop)
        except WorkerError as error:
            crashed = True
            self._observed = {name: row.copy() for name, row in self._observed.items()}
            self._info = {**self._info, "crashed": error.what}
        except BaseException:  # Ctrl-C: an answer is under way that nobody waits for
            self.close()
            raise
        self._left -= 1
        terminated = self._held and not crashed
        truncated = not terminated and (crashed or self._left == 0)
        if crashed:
            self.close()
        elif terminated or truncated:
            self._leave()
        seen, info = self._observed, self._info
        reward = self.compute_reward(seen["achieved_goal"], seen["desired_goal"], info)
        return seen, float(reward), terminated, truncated, info

    def _command(self, action: FloatArray) -> Command:
        period, model, hand, width = 1 / self.rhythm.rate, self._servo.model, self._hand, None
        if hand.joints:
            finger = np.interp(action[-1], (-1.0, 1.0), (hand.closed, hand.opened))
            width = float(finger / self._servo.finger(1.0))
        if self._actions == "tool":
            x, y, z, yaw = period * np.array([SPEED, SPEED, SPEED, TURN]) * action[:4]
            return Command(tool_change=(x, y, z, 0.0, 0.0, yaw), gripper=width)
        wanted = self._position[: model.arm] + period * JOINT_SPEED * action[: model.arm]
        self._position = np.clip(wanted, model.lower, model.upper)
        return Command(position=self._position, gripper=width)

    def _look(self, loop: ClosedLoop) -> None:
        """Take in what there is to see. A delay does not delay what counts."""
        shown, now, task, seed = loop.observation, loop.now, self.task, self._seed
        if wrong := implausible(self._world.scene, now.bodies):
            raise Diverged(wrong, self._world.process.where)
        self._held, self._picture = self._stays(now), now.picture
        reached, distance = bool(task.reached(now, seed)), task.distance(now, seed)
        self._info = {"is_success": reached, "distance": distance, "time": now.time, "seed": seed}
        bodies = ((*told(Pose.from_array(row)), *row[7:]) for row in shown.bodies)
        rows = shown.position, shown.velocity, shown.told[0], told(shown.tool), *bodies
        at = shown.tool if task.moved is None else shown.pose(task.moved)
        self._observed = {
            "observation": np.concatenate([np.asarray(row) for row in rows]),
            "achieved_goal": np.array(at.position),
            "desired_goal": np.array(task.goal(seed).position),
        }

    def compute_reward(self, achieved_goal: Any, desired_goal: Any, info: Any) -> Any:
        """Of one place or of many, (..., 3)."""
        distance = np.linalg.norm(np.subtract(achieved_goal, desired_goal), axis=-1)
        within = self.task.tolerance * self.task.scale
        return -distance if self._reward == "dense" else np.where(distance <= within, 0.0, -1.0)

    def render(self) -> Any:
        """The picture of the newest state, (height, width, 3)."""
        if self.render_mode is None:
            raise UnsupportedMode("make the environment with render_mode='rgb_array' for pictures")
        if self._picture is None:
            raise ResetNeeded("no picture was taken yet: call reset()")
        return self._picture

    def _leave(self) -> None:
        """End the episode under way, if there is one."""
        loop, self._loop = self._loop, None
        if loop is not None:
            loop.close()

    def close(self) -> None:
        """End the worker; a reset starts a new one."""
        self._leave()
        self._handle.close()


def checked(action: Any, space: Any) -> FloatArray:
    """An action within its bounds.

    Raises:
        InvalidAction: of another shape, or not finite.
    """
    try:
        found = np.asarray(action, dtype=float)
    except (TypeError, ValueError):  # no numbers, or rows of several lengths
        found = np.empty(0)
    if found.shape != space.shape or not np.isfinite(found).all():
        raise InvalidAction(
            f"an action is finite numbers of shape {space.shape}, not {action!r:.80}"
        )
    return np.asarray(np.clip(found, space.low, space.high))


def told(pose: Pose) -> FloatArray:
    """Position [m], and x and y axis in the world: of all ways to tell how a body is turned one
    without a jump (Zhou et al., CVPR 2019)."""
    return np.concatenate([pose.position, *pose.rotation().T[:2]])
