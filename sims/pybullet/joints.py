"""What Bullet's joints do beside Bullet's own motors: those that move together, friction, and
efforts of springs, dampers and the scene's motors.

Bullet's own dampers push by the speed before a step: one that would stop its joint in less than
half a step throws it. So the adapter asks Bullet for masses and loads, and pushes once a step.
"""

from __future__ import annotations

import numpy as np

from pytest_simbench.scene import Coupling, FloatArray, Robot
from pytest_simbench.simulator import lazy_import

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
        joints: of all joints that move.
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
