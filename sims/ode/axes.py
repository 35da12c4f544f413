"""Joints of ODE as the scene counts them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.simulator import lazy_import

from .library import HI_STOP, LO_STOP

ode = lazy_import("ode")


class Axis:
    """One joint of ODE, hinge or slider.

    Args:
        joint: of ODE, attached to the child first, then to the parent or None.
        zero: the joint's position in the scene where ODE's is 0 [rad or m].
        timestep: [s].
        wide: whether it turns farther than ODE tells, -pi to pi.

    Attributes:
        child, parent: bodies of ODE; None for the world.
        angle: ODE's position of the joint, whole turns added where it is wide [rad or m].
        turn: whole turns, and the last angle that ODE told; of a wide joint.
        stops: joint of ODE that holds it at its limits: itself, or a motor of a wide one.
        stopped: whether that motor acted in the last step.
        motors: joints of ODE that act beside it.
    """

    def __init__(self, joint: Any, zero: float, timestep: float, wide: bool) -> None:
        self.joint, self.zero, self.timestep, self.wide = joint, zero, timestep, wide
        self.stops, self.stopped = joint, False
        self.motors: list[Any] = []
        joint.setFeedback(True)
        self.child, self.parent = joint.getBody(0), joint.getBody(1)
        self.hinged = isinstance(joint, ode.HingeJoint)
        self.turn: list[float] = [0.0, 0.0]
        told: Callable[[], float] = joint.getAngle if self.hinged else joint.getPosition
        self.angle = _counted(told, self.turn) if wide else told

    def limit(self, world: Any, lower: float, upper: float) -> None:
        """Stop at ODE's positions `lower` and `upper` [rad or m].

        A hinge knows no whole turns, and has no stops beyond half a one. A motor without force has:
        it is told its angle, and adds nothing to the world but at its stops.
        """
        if self.wide:
            self.stops = self._beside(world)
        self.stops.setParam(LO_STOP, lower)
        self.stops.setParam(HI_STOP, upper)

    def motor(self, world: Any) -> Any:
        """A motor beside the joint's own.

        Of a slider it is that of a second slider: ODE's motors along an axis pull at centres of
        mass, and so turn two bodies whose centres are not upon it.
        """
        self.motors.append(made := self._beside(world))
        return made

    def _beside(self, world: Any) -> Any:
        """A joint of ODE's that can be a motor along this one's axis."""
        made = ode.AMotor(world) if self.hinged else ode.SliderJoint(world)
        made.attach(self.child, self.parent)
        if self.hinged:
            made.setNumAxes(1)
            made.setAxis(0, 1, self.joint.getAxis())  # 1: turns with the child
        else:
            made.setAxis(self.joint.getAxis())
        made.setFeedback(True)
        return made

    def inertia(self) -> float:
        """Of the child alone: about its centre along the axis [kg m^2], or its mass [kg]."""
        mass = self.child.getMass()
        axis = np.array(self.child.vectorFromWorld(self.joint.getAxis()))
        return float(axis @ np.array(mass.I) @ axis) if self.hinged else float(mass.mass)

    def tell_stops(self) -> None:
        """Before a step: where a wide joint stands."""
        angle = self.angle()
        self.stops.setAngle(0, angle)
        low, high = self.stops.getParam(LO_STOP), self.stops.getParam(HI_STOP)
        self.stopped = not low < angle < high

    def wrench(self, frame: Pose) -> FloatArray:
        """What it did to its child in the last step, motors included, in the world, (6,), about the
        origin of the link's `frame` in the child's: where that was at the begin of the step."""
        force, torque = map(np.array, self.joint.getFeedback()[:2])  # about the child's centre
        for motor in self.motors:
            pull, turn = motor.getFeedback()[:2]
            force, torque = force + pull, torque + turn
        if self.stopped:  # ODE writes no feedback of what did nothing
            torque = torque + self.stops.getFeedback()[1]
        offset = np.array(self.child.vectorToWorld(frame.position))
        offset -= self.timestep * np.cross(self.child.getAngularVel(), offset)
        return np.concatenate([force, torque - np.cross(offset, force)])

    def stands(self, position: float) -> None:
        """Count whole turns from here on, where the joint stands [rad]."""
        away = position - self.zero - self.angle()
        self.turn[0] += round(away / math.tau)

    def position(self) -> float:
        """[rad or m]."""
        return self.zero + self.angle()

    def rate(self) -> float:
        """Its velocity, as the last step's solver has set it, where the bodies stood at its begin
        [rad/s or m/s]. What ODE tells of a slider leaves out that the parent turns."""
        if self.hinged:
            return float(self.joint.getAngleRate())
        velocity = np.array(self.child.getLinearVel())
        if self.parent is not None:
            away = self.timestep * (velocity - self.parent.getLinearVel())
            velocity -= self.parent.getPointVel(self.child.getPosition() - away)
        return float(velocity @ self.joint.getAxis())


def _counted(told: Callable[[], float], turn: list[float]) -> Callable[[], float]:
    """The angle with whole turns added, which are counted in `turn`."""

    def angle() -> float:
        now = told()
        turn[0] += round((turn[1] - now) / math.tau)
        turn[1] = now
        return now + turn[0] * math.tau

    return angle
