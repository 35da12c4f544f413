"""Drives, rotors and the fingers' coupling, all of them motors of ODE's joints.

A motor of ODE is a row of the constraint solver: joint velocity + CFM x effort = Vel, the effort
bounded by FMax. All that is asked of a drive follows from what Vel and CFM are:

- `spring`: with Vel = (k (q* - q) + d v* + tau_ff) / (h k + d) and CFM = 1 / (h k + d) the effort
  is k (q* - q - h v) + d (v* - v) + tau_ff at the velocity v after the step h: the scene's drive
  law, implicit, and clipped to the limit within the solver.
- `velocity`: Vel = P (q* - q), what Webots does with its motors; CFM is the world's.
- a rotor of inertia J: with Vel the present velocity and CFM = h / J the effort is that which
  accelerates it, -J dv / h, and FMax has no limit. It is a motor of its own beside the drive's.
- the second finger follows the first: Vel is the first one's velocity and a share of their
  difference.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np

from pytest_simbench.scene import FloatArray, Robot
from pytest_simbench.simulator import lazy_import

from .library import MOST_FORCE, SOFTNESS, VELOCITY

ode = lazy_import("ode")

Drive = Literal["spring", "velocity"]

FOLLOWED = 0.5
"""Share of the difference between the fingers that is corrected in a step."""


class Axis:
    """One joint of ODE, hinge or slider.

    Args:
        joint: of ODE, attached to the child first, then to the parent or None.
        zero: the joint's position in the scene where ODE's is 0 [rad or m].

    Attributes:
        child, parent: bodies of ODE; None for the world.
    """

    def __init__(self, joint: Any, zero: float) -> None:
        self.joint, self.zero = joint, zero
        self.child, self.parent = joint.getBody(0), joint.getBody(1)
        self.hinged = isinstance(joint, ode.HingeJoint)
        self.angle: Callable[[], float] = joint.getAngle if self.hinged else joint.getPosition
        self.rate: Callable[[], float] = (
            joint.getAngleRate if self.hinged else joint.getPositionRate
        )
        self.push: Callable[[float], None] = joint.addTorque if self.hinged else joint.addForce

    def position(self) -> float:
        """[rad or m]."""
        return self.zero + self.angle()


class Rotor:
    """A rotor on a joint, as a motor between the joint's bodies.

    Args:
        world: of ODE.
        axis: the joint.
        inertia: J as seen at the joint [kg m^2 or kg].
        timestep: [s].
    """

    def __init__(self, world: Any, axis: Axis, inertia: float, timestep: float) -> None:
        self.axis = axis
        self.motor = ode.AMotor(world) if axis.hinged else ode.LMotor(world)
        self.motor.attach(axis.child, axis.parent)
        self.motor.setNumAxes(1)
        self.motor.setAxis(0, 1, axis.joint.getAxis())  # 1: turns with the child
        self.motor.setParam(MOST_FORCE, ode.Infinity)
        self.motor.setParam(SOFTNESS, timestep / inertia)

    def turn(self) -> None:
        """Before a step: keep the present velocity."""
        self.motor.setParam(VELOCITY, self.axis.rate() if self.axis.hinged else self._speed())

    def _speed(self) -> float:
        """Of the bodies' centres along the axis [m/s], which is what a linear motor moves."""
        x, y, z = self.axis.joint.getAxis()
        u, v, w = self.axis.child.getLinearVel()
        a, b, c = self.axis.parent.getLinearVel() if self.axis.parent else (0.0, 0.0, 0.0)
        return float(x * (u - a) + y * (v - b) + z * (w - c))


class Drives:
    """The drives of a robot.

    Args:
        world: of ODE.
        robot: whose drives they are.
        axes: its joints by name.
        timestep: [s].
        drive: kind of drive.
        position_gain: P of the kind `velocity` [1/s].

    Attributes:
        first, second: joints of the fingers; the second follows the first.
        rotors: by joint name.
        commanded: the last set points: position, velocity, effort.
    """

    def __init__(
        self,
        world: Any,
        robot: Robot,
        axes: Mapping[str, Axis],
        timestep: float,
        drive: Drive,
        position_gain: float,
    ) -> None:
        self.axes = [axes[name] for name in robot.joint_names]
        self.first, self.second = (axes[name] for name in robot.gripper.joints)
        self._follow, self._limits = FOLLOWED / timestep, robot.column("effort_limit")
        shares, softness = _law(robot, timestep, drive, position_gain)
        self._shares = shares
        self._zeros = shares[0] * [axis.zero for axis in self.axes]
        self._driven: list[tuple[int, Any, Callable[[], float], float]] = []
        self._limp: list[tuple[int, Callable[[float], None]]] = []
        for k, axis in enumerate(self.axes):
            limit = float(self._limits[k])
            if axis is self.second:
                limit *= 2
            else:
                if softness[k] is not None:
                    axis.joint.setParam(SOFTNESS, softness[k])
                if softness[k] == np.inf:
                    limit = 0.0
                    self._limp.append((k, axis.push))
                else:
                    self._driven.append((k, axis.joint, axis.angle, float(shares[0, k])))
            axis.joint.setParam(MOST_FORCE, limit)
        self.rotors = {
            name: Rotor(world, axes[name], inertia, timestep)
            for name, inertia in zip(robot.joint_names, robot.column("armature"), strict=True)
            if inertia > 0
        }
        start = robot.column("initial_position")
        self.command(start, 0 * start, 0 * start)

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        """Set points of all joints."""
        self.commanded = position, velocity, effort
        p, v, e = self._shares
        self._asked = (p * position + v * velocity + e * effort - self._zeros).tolist()

    def gain(self, axis: Axis) -> float:
        """Velocity that a drive asks for at a unit position error [1/s]."""
        return float(self._shares[0, self.axes.index(axis)])

    def act(self) -> None:
        """Before a step: tell the motors what they are asked for."""
        asked = self._asked
        for k, joint, angle, gain in self._driven:
            joint.setParam(VELOCITY, asked[k] - gain * angle())
        for k, push in self._limp:
            push(float(np.clip(self.commanded[2][k], -self._limits[k], self._limits[k])))
        first, second = self.first, self.second
        gap = first.position() - second.position()
        second.joint.setParam(VELOCITY, first.rate() + self._follow * gap)
        for rotor in self.rotors.values():
            rotor.turn()

    def state(self) -> FloatArray:
        """Positions and velocities, (2, n_joints)."""
        return np.array(
            [[axis.position() for axis in self.axes], [axis.rate() for axis in self.axes]]
        )


def _law(
    robot: Robot, timestep: float, drive: Drive, position_gain: float
) -> tuple[FloatArray, list[float | None]]:
    """What the motors are told, see the module.

    Returns:
        Shares of position, velocity and effort in Vel, (3, n_joints). CFM of each motor: None for
        the world's, infinite for a joint without stiffness and damping, whose motor is off.
    """
    n = len(robot.joints)
    if drive == "velocity":
        return np.outer([position_gain, 0.0, 0.0], np.ones(n)), [None] * n
    stiffness, damping = robot.column("stiffness"), robot.column("damping")
    resistance = timestep * stiffness + damping
    given = np.where(resistance > 0, resistance, 1.0)
    softness = [1 / float(value) if value > 0 else np.inf for value in resistance]
    return np.stack([stiffness, damping, np.ones(n)]) / given, list(softness)
