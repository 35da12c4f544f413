"""Drives: CoppeliaSim's control of joints.

- `position`: the program's own. It asks for a velocity of 20/s times the position error, held by
  the engine with at most the effort limit. Set points of velocity are not known to it.
- `velocity`: the same motor, told before each step v* + gain (q* - h v* - q) / h.
- `force`: the scene's law, told before each step; MuJoCo alone. d (v* - v) is stable only with the
  velocity after the step, so -d v is MuJoCo's damping of the joint, and what is told is
  clip(k (q* - q) + d v* + tau_ff - d v', +-limit) + d v'. Here v' is the velocity after the step,
  foretold by the last change: an error in it counts at the limit alone.

A joint that has a motor alone (`scene.Joint`) is always told its force.
"""

from __future__ import annotations

from collections.abc import Mapping
from ctypes import byref, c_double

import numpy as np

from pytest_simbench.scene import Coupling, FloatArray, Joint
from pytest_simbench.simulator import NotSupportedError, PreparedRobot

from .library import call, get_pose, library, set_float, set_int
from .settings import CoppeliaSimSettings
from .world import Part

MODES = {"force": 1, "velocity": 4, "position": 8}
"""The program's names of them (sim_jointdynctrl_...)."""


class Drives:
    """The drives of a robot.

    Args:
        joints: their handles, by name.

    Attributes:
        commanded: the last set points: position, velocity, effort.
        handles: of the joints, in the robot's order.
        ends: the links before and behind each, and its kind.
        forced: whether each is told its force.
        led: for each other finger, by number, that which leads it; none where the engine couples.
    """

    def __init__(
        self,
        prepared: PreparedRobot,
        links: Mapping[str, Part],
        joints: Mapping[str, int],
        settings: CoppeliaSimSettings,
    ) -> None:
        robot, self.settings = prepared.robot, settings
        self.own = settings.engine == "mujoco"
        if settings.drive == "force" and not self.own:
            raise NotSupportedError(
                f"coppeliasim.drive=force needs engine=mujoco, not {settings.engine}: the other "
                "engines damp no joints; choose drive=velocity or drive=position"
            )
        passive = any(
            joint.passive_damping or joint.friction or joint.spring or joint.gravity != 1
            for joint in robot.joints
        )
        if not self.own and (passive or robot.couplings):
            raise NotSupportedError(
                f"coppeliasim with engine={settings.engine} gives joints no damping, friction or "
                "springs, couples fingers alone, and gives links their whole weight; choose "
                "coppeliasim.engine=mujoco"
            )
        self._names, self._start = robot.joint_names, robot.column("initial_position")
        self.handles = [joints[name] for name in robot.joint_names]
        by_name = {joint.name: joint for joint in prepared.joints}
        self.ends = [
            (links[by_name[name].parent], links[by_name[name].child], by_name[name].kind)
            for name in robot.joint_names
        ]
        self.stiffness, self.damping = robot.column("stiffness"), robot.column("damping")
        self.limits = robot.column("effort_limit")
        motors = np.array([joint.motor for joint in robot.joints], dtype=bool)
        self.forced = motors | (settings.drive == "force")
        index = robot.joint_names.index
        hand = [(index(pair.follower), index(pair.leader)) for pair in robot.gripper.couplings]
        self.led: dict[int, int] = {} if self.own else dict(hand)
        self._coupled = [[*pair] for pair in hand] if self.own else []
        for pair in (*robot.gripper.couplings, *robot.couplings) if self.own else ():
            law = c_double(pair.offset - self.offset(pair, pair.ratio)), c_double(pair.ratio)
            call("simSetJointDependency_D", joints[pair.follower], joints[pair.leader], *law)
        for k, (handle, joint) in enumerate(zip(self.handles, robot.joints, strict=True)):
            set_int(handle, "dynCtrlMode", MODES["force" if self.forced[k] else settings.drive])
            most = joint.effort_limit * (2 if k in self.led else 1)  # it bears the leader's too
            call(
                "simSetJointTargetForce_D", handle, c_double(0.0 if self.forced[k] else most), True
            )
            if self.own:
                self._set_passive(handle, joint)
        tell = library()
        self._tell_force = tell.simSetJointTargetForce_D
        self._tell_velocity = tell.simSetJointTargetVelocity_D
        self._tell_position = tell.simSetJointTargetPosition_D
        self._value = c_double()
        self._last = np.zeros(len(self.handles))
        self.command(self._start, 0 * self._start, 0 * self._start)

    def _set_passive(self, handle: int, joint: Joint) -> None:
        """What MuJoCo gives a joint of its own."""
        drive = self.settings.drive == "force" and not joint.motor
        set_float(handle, "mujoco.armature", joint.armature)
        set_float(handle, "mujoco.frictionLoss", joint.friction)
        set_float(handle, "mujoco.springStiffness", joint.spring)
        set_float(handle, "mujoco.springRef", joint.rest)
        set_float(handle, "mujoco.springDamping", joint.passive_damping + drive * joint.damping)

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        """Set points of all joints."""
        position, velocity, effort = position.copy(), velocity.copy(), effort.copy()
        self.commanded = position, velocity, effort
        for pair in self._coupled:  # both drives pull at one joint; MuJoCo's coupling is soft
            for told in self.commanded:
                told[pair] = told[pair].mean()

    def act(self) -> None:
        """Before a step: tell the joints what they are asked for."""
        position, velocity, effort = self.commanded
        if self.forced.any():
            q, v = self.state()
            damping = np.where(self.damping, self.damping, 0.0)
            asked = self.stiffness * (position - q) + damping * velocity + effort
            after = damping * (2 * v - self._last)
            self._last = v
            forces = np.clip(asked - after, -self.limits, self.limits) + after
            for k in np.flatnonzero(self.forced).tolist():
                self._tell_force(self.handles[k], c_double(forces[k]), True)
        if self.settings.drive == "force":
            return
        step = self.settings.timestep
        places = [self.position(k) for k in range(len(self.handles))]
        for k, handle in enumerate(self.handles):
            if self.forced[k]:
                continue
            leader = self.led.get(k)
            goal, speed = position[k], velocity[k]
            if leader is not None:
                goal, speed = places[leader], 0.0
            if self.settings.drive == "position":
                self._tell_position(handle, c_double(goal))
            else:
                gain = self.settings.position_gain / step
                rate = speed + gain * (goal - step * speed - places[k])
                self._tell_velocity(handle, c_double(rate))

    def offset(self, pair: Coupling, ratio: float) -> float:
        """Of a pair at the start [rad or m], from where MuJoCo counts the one that it is told."""
        start = dict(zip(self._names, self._start.tolist(), strict=True))
        return float(start[pair.follower] - ratio * start[pair.leader])

    def leads(self, pair: Coupling) -> bool:
        """Whether the drive of a finger is led by the other one."""
        names = self._names
        return self.led.get(names.index(pair.follower)) == names.index(pair.leader)

    def position(self, k: int) -> float:
        """Of a joint, by its number [rad or m]."""
        call("simGetJointPosition_D", self.handles[k], byref(self._value))
        return self._value.value

    def state(self) -> FloatArray:
        """Positions and velocities, (2, n_joints)."""
        count = range(len(self.handles))
        return np.array([[self.position(k) for k in count], [self._velocity(k) for k in count]])

    def _velocity(self, k: int) -> float:
        """Of a joint [rad/s or m/s]; but with MuJoCo the program tells none while it is stepped
        from outside, and it is that of the bodies."""
        if self.own:
            call("simGetJointVelocity_D", self.handles[k], byref(self._value))
            return self._value.value
        parent, child, kind = self.ends[k]
        axis = get_pose(self.handles[k]).rotation()[:, 2]
        (v, w), (u, r) = child.velocity(), parent.velocity()
        if kind == "revolute":
            return float(axis @ (w - r))
        return float(axis @ (v - u - np.cross(r, child.centre() - parent.centre())))
