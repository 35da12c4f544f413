"""Joints of ODE as the scene counts them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.simulator import lazy_import

ode = lazy_import("ode")


class Axis:
    """One joint of ODE, hinge or slider.

    Args:
        joint: of ODE, attached to the child first, then to the parent or None.
        zero: the joint's position in the scene where ODE's is 0 [rad or m].
        wide: whether it turns farther than ODE tells, -pi to pi.

    Attributes:
        child, parent: bodies of ODE; None for the world.
        angle: ODE's position of the joint, whole turns added where it is wide [rad or m].
        rate: its velocity [rad/s or m/s].
        turn: whole turns, and the last angle that ODE told; of a wide joint.
    """

    def __init__(self, joint: Any, zero: float, wide: bool = False) -> None:
        self.joint, self.zero = joint, zero
        joint.setFeedback(True)
        self.child, self.parent = joint.getBody(0), joint.getBody(1)
        self.hinged = isinstance(joint, ode.HingeJoint)
        self.turn: list[float] = [0.0, 0.0]
        told: Callable[[], float] = joint.getAngle if self.hinged else joint.getPosition
        self.angle = _counted(told, self.turn) if wide else told
        rate = joint.getAngleRate if self.hinged else joint.getPositionRate
        self.rate: Callable[[], float] = rate

    def wrench(self, frame: Pose, timestep: float) -> FloatArray:
        """What it did to its child in the last step, motor included, in the world, (6,).

        Args:
            frame: of the link in the child's, about whose origin the torque is.
            timestep: of the last step, at whose begin the child stood where it acted [s].
        """
        force, torque = map(np.array, self.joint.getFeedback()[:2])  # about the child's centre
        offset = np.array(self.child.vectorToWorld(frame.position))
        offset -= timestep * np.cross(self.child.getAngularVel(), offset)
        return np.concatenate([force, torque - np.cross(offset, force)])

    def stands(self, position: float) -> None:
        """Count whole turns from here on, where the joint stands [rad]."""
        away = position - self.zero - self.angle()
        self.turn[0] += round(away / math.tau)

    def position(self) -> float:
        """[rad or m]."""
        return self.zero + self.angle()


def _counted(told: Callable[[], float], turn: list[float]) -> Callable[[], float]:
    """The angle with whole turns added, which are counted in `turn`."""

    def angle() -> float:
        now = told()
        turn[0] += round((turn[1] - now) / math.tau)
        turn[1] = now
        return now + turn[0] * math.tau

    return angle
