"""Joints of ODE as the scene counts them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

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
        self.child, self.parent = joint.getBody(0), joint.getBody(1)
        self.hinged, self.turn = isinstance(joint, ode.HingeJoint), (0, 0.0)
        self._told: Callable[[], float] = joint.getAngle if self.hinged else joint.getPosition
        self.angle = self._unwrapped if wide else self._told
        rate = joint.getAngleRate if self.hinged else joint.getPositionRate
        self.rate: Callable[[], float] = rate

    def position(self) -> float:
        """[rad or m]."""
        return self.zero + self.angle()

    def _unwrapped(self) -> float:
        turns, last = self.turn
        told = self._told()
        turns += round((last - told) / math.tau)
        self.turn = turns, told
        return told + turns * math.tau
