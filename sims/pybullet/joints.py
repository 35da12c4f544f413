"""What Bullet's joints do: Bullet's own motors as drives; beside them joints that move together,
friction, and efforts of springs, dampers and the scene's motors.

Bullet's own dampers push by the speed before a step: one that would stop its joint in less than
half a step throws it. So the adapter asks Bullet for masses and loads, and pushes once a step.
"""

from __future__ import annotations

import math

import numpy as np

from pytest_simbench.scene import Coupling, FloatArray, Robot
from pytest_simbench.simulator import lazy_import

from .settings import PyBulletSettings

pybullet = lazy_import("pybullet")

NONE = 1e-12
"""A ratio that is nothing. PyBullet passes over one of 0."""


def gear(client: int, robot: int, joint: int, other: int, **values: float) -> int:
    """A constraint q + `gearRatio` q_other = `relativePositionTarget`; Bullet's number of it."""
    here = [0, 0, 0]
    made: int = pybullet.createConstraint(
        robot, joint, robot, other, pybullet.JOINT_GEAR, [0, 1, 0], here, here,
        physicsClientId=client,
    )  # fmt: skip
    pybullet.changeConstraint(made, **values, physicsClientId=client)
    return made


def couple(client: int, robot: int, leader: int, follower: int, pair: Coupling) -> int:
    """Move two joints together, each with up to 1000 N m or N at least."""
    ratio = pair.ratio or NONE
    values = {"gearRatio": -1 / ratio, "relativePositionTarget": -pair.offset / ratio}
    most = 1000 * max(1.0, abs(ratio))  # of the leader; the follower's is `ratio` times less
    return gear(client, robot, leader, follower, erp=0.2, maxForce=most, **values)


def rub(client: int, robot: int, joint: int, friction: float) -> int:
    """Dry friction: what stops the joint, with at most this effort [N m or N]."""
    return gear(client, robot, joint, joint, gearRatio=NONE, maxForce=friction)


def gears(client: int, constraints: list[int]) -> dict[tuple[int, int], tuple[float, float, float]]:
    """Those of the constraints that are gears: largest effort, ratio and target, by Bullet's
    numbers of both joints."""
    found = {}
    for constraint in constraints:
        info = pybullet.getConstraintInfo(constraint, physicsClientId=client)
        if info[0] == info[2] and info[4] == pybullet.JOINT_GEAR:
            found[info[1], info[3]] = (info[10], info[11], info[13])
    return found


class Pushed:
    """Springs, dampers and motors of the joints, pushed by the adapter.

    Pushed by the present state, tau = k (rest - q) - d v, light joints would be thrown. So it is
    tau - (dt d + dt^2 k / 4) a, with the acceleration a that the joints are about to have: stable
    for all k and d (of d as in the implicit Euler method, of k as in Newmark's, which takes no
    energy). What Bullet's motors and contacts do to a is taken from the last step, so that a joint
    that they hold feels all of its spring.

    Args:
        client, robot: Bullet's numbers.
        described: has their springs, dampers and motors, in the same order.
        timestep: dt [s].

    Attributes:
        last: of the last step: masses, velocities, and efforts but those of Bullet's motors and of
            contacts.
    """

    def __init__(
        self, client: int, robot: int, joints: list[int], described: Robot, timestep: float
    ) -> None:
        self._order = order = np.argsort(joints)  # that of Bullet's mass matrix
        self._client, self._robot, self._timestep = client, robot, timestep
        self._joints = [joints[k] for k in order]
        self._k, self._rest, self._d = (
            described.column(name)[order] for name in ("spring", "rest", "passive_damping")
        )
        self._most = np.array([j.effort_limit if j.motor else 0.0 for j in described.joints])
        self._held = timestep * self._d + timestep**2 / 4 * self._k
        self.last: tuple[FloatArray, FloatArray, FloatArray] | None = None

    def command(self, effort: FloatArray) -> None:
        """What the motors push from now on."""
        self._told = np.clip(effort, -self._most, self._most)[self._order]

    def push(self) -> None:
        """For the next step."""
        c, robot = {"physicsClientId": self._client}, self._robot
        states = pybullet.getJointStates(robot, self._joints, **c)
        q, v = [state[0] for state in states], np.array([state[1] for state in states])
        load = pybullet.calculateInverseDynamics(robot, q, v.tolist(), [0.0] * len(q), **c)
        mass = np.array(pybullet.calculateMassMatrix(robot, q, **c))
        effort = self._told + self._k * (self._rest - q) - self._d * v
        free = effort - load
        if self.last is not None:
            before, speeds, known = self.last
            free += before @ (v - speeds) / self._timestep - known
        effort -= self._held * np.linalg.solve(mass + np.diag(self._held), free)
        self.last = mass, v, effort - load
        pybullet.setJointMotorControlArray(
            robot, self._joints, pybullet.TORQUE_CONTROL, forces=effort, **c
        )


WEAKEST = 1e-9
"""Least resistance h k + d of a drive [N m s/rad or N s/m]: a joint may have neither."""


class Drives:
    """Bullet's own position motors as drives of all joints that move: velocity constraints whose
    largest force is the effort limit.

    Each step h they ask for the velocity v + `velocityGain` (v* - v) + `positionGain` (q* - q) / h.
    Where no gain is set they are told what makes it that at which the scene's drive law
    (`scene.Joint`) asks for no effort at the end of the step, (k (q* - q) + d v*) / (h k + d): they
    are that law, infinitely stiff at the same k / d. A higher rate, as of a gain of 0.3 (72/s
    against k / d = 10/s), brakes too late once the effort saturates: joint 1 of the Panda goes 53 %
    of its way too far. Bullet clips q* to the joint's limits, which the law does not: v* makes up
    for it.

    Two fingers have a gain of their own. Told apart, both motors must come to their limits before
    the gear between them gets its way, and at the law's rate (25/s) 50 iterations bring them to 14
    of 25 N: they stay 16.5 mm apart.

    Args:
        client, number: Bullet's numbers of the client and the robot.
        joints: Bullet's numbers, in the order of the robot's.

    Attributes:
        gains: `positionGain` and `velocityGain` of each joint.
    """

    def __init__(
        self, client: int, number: int, joints: list[int], robot: Robot, settings: PyBulletSettings
    ) -> None:
        self._client, self._number, self._joints = client, number, joints
        self._forces = [0.0 if joint.motor else joint.effort_limit for joint in robot.joints]
        n, step, gain = len(joints), settings.timestep, settings.position_gain
        k, d = robot.column("stiffness"), robot.column("damping")
        self._share = np.ones(n) if gain is not None else d / np.maximum(step * k + d, WEAKEST)
        coupled = robot.finger_indices if robot.gripper.couplings else []
        self._share[coupled] = 1.0
        self._rate = (1 - self._share) / step
        gains = 1 - self._share if gain is None else np.full(n, gain)
        gains[coupled] = settings.finger_gain
        self.gains = gains, np.full(n, settings.velocity_gain)
        infos = [pybullet.getJointInfo(number, joint, physicsClientId=client) for joint in joints]
        self._limits = np.array([info[8:10] for info in infos]).reshape(-1, 2).T
        self._limits[:, self._limits[0] > self._limits[1]] = [[-math.inf], [math.inf]]

    def command(self, position: FloatArray, velocity: FloatArray) -> None:
        """What the drives are told from now on."""
        beyond = position - np.clip(position, *self._limits)
        pybullet.setJointMotorControlArray(
            self._number,
            self._joints,
            pybullet.POSITION_CONTROL,
            position,
            self._share * velocity + self._rate * beyond,
            self._forces,
            *self.gains,
            physicsClientId=self._client,
        )
