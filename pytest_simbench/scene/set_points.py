"""Set points of all joints: whole, from start to end, as a trajectory; and what becomes of a
policy's answers, and of what a worker sends it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pytest_simbench.ground.errors import PolicyError
from pytest_simbench.scene.checks import LARGEST, SceneError, check_number, check_pose
from pytest_simbench.scene.policy import Command, Kinematics, LoopError, Observation
from pytest_simbench.scene.pose import FloatArray, Pose, vector3
from pytest_simbench.scene.robot import FREE, Robot
from pytest_simbench.scene.scene import Scene


@dataclass(frozen=True)
class Trajectory:
    """Set points of all driven joints on a regular time grid, linear in between.

    Attributes:
        tick: time between two rows [s].
        position: (n, n_joints) [rad or m]; row 0 is the set point at the start.
        velocity: (n, n_joints) [rad/s or m/s].
        effort: (n, n_joints) feed-forward from the model's inverse dynamics [N m or N].

    Raises:
        SceneError: arrays that do not fit each other, or a number that is not finite.
    """

    tick: float
    position: FloatArray
    velocity: FloatArray
    effort: FloatArray

    def __post_init__(self) -> None:
        check_number(self.tick, "the tick [s] of a trajectory", 0.0, above=True)
        for name in ("position", "velocity", "effort"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=float))
        arrays = (self.position, self.velocity, self.effort)
        shapes = [rows.shape for rows in arrays]
        if len(set(shapes)) > 1 or len(shapes[0]) != 2 or not shapes[0][0]:
            told = ", ".join(map(str, shapes))
            raise SceneError(f"a trajectory of the shapes {told}; give 3 times (rows, joints)")
        if not all(np.isfinite(rows).all() for rows in arrays):
            raise SceneError("a trajectory holds a number that is not finite")

    @classmethod
    def holding(
        cls, tick: float, position: FloatArray, effort: FloatArray | None = None
    ) -> Trajectory:
        """One set point for one tick: joints at rest at `position`, (n_joints,), with `effort`."""
        rest = np.zeros_like(position)
        rows = (position, rest, rest if effort is None else effort)
        return cls(tick, *(np.array([row, row]) for row in rows))

    @property
    def duration(self) -> float:
        """[s], from the first row to the last."""
        return self.tick * (len(self.position) - 1)

    def resampled(self, time_step: float) -> Trajectory:
        """The set points at the end of every step of `time_step` [s]; row 0 after one step.

        The number of rows is the duration in steps, rounded, so that time ends within half a
        step of the trajectory's own end.
        """
        steps = max(1, round(self.duration / time_step))
        at = np.minimum(np.arange(1, steps + 1) * time_step, self.duration) / self.tick
        below = np.minimum(at.astype(int), len(self.position) - 1)
        above = np.minimum(below + 1, len(self.position) - 1)
        share = (at - below)[:, None]

        def sample(rows: FloatArray) -> FloatArray:
            return np.ascontiguousarray(rows[below] * (1 - share) + rows[above] * share)

        return Trajectory(
            time_step, sample(self.position), sample(self.velocity), sample(self.effort)
        )


WAYS = ("position", "velocity", "tool", "tool_change")
"""In which a command can say where the arm goes."""


class SetPoints:
    """Of all joints: those that a policy's answers lead to, one period after the other.

    Args:
        position: set points at the start, (n_joints,).
        effort: fed forward at the start, (n_joints,), where there is no model to tell it.
        period: of the policy [s].
        kinematics: its model; None: commands of the tool are refused, and the efforts stay.

    Attributes:
        position, effort: the present ones.
    """

    def __init__(
        self,
        robot: Robot,
        position: FloatArray,
        effort: FloatArray,
        period: float,
        kinematics: Kinematics | None = None,
    ) -> None:
        self.position, self.effort = np.array(position, dtype=float), np.array(effort, dtype=float)
        self._robot, self._period, self._kinematics = robot, period, kinematics
        self._fingers = np.array(robot.finger_indices, dtype=int)
        arm = [robot.joint_names.index(joint.name) for joint in robot.arm_joints]
        self._arm = np.array(arm, dtype=int)
        self._driven = robot.column("stiffness") > FREE
        self._motors = bool(arm) and all(joint.motor for joint in robot.arm_joints)
        if kinematics is not None:
            self.effort = kinematics.holding_effort(self.position)

    def after(self, answer: Any) -> None:
        """Go on by one answer.

        Raises:
            PolicyError: it is no command of this robot.
        """
        if answer is None:
            return
        command = Command.of(answer)
        ways = [way for way in WAYS if getattr(command, way) is not None]
        if len(ways) > 1:
            raise PolicyError(f"the policy commands {' and '.join(ways)} at once; choose one")
        if ways and self._motors and command.effort is None:
            raise PolicyError(
                f"the policy commands {ways[0]} alone, and the arm's joints are motors, which push "
                "efforts alone; answer an effort"
            )
        position = self.position.copy()
        if command.position is not None:
            self._put(position, command.position, "position")
        elif command.velocity is not None:
            speeds = np.zeros_like(position)
            self._put(speeds, command.velocity, "velocity")
            position += self._period * speeds
        elif ways:
            position = self._towards(command)
        if command.gripper is not None:
            position[self._fingers] = self._finger(command.gripper)
        self.position = position
        if command.effort is not None:
            effort = np.zeros_like(position)
            moved = self._put(effort, command.effort, "effort")
            if not ways and self._driven[moved].any():
                raise PolicyError(
                    "the policy commands efforts alone, and the joints have drives that hold their "
                    "positions; give the task a robot of motors (robot.as_motors())"
                )
            self.effort = effort
        elif self._kinematics is not None:
            self.effort = self._kinematics.holding_effort(position)

    def _put(self, row: FloatArray, values: ArrayLike, what: str) -> NDArray[np.intp]:
        """Write values of the arm's joints, or of all, into a row of all; which these are."""
        found = _numbers(values, what)
        everything = np.arange(len(row))
        for joints in (self._arm, everything):
            if found.shape == joints.shape:
                row[joints] = found
                return joints
        raise PolicyError(
            f"the policy answers {what} of shape {found.shape}; the arm has {len(self._arm)} "
            f"joints, and {len(row)} with its fingers"
        )

    def _towards(self, command: Command) -> FloatArray:
        """Positions of the joints with which the tool goes where a command says."""
        if self._kinematics is None:
            raise PolicyError("inside the worker a policy commands joints, not the tool")
        tool: Any = command.tool
        if tool is None:
            change = _numbers(command.tool_change, "tool_change")
            tool = _changed(self._kinematics.tool_pose(self.position), change)
        if not isinstance(tool, Pose):
            raise PolicyError(f"the policy answers tool={tool!r:.60}, which is no Pose")
        try:
            check_pose(tool, "the tool")
        except SceneError as error:
            raise PolicyError(f"the policy answers a tool that cannot be: {error}") from None
        return self._kinematics.towards(self.position, tool, self._period)

    def _finger(self, width: float) -> float:
        value = _numbers(width, "gripper")
        if value.size != 1:
            raise PolicyError(f"the policy answers gripper of shape {value.shape}, not one number")
        if not len(self._fingers):
            raise PolicyError(f"the policy moves the gripper; robot {self._robot.name!r} has none")
        low, high = sorted((self._robot.gripper.closed, self._robot.gripper.opened))
        width = value.item()
        wanted = width / 2 if self._kinematics is None else self._kinematics.finger(width)
        return float(np.clip(wanted, low, high))


def _changed(tool: Pose, change: FloatArray) -> Pose:
    """A pose, moved [m] and then turned by a rotation vector [rad], both along the world's axes."""
    if change.shape != (6,):
        raise PolicyError(f"the policy answers a tool_change of shape {change.shape}, not (6,)")
    angle = float(np.linalg.norm(change[3:]))
    i, j, k = vector3(np.sinc(angle / 2 / np.pi) / 2 * change[3:])
    turned = Pose(quaternion=(math.cos(angle / 2), i, j, k)) * Pose(quaternion=tool.quaternion)
    return Pose(vector3(np.add(tool.position, change[:3])), turned.quaternion)


def _numbers(values: Any, what: str) -> FloatArray:
    try:
        if np.iscomplexobj(values):  # it would lose its imaginary part
            raise TypeError
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise PolicyError(f"the policy answers {what}={values!r:.60}, which is no number") from None
    if not (np.abs(found) <= LARGEST).all():
        raise PolicyError(
            f"the policy answers {what} with a number that is not finite, or above {LARGEST:g}: "
            f"{found}"
        )
    return found


class Sight:
    """Makes observations of what a worker sends.

    Args:
        scene: that is loaded; it has a robot.
        kinematics: of the robot; None inside the worker.
    """

    def __init__(
        self, scene: Scene, kinematics: Kinematics | None = None, goal: Pose | None = None
    ) -> None:
        robot = scene.robot
        if robot is None:
            raise LoopError(f"scene {scene.name!r} has no robot that a policy could move")
        self.joints, self._kinematics, self._goal = len(robot.joints), kinematics, goal
        self._names = tuple(body.name for body in scene.free_bodies)
        columns = ("stiffness", "damping", "effort_limit")
        self._drives = np.array([robot.column(name) for name in columns])

    def seen(
        self,
        time: float,
        joints: FloatArray,
        told: Sequence[FloatArray] | FloatArray,
        bodies: FloatArray,
        **more: Any,
    ) -> Observation:
        """One observation.

        Args:
            time: simulated [s].
            joints: positions and velocities, (2, n_joints).
            told: the set points in force: position, velocity, effort, (n_joints,) each.
            bodies: rows of the free bodies, (n_free, 13).
        """
        return Observation(
            time, joints[0], joints[1], np.asarray(told), bodies, self._names,
            goal=self._goal, drives=self._drives, kinematics=self._kinematics, **more,
        )  # fmt: skip

    def read(self, state: FloatArray, **more: Any) -> Observation:
        """One observation, of `written` numbers."""
        n = self.joints
        joints, bodies = state[1 : 1 + 2 * n].reshape(2, n), state[1 + 5 * n :].reshape(-1, 13)
        return self.seen(float(state[0]), joints, self.told(state), bodies, **more)

    def told(self, state: FloatArray) -> FloatArray:
        """The set points in force among `written` numbers, (3, n_joints)."""
        n = self.joints
        return state[1 + 2 * n : 1 + 5 * n].reshape(3, n)

    @property
    def numbers(self) -> int:
        """How many `written` ones there are."""
        return 1 + 5 * self.joints + 13 * len(self._names)


def written(
    time: float, joints: FloatArray, told: Sequence[FloatArray], bodies: FloatArray
) -> bytes:
    """What `Sight.read` reads, numbers of float64 one after the other."""
    return b"".join(
        [np.float64(time).tobytes(), *(part.tobytes() for part in (joints, *told, bodies))]
    )
