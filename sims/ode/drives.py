"""Drives and rotors, all of them motors of ODE's joints.

A motor of ODE is a row of the constraint solver: joint velocity + CFM x effort = Vel, the effort
bounded by FMax. What it does follows from Vel and CFM:

- `spring`: with Vel = (k (q* - q) + d v* + tau_ff) / (h k + d) and CFM = 1 / (h k + d) the effort
  is k (q* - q - h v) + d (v* - v) + tau_ff at the velocity v after the step h: the scene's drive
  law, implicit, and clipped to the limit within the solver.
- `velocity`: Vel = P (q* - q), what Webots does with its motors; CFM is the world's. A joint that
  has a motor alone (`scene.Joint`) obeys the drive law here too.
- at a stop ODE does not put the motor into the solver: it pushes with all of FMax, whatever Vel is.
  A drawer of 1.4 kg that begins at its stop left with 15 m/s, of a motor that brakes with at most
  10 kN. So at a stop FMax is, for that step, what the law asks for, of joints that are neither
  fingers nor coupled.
- a rotor of inertia J: with Vel the present velocity and CFM = h / J the effort is that which
  accelerates it, -J dv / h, and FMax has no limit. It is a motor of its own beside the drive's.
- so are a joint's own spring and damping, by the drive law without a limit, and its dry friction:
  Vel = 0 and FMax the friction. With the velocity after the whole step a spring k loses energy as
  if h k damped it; one that is soft enough takes the velocity after `EXPLICIT` of the step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from pytest_simbench.scene import FloatArray, Joint, Robot
from pytest_simbench.simulator import lazy_import

from .axes import Axis
from .coupling import Pinion
from .library import HI_STOP, LO_STOP, MOST_FORCE, SOFTNESS, VELOCITY

ode = lazy_import("ode")

Drive = Literal["spring", "velocity"]

WEAKEST = 1e-9
"""Least resistance h k + d of a drive [N m s/rad or N s/m]: a joint without k and d has no CFM."""


EXPLICIT = 0.01
"""Share of the step after which a spring is told where it stands, where h^2 k is below the child's
own inertia: stable without any, up to four times that."""


class Passive:
    """What a joint does by itself: its spring, damping, dry friction and rotor.

    Args:
        rotor: its inertia as seen at the joint [kg m^2 or kg]; 0: none.
        timestep: [s].

    Attributes:
        gain: velocity that the spring asks for at unit distance from its rest [1/s].
        ahead: time after which the spring is told where it stands [s].
        damper: motor that is spring and damping; None for neither.
        brake, rotor: motors that are friction and rotor; None for none.
    """

    def __init__(self, world: Any, axis: Axis, joint: Joint, rotor: float, timestep: float) -> None:
        self.axis, self.rest = axis, joint.rest
        soft = timestep**2 * joint.spring < axis.inertia()
        self.ahead = (EXPLICIT if soft else 1.0) * timestep
        resistance = self.ahead * joint.spring + joint.passive_damping
        self.gain = joint.spring / resistance if resistance else 0.0
        self.damper = _motor(world, axis, 1 / resistance if resistance else None)
        self.rotor = _motor(world, axis, timestep / rotor if rotor else None)
        self.brake = axis.motor(world) if joint.friction else None
        if self.brake is not None:
            self.brake.setParam(MOST_FORCE, joint.friction)

    def act(self) -> None:
        """Before a step: the spring is told where the joint stands, the rotor its velocity."""
        if self.gain:
            self.damper.setParam(VELOCITY, self.gain * (self.rest - self.axis.position()))
        if self.rotor is not None:
            self.rotor.setParam(VELOCITY, self.axis.rate())


def _motor(world: Any, axis: Axis, softness: float | None) -> Any:
    """A motor without a limit beside the drive's, of this CFM; None for none."""
    if softness is None:
        return None
    motor = axis.motor(world)
    motor.setParam(MOST_FORCE, ode.Infinity)
    motor.setParam(SOFTNESS, softness)
    return motor


class Drives:
    """The drives of a robot.

    Args:
        timestep: [s].
        position_gain: P of the kind `velocity` [1/s].

    Attributes:
        passive: what joints do by themselves, by name; two coupled fingers have no rotors.
        pinions: couple joints, by follower; that of two fingers has their rotors.
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
        self._shares, softness = _law(robot, timestep, drive, position_gain)
        self._zeros = self._shares[0] * [axis.zero for axis in self.axes]
        fingers = [axes[name] for name in robot.gripper.joints]
        self._softness = dict(zip(self.axes, softness, strict=True))
        self._limits = dict(zip(self.axes, robot.column("effort_limit").tolist(), strict=True))
        for axis, soft in self._softness.items():
            axis.joint.setParam(MOST_FORCE, self._limits[axis])
            if soft is not None:
                axis.joint.setParam(SOFTNESS, soft)
        inertias = dict(zip(robot.joint_names, robot.column("armature"), strict=True))
        self.pinions: dict[str, Pinion] = {}
        for pair in (*robot.gripper.couplings, *robot.couplings):
            rotors = 0.0
            if pair in robot.gripper.couplings and len(fingers) == 2:
                rotors = sum(inertias.pop(name) for name in robot.gripper.joints)
            self.pinions[pair.follower] = Pinion(world, pair, axes, rotors, timestep)
        self.passive: dict[str, Passive] = {}
        for joint in robot.joints:
            rotor = inertias.get(joint.name, 0.0)
            self.passive[joint.name] = Passive(world, axes[joint.name], joint, rotor, timestep)
        coupled = {*fingers, *(a for pinion in self.pinions.values() for a in pinion.joints)}
        self._motors = []
        for axis, gain, soft in zip(self.axes, self._shares[0], softness, strict=True):
            eased = soft is not None and axis not in coupled and not axis.wide
            stops = [axis.joint.getParam(end) for end in (LO_STOP, HI_STOP)]
            stops = stops if eased else [-np.inf, np.inf]
            self._motors.append((axis, axis.joint.setParam, axis.angle, float(gain), *stops))
        self._eased: list[Axis] = []
        start = robot.column("initial_position")
        self.command(start, 0 * start, 0 * start)
        for pinion in self.pinions.values():
            pinion.mesh()

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
        for motor, asked in zip(self._motors, self._asked, strict=True):
            axis, tell, angle, gain, low, high = motor
            at = angle()
            velocity = asked - gain * at
            tell(VELOCITY, velocity)
            if not low < at < high:
                effort = abs(velocity - axis.rate()) / (self._softness[axis] or 1.0)
                tell(MOST_FORCE, min(self._limits[axis], effort))
                self._eased.append(axis)
        for passive in self.passive.values():
            passive.act()
        for pinion in self.pinions.values():
            pinion.mesh()

    def rest(self) -> None:
        """After a step: all have their largest effort again."""
        while self._eased:
            axis = self._eased.pop()
            axis.joint.setParam(MOST_FORCE, self._limits[axis])

    def state(self) -> FloatArray:
        """Positions and velocities, (2, n_joints)."""
        return np.array([(axis.position(), axis.rate()) for axis in self.axes]).reshape(-1, 2).T


def _law(
    robot: Robot, timestep: float, drive: Drive, position_gain: float
) -> tuple[FloatArray, list[float | None]]:
    """What the motors are told, see the module.

    Returns:
        Shares of position, velocity and effort in Vel, (3, n_joints), and CFM of each motor, None
        for the world's.
    """
    stiffness, damping = robot.column("stiffness"), robot.column("damping")
    resistance = np.maximum(timestep * stiffness + damping, WEAKEST)
    shares = np.stack([stiffness, damping, np.ones(len(resistance))]) / resistance
    softness = (1 / resistance).tolist()
    if drive == "velocity":
        held = [k for k, joint in enumerate(robot.joints) if not joint.motor]
        shares[:, held] = [[position_gain], [0.0], [0.0]]
        softness = [None if k in held else soft for k, soft in enumerate(softness)]
    return shares, softness
