"""Drives: Gazebo's velocity commands of joints.

A velocity command is a constraint of the engine, solved together with the contacts, the joint's
effort limit the largest force. It holds for one step. So each step tells each joint
v* + gain (q* - h v* - q) / h, as Gazebo's ros2_control does it (its gain is 0.1). Without a gain of
the settings it is h k / (h k + d), at which the scene's drive law (`scene.Joint`) asks for no
effort. A higher one (0.5, 500/s against k / d = 10/s) brakes too late once the effort saturates:
joint 1 of the Panda went 92 % of its way too far.

And forces and torques on free bodies, each for one step: those of the scene, and those that give
what Gazebo's engines do not have, a velocity at the start and damping.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pytest_simbench.scene import Body, FloatArray, Robot, rotation_matrix

from .server import Server, bindings

WEAKEST = 1e-9
"""Of a joint that has no drive of its own [N m s/rad or N s/m]."""


class Drives:
    """The drives of a robot.

    Args:
        model: of the robot, an entity of the bindings.
        timestep: [s].
        gain: share of the position error that a step corrects; None: as the drive law does.
        coupled: whether the engine couples the fingers; else the others are led by the first.

    Attributes:
        joints: Gazebo's, in the robot's order.
        zeros: the robot's positions where Gazebo's are 0 [rad or m], (n_joints,).
    """

    def __init__(
        self,
        server: Server,
        model: Any,
        robot: Robot,
        timestep: float,
        gain: float | None,
        coupled: bool,
    ) -> None:
        self.ecm, self._names = server.ecm, robot.joint_names
        self.joints = [
            bindings().sim.Joint(model.joint_by_name(self.ecm, name)) for name in robot.joint_names
        ]
        self.zeros = robot.column("initial_position")
        for joint in self.joints:
            joint.enable_position_check(self.ecm)
            joint.enable_velocity_check(self.ecm)
        index = robot.joint_names.index
        fingers = [index(name) for name in robot.gripper.joints]
        self._first = fingers[0] if fingers else -1
        self._led = [] if coupled else fingers[1:]
        k, d = timestep * robot.column("stiffness"), robot.column("damping")
        gains = k / np.maximum(k + d, WEAKEST) if gain is None else np.full(len(k), gain)
        self._gain, self._share = gains / timestep, 1 - gains
        self._driven = [n for n in range(len(self.joints)) if n not in self._led]
        self._told = [
            (self.joints[n].position, self.joints[n].set_velocity, float(self._gain[n]))
            for n in self._driven
        ]
        self._state = np.stack([self.zeros, 0 * self.zeros])
        self.command(self.zeros, 0 * self.zeros)

    def command(self, position: FloatArray, velocity: FloatArray) -> None:
        """Set points of all joints [rad or m, rad/s or m/s]."""
        asked = self._gain * (position - self.zeros) + self._share * velocity
        self._asked = asked[self._driven].tolist()

    def act(self) -> None:
        """Before a step: tell the joints what they are asked for."""
        ecm = self.ecm
        for (position, tell, gain), asked in zip(self._told, self._asked, strict=True):
            found = position(ecm)
            tell(ecm, [asked - gain * (found[0] if found else 0.0)])
        if self._led:
            self._lead()

    def _lead(self) -> None:
        """Move the other fingers as the first one does.

        One that is led is a step late: while the first one opens, the others are asked for what
        it is asked for.
        """
        ecm, first = self.ecm, self.joints[self._first]
        place = (first.position(ecm) or [0.0])[0]
        speed = (first.velocity(ecm) or [0.0])[0]
        gain = float(self._gain[self._first])
        asked = self._asked[self._driven.index(self._first)] - gain * place
        if asked > 0:
            speed = max(speed, asked)
        for number in self._led:
            joint = self.joints[number]
            behind = place - (joint.position(ecm) or [0.0])[0]
            joint.set_velocity(ecm, [speed + gain * behind])

    def leads(self, first: str, other: str) -> bool:
        """Whether one joint is led by another."""
        names = self._names
        return names.index(first) == self._first and names.index(other) in self._led

    def state(self) -> FloatArray:
        """Positions and velocities, (2, n_joints); before the first step those of the file."""
        rows = [[joint.position(self.ecm), joint.velocity(self.ecm)] for joint in self.joints]
        if any(value is None or not value for row in rows for value in row):
            return self._state.copy()
        state = np.array([[p[0], v[0]] for p, v in rows]).T
        state[0] += self.zeros
        return np.asarray(state)


class Wrenches:
    """Forces and torques on the free bodies.

    Args:
        timestep: [s].
        turned: whether the engine takes a torque in the body's axes, not in the world's.

    Attributes:
        thrown: velocities at the start, (n_free, 6).
    """

    def __init__(
        self, ecm: Any, bodies: tuple[Body, ...], links: list[Any], timestep: float, turned: bool
    ) -> None:
        self._ecm, self._timestep, self._turned, self._links = ecm, timestep, turned, links
        self.thrown = np.array([body.velocity for body in bodies]).reshape(-1, 6)
        self._damped = [
            (row, body, links[row], np.expm1(-timestep * np.repeat(body.damping, 3)))
            for row, body in enumerate(bodies)
            if np.any(body.damping)
        ]
        for body, link in zip(bodies, links, strict=True):
            if body.mass and body.velocity.any():  # not a prescribed one
                self._change(link, body, body.pose.rotation(), body.velocity)

    def act(self, states: FloatArray) -> None:
        """Before a step: damp the bodies that the scene damps. A step of duration h leaves
        exp(-c h) of a velocity.

        Args:
            states: of the free bodies, (n_free, 13).
        """
        for row, body, link, lost in self._damped:
            turn = rotation_matrix(states[row, 3:7])
            self._change(link, body, turn, lost * states[row, 7:])

    def push(self, wrenches: FloatArray, states: FloatArray) -> None:
        """The scene's forces and torques, (n_free, 6), for one step; states as of `act`."""
        for row, wrench in enumerate(wrenches):
            if wrench.any():
                self._add(self._links[row], rotation_matrix(states[row, 3:7]), wrench)

    @property
    def damps(self) -> bool:
        """Whether any body is damped."""
        return bool(self._damped)

    def _change(self, link: Any, body: Body, turn: FloatArray, by: FloatArray) -> None:
        """Give a body other velocities in the next step [m/s, rad/s], (6,).

        A force m v / h changes a velocity by v in a step of duration h. Gazebo's own velocity
        commands would hold on in all further steps.
        """
        inertia = turn @ np.diag(body.inertia()) @ turn.T
        wrench = np.concatenate([body.mass * by[:3], inertia @ by[3:]]) / self._timestep
        self._add(link, turn, wrench)

    def _add(self, link: Any, turn: FloatArray, wrench: FloatArray) -> None:
        """A force and a torque in the world's axes [N, N m], (6,), for one step."""
        vector3 = bindings().math.Vector3d
        torque = turn.T @ wrench[3:] if self._turned else wrench[3:]
        link.add_world_wrench(self._ecm, vector3(*wrench[:3]), vector3(*torque))
