"""The throw: a swing of the arm, timed so that the arm can do it, that lets a cube go on its way.

The time-optimal swing at the arm's velocity, acceleration and jerk limits, which the reference
study commands (`synchronised_move`), asks 1.2 times of joint 2 what its motor gives.
`feasible_swing` takes the same way within the limits of the motors too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pytest_simbench.motion.errors import PlanningError, RobotError
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.timing import TICK, Timed, line_move
from pytest_simbench.scene import Body, FloatArray, Robot

EFFORT_SHARE = 0.9
"""Largest planned effort, as a share of each joint's limit: the drives need the rest to correct."""

LANDING_HEIGHT = 0.05
"""Where its free flight crosses this height a cube lands [m]: an edge length above the ground, in
the middle of the pyramid's front. It goes with the scene's scale."""

SPEED_SHARE = 0.965
"""Largest planned joint velocity of a throw, as a share of the limits. All joints swing in step, so
the cube leaves at 2.79 m/s and meets the topmost cube in the middle of its face. The study's swing,
each joint at a pace of its own and joint 2 at its very limit, gives 2.75."""

JERK_SHARE = 0.1
"""Largest planned jerk of a throw, as a share of the limits: at the full ones the acceleration
jumps within 2 ms, which no drive here follows."""


@dataclass(frozen=True)
class Throw:
    """A swing and its release, as a perfect follower does them.

    Attributes:
        timed: the swing.
        row: of the swing, the first set point with open fingers.
        position: of the tool centre point there, in the world [m].
        velocity: of the tool centre point there, in the world [m/s].
        landing_height: where the cube's flight ends [m].
    """

    timed: Timed
    row: int
    position: FloatArray
    velocity: FloatArray
    landing_height: float = LANDING_HEIGHT

    @property
    def time(self) -> float:
        """Of the release, since the start of the swing [s]."""
        return TICK * self.row

    def landing(self, gravity: FloatArray) -> float | None:
        """Where a cube lands that is let go so, in x [m]."""
        return landing_x(self.position, self.velocity, gravity, self.landing_height)


def swing_of(robot: Robot) -> tuple[FloatArray, FloatArray]:
    """Arm joints before and after the throw, each (arm,) [rad].

    Raises:
        RobotError: none is known for this robot.
    """
    if robot.swing is None:
        raise RobotError(
            f"robot {robot.name!r} has no swing for the throw: write one into its file, under "
            "[throw]; simbench swing FILE looks for one"
        )
    start, end = robot.swing
    return np.array(start), np.array(end)


def feasible_swing(
    model: RobotModel, start: FloatArray, goal: FloatArray, gravity: FloatArray, held: Body | None
) -> tuple[Timed, float]:
    """From rest to rest on the straight line in joint space, with its exact duration [s].

    Within `SPEED_SHARE` of the velocity limits, `JERK_SHARE` of the jerk limits, and the highest
    acceleration, by bisection, whose efforts stay within `EFFORT_SHARE` of the limits with the cube
    in the hand.

    Raises:
        PlanningError: the arm is too weak for any.
    """

    def swing(acceleration: float) -> tuple[Timed, float]:
        return line_move(start, goal, model.limits, (SPEED_SHARE, acceleration, JERK_SHARE))

    def strain(timed: Timed) -> float:
        return float(np.abs(model.effort_shares(gravity, *timed, held)).max())

    low, high = 0.0, 1.0
    for _ in range(8):
        middle = (low + high) / 2
        low, high = (middle, high) if strain(swing(middle)[0]) <= EFFORT_SHARE else (low, middle)
    if low == 0.0:
        raise PlanningError("the arm is too weak to swing what it holds")
    return swing(low)


def released(
    model: RobotModel, timed: Timed, duration: float, fraction: float, scale: float = 1.0
) -> Throw:
    """The throw that opens the fingers at the first set point after `fraction` of `duration`, in a
    scene of that scale.

    The study opens them by the index of the point, too.
    """
    row = min(int(np.ceil(fraction * duration / TICK - 1e-9)), len(timed.position) - 1)
    arm, velocity = timed.position[row], timed.velocity[row]
    position = np.array(model.tool_pose(arm).position)
    height = LANDING_HEIGHT * scale
    return Throw(timed, row, position, model.tool_velocity(arm, velocity), height)


def landing_x(
    position: FloatArray,
    velocity: FloatArray,
    gravity: FloatArray,
    height: float = LANDING_HEIGHT,
) -> float | None:
    """Where a free body crosses a height on its way down, in x [m], or None if it never does:
    z + v t - g t^2 / 2 = height.

    Args:
        position: [m], (3,).
        velocity: [m/s], (3,).
        gravity: [m/s^2], (3,), pointing down.
        height: [m].
    """
    g = -float(gravity[2])
    root = float(velocity[2]) ** 2 + 2 * g * (float(position[2]) - height)
    if root < 0:
        return None
    t = (float(velocity[2]) + np.sqrt(root)) / g
    return float(position[0] + velocity[0] * t + 0.5 * float(gravity[0]) * t * t)
