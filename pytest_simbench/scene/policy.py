"""A closed loop: what a policy is, what it sees, what it answers, and how often.

A policy is asked at its own rate. What it answers are set points that the drives reach at the end
of the period, evenly: as all trajectories here, without a jump.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pytest_simbench.ground.errors import PolicyError
from pytest_simbench.scene.checks import SceneError, check_number
from pytest_simbench.scene.pose import FloatArray, Pose


class LoopError(SceneError):
    """A closed loop that cannot be: its rate, its delays, its end, or a scene without a robot."""


class Kinematics(Protocol):
    """What a robot's model knows, where there is one (in pytest's process)."""

    def tool_pose(self, position: FloatArray) -> Pose:
        """The tool centre point in the world, of joint positions (n_joints,)."""

    def towards(self, position: FloatArray, tool: Pose, seconds: float) -> FloatArray:
        """Joint positions (n_joints,) nearer to a pose of the tool, within the limits."""

    def finger(self, width: float) -> float:
        """Position of each finger joint [m, or rad] where the hand is `width` [m] open."""

    def holding_effort(self, position: FloatArray) -> FloatArray:
        """What holds the arm against gravity, (n_joints,) [N m or N]."""


@dataclass(frozen=True, eq=False)
class Observation:
    """What a policy sees: the world at one moment.

    Attributes:
        time: simulated [s].
        position, velocity: of the driven joints, (n_joints,) [rad, rad/s, or m, m/s].
        told: the set points in force: position, velocity, effort, (3, n_joints).
        bodies: rows of the free bodies, (n_free, 13): position [m], quaternion w, x, y, z, linear
            [m/s] and angular velocity [rad/s], in the world frame.
        names: of the free bodies.
        goal: where the task wants the body or the tool, if it says so.
        forces: contact forces as of `World.contact_forces`, where they were asked for.
        picture: (height, width, 3), where it was asked for.
        drives: stiffness, damping and effort limit of the joints, (3, n_joints).
        kinematics: of the robot.
    """

    time: float
    position: FloatArray
    velocity: FloatArray
    told: FloatArray
    bodies: FloatArray
    names: tuple[str, ...]
    goal: Pose | None = None
    forces: Mapping[tuple[str, str], FloatArray] = field(default_factory=dict)
    picture: NDArray[np.uint8] | None = None
    drives: FloatArray = field(default_factory=lambda: np.zeros((3, 1)), repr=False)
    kinematics: Kinematics | None = field(default=None, repr=False)

    @cached_property
    def effort(self) -> FloatArray:
        """Of the drives, by their law (`Joint`), (n_joints,) [N m or N]."""
        (at, speed, fed), (stiffness, damping, limit) = self.told, self.drives
        wanted = stiffness * (at - self.position) + damping * (speed - self.velocity) + fed
        return np.asarray(np.clip(wanted, -limit, limit))

    @cached_property
    def tool(self) -> Pose:
        """Pose of the tool centre point in the world.

        Raises:
            PolicyError: the policy runs inside the worker, which has no model of the robot.
        """
        if self.kinematics is None:
            raise PolicyError("inside the worker a policy does not see the pose of the tool")
        return self.kinematics.tool_pose(self.position)

    def pose(self, name: str) -> Pose:
        """Of a free body.

        Raises:
            PolicyError: there is none of that name.
        """
        return Pose.from_array(self._row(name))

    def twist(self, name: str) -> FloatArray:
        """Linear [m/s] and angular velocity [rad/s] of a free body in the world frame, (6,)."""
        return self._row(name)[7:]

    def _row(self, name: str) -> FloatArray:
        if name not in self.names:
            known = ", ".join(self.names) or "none"
            raise PolicyError(f"the policy asked for body {name!r}; the free bodies are: {known}")
        return np.asarray(self.bodies[self.names.index(name)])


@dataclass(frozen=True, eq=False)
class Command:
    """What a policy answers. A position of which it says nothing stays where it is; a velocity or a
    way of the tool holds for one period.

    Attributes:
        position: of the arm's joints, or of all joints [rad or m].
        velocity: of the same [rad/s or m/s]: the set point moves on with it.
        effort: of the same [N m or N]: alone where the joints are motors (`Robot.as_motors`), else
            in addition to what their drives do, in place of what holds the arm against gravity.
        tool: where the tool centre point goes, in the world; as near as the joints' limits allow in
            one period.
        tool_change: by how much it goes from where it was told to be: along x, y, z [m] and as a
            rotation vector [rad], both along the world's axes, (6,).
        gripper: width between the fingers [m].
    """

    position: ArrayLike | None = None
    velocity: ArrayLike | None = None
    effort: ArrayLike | None = None
    tool: Pose | None = None
    tool_change: ArrayLike | None = None
    gripper: float | None = None

    @classmethod
    def of(cls, answer: Any) -> Command:
        """A policy's answer as a command: it is one, or positions of joints, or None."""
        if isinstance(answer, Command):
            return answer
        return cls() if answer is None else cls(position=answer)


class Policy(ABC):
    """Sees and acts, again and again. A function of an observation is one, too.

    Attributes:
        name: in records and tables.
        rate: how often it is asked [Hz].
    """

    name: str = "policy"
    rate: float = 50.0

    def reset(self, seed: int) -> None:  # noqa: B027 - there may be nothing to do
        """An episode begins; all that is random in it comes from the seed."""

    @abstractmethod
    def act(self, observation: Observation) -> Any:
        """A `Command`, positions of joints, or None: the set points stay where they are."""


class Function(Policy):
    """A plain function as a policy."""

    def __init__(self, act: Callable[[Observation], Any], rate: float = Policy.rate) -> None:
        self.name, self.rate, self._act = getattr(act, "__name__", "function"), rate, act

    def act(self, observation: Observation) -> Any:
        return self._act(observation)


def name_of(policy: Any) -> str:
    """For records and messages."""
    named = getattr(policy, "name", None) or getattr(policy, "__name__", None)
    return str(named or type(policy).__name__)


def as_policy(given: Any, rate: float | None = None) -> Any:
    """Whatever has `act`, or a function.

    Raises:
        LoopError: it is neither.
    """
    if callable(getattr(given, "act", None)) and not isinstance(given, type):
        return given
    if callable(given) and not isinstance(given, type):
        return Function(given, rate or Policy.rate)
    raise LoopError(
        f"{given!r:.80} is no policy: give a function of an observation, or an object with "
        "act(observation), as of a subclass of Policy"
    )


@dataclass(frozen=True)
class Rhythm:
    """How often a policy is asked, and how late what it sees and says is.

    Attributes:
        rate: [Hz].
        command_latency: from an observation to when its command begins to act [s].
        observation_delay: age of what the policy is shown [s]; whole periods.
    """

    rate: float
    command_latency: float = 0.0
    observation_delay: float = 0.0

    def __post_init__(self) -> None:
        checked(self.rate, "the rate [Hz] of a policy", above=True)
        checked(self.command_latency, "the command_latency [s]")
        checked(self.observation_delay, "the observation_delay [s]")

    def steps(self, timestep: float) -> tuple[int, int, int]:
        """Time steps of a period and of the latency, and periods of the delay.

        Raises:
            LoopError: they are no whole numbers.
        """
        period = 1.0 / self.rate
        every = _whole(period / timestep)
        if not every:
            n = max(1, int(period / timestep))
            near = " or ".join(f"{1 / (k * timestep):.7g} Hz" for k in (n, n + 1))
            raise LoopError(
                f"a policy at {self.rate:g} Hz is asked every {1e3 * period:.4g} ms, which is no "
                f"multiple of the time step of {1e3 * timestep:.4g} ms; choose {near}, or "
                "another time step"
            )
        late = _multiple(self.command_latency, "command_latency", timestep, "time step")
        old = _multiple(self.observation_delay, "observation_delay", period, "policy's period")
        return every, late, old


def _whole(number: float) -> int | None:
    return round(number) if abs(number - round(number)) < 1e-6 * max(1.0, number) else None


def _multiple(value: float, name: str, length: float, of: str) -> int:
    """How many times a length makes a value [both s]."""
    count = _whole(value / length)
    if count is None:
        near = " or ".join(f"{(value // length + k) * length:.7g} s" for k in (0, 1))
        raise LoopError(
            f"{name}={value:g} s is no multiple of the {of} of {length:.7g} s; choose {near}"
        )
    return count


def checked(value: Any, what: str, *, above: bool = False) -> float:
    """A number from 0 on, or above 0.

    Raises:
        LoopError: it is none.
    """
    try:
        check_number(value, what, 0.0, above=above)
    except SceneError as error:
        raise LoopError(str(error)) from None
    return float(value)
