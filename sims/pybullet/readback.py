"""What Bullet says that it built, for the parity check.

Bullet keeps links and bodies in their inertial frames: poses, shapes and inertias are given there,
and led back to the frames of the description here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pytest_simbench.description.shapes import Outline, a_box, a_cylinder, a_mesh, a_round
from pytest_simbench.parity import readback
from pytest_simbench.scene import Coupling, FloatArray, Pose
from pytest_simbench.simulator import heavy, lazy_import

from .joints import gears
from .world import inertial_frame, points, pose_of

pybullet = lazy_import("pybullet")


Part = tuple[int, int]
"""Bullet's numbers of a body and of a link of it, -1 for its base."""


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` that Bullet tells."""

    def __init__(self, simulator: Any) -> None:
        self.c, self.robot, self.joints = simulator.client, simulator._robot, simulator._joints
        super().__init__(
            simulator,
            (simulator._ground, -1),
            {name: (number, -1) for name, number in simulator._bodies.items()},
            {name: (self.robot, number) for name, number in simulator._links.items()},
        )
        self.gears, self.loops = gears(self.c, simulator._couplings), simulator._closures
        self.held = self._held()

    def world(self) -> dict[str, Any]:
        engine = pybullet.getPhysicsEngineParameters(physicsClientId=self.c)
        place, _ = pybullet.getBasePositionAndOrientation(self.ground[0], physicsClientId=self.c)
        return {
            "gravity": [engine[f"gravityAcceleration{axis}"] for axis in "XYZ"],
            "timestep": engine["fixedTimeStep"],
            "ground/height": place[2],
        }

    def body(self, part: Part, name: str) -> dict[str, Any]:
        # else fixed, or it moves as prescribed
        free = 0 < self._dynamics(part)[0] < heavy(self.scene)
        found: dict[str, Any] = {"dynamic": float(free and part[0] not in self.held)}
        if free:
            velocity = pybullet.getBaseVelocity(part[0], physicsClientId=self.c)
            found |= self.inertial(part) | {"velocity": np.concatenate(velocity)}
        return found

    def joint(self, name: str) -> dict[str, Any]:
        joint = self.joints[self.prepared.robot.joint_names.index(name)]
        info = pybullet.getJointInfo(self.robot, joint, physicsClientId=self.c)
        state = pybullet.getJointState(self.robot, joint, physicsClientId=self.c)
        return {
            "limits": info[8:10],
            # a motor has no damping besides
            "friction": info[6] + info[7] + self.gears.get((joint, joint), [0.0])[0],
            "initial_position": state[0],
            "axis": self._axis(joint),
        }

    def closures(self) -> list[tuple[FloatArray, bool]]:
        return [points(self.c, closure) for closure in self.loops]

    def touches(self) -> dict[str, Any]:
        return {}

    def pose(self, part: Part) -> FloatArray:
        return self._frame(part).as_array()

    def surface(self, part: Part) -> dict[str, Any]:
        dynamics = self._dynamics(part)
        return {
            "friction": dynamics[1] ** 2,
            "restitution": dynamics[5] ** 2,
            "margin": dynamics[11] - self._within(part, dynamics[11]),
        }

    def inertial(self, part: Part) -> dict[str, Any]:
        dynamics, inertial = self._dynamics(part), inertial_frame(self.c, *part)
        axes = inertial.rotation()
        return {
            "mass": dynamics[0],
            "com": inertial.position,
            "inertia": axes @ np.diag(dynamics[2]) @ axes.T,
        }

    def shapes(self, part: Part) -> Iterator[Outline]:
        inertial = inertial_frame(self.c, *part)
        for k, (_, _, kind, size, _, place, turn) in enumerate(self._shapes(part)):
            pose = inertial * pose_of(place, turn)
            if kind == pybullet.GEOM_BOX:
                yield a_box(size, pose)
            elif kind == pybullet.GEOM_SPHERE:
                yield a_round(size[0], 0.0, pose)
            elif kind == pybullet.GEOM_CAPSULE:
                yield a_round(size[1], size[0], pose)
            elif kind == pybullet.GEOM_CYLINDER:
                yield a_cylinder(size[1], size[0], pose)
            else:  # Bullet's own corners, already in the inertial frame
                mesh = pybullet.getMeshData(*part, collisionShapeIndex=k, physicsClientId=self.c)
                corners = np.reshape(mesh[1], (-1, 3)) if mesh[0] else np.full((1, 3), np.nan)
                yield a_mesh(corners, inertial)

    def _within(self, part: Part, margin: float) -> float:
        """What of a margin is no distance from the shape [m]: the radius of a sphere or capsule,
        which are a point and a line to Bullet, and all of a box or cylinder, which has it within
        its faces."""
        data = self._shapes(part)
        kind, size, _, place, turn = data[0][2:7]
        if len(data) > 1 or any([*place, *turn[:3]]):  # Bullet tells the margin of the compound
            return 0.0
        if kind in (pybullet.GEOM_BOX, pybullet.GEOM_CYLINDER):
            return margin
        if kind == pybullet.GEOM_SPHERE:
            return float(size[0])
        return float(size[1]) if kind == pybullet.GEOM_CAPSULE else 0.0

    def _axis(self, joint: int) -> FloatArray:
        """Motion subspace of a joint, from Bullet's Jacobian at the present state.

        It is that of the point of the joint's child where the joint is.
        """
        states = pybullet.getJointStates(self.robot, self.joints, physicsClientId=self.c)
        order = np.argsort(self.joints)
        positions = [states[i][0] for i in order]
        rest, column = [0.0] * len(positions), list(np.sort(self.joints)).index(joint)
        linear, angular = pybullet.calculateJacobian(
            self.robot, joint, [0.0] * 3, positions, rest, rest, physicsClientId=self.c
        )
        turn = self._frame((self.robot, joint)).rotation().T
        return np.concatenate(
            [turn @ np.array(angular)[:, column], turn @ np.array(linear)[:, column]]
        )

    def coupling(self, pair: Coupling) -> FloatArray:
        """Of a gear of both joints, else not a number."""
        joints = dict(zip(self.prepared.robot.joint_names, self.joints, strict=True))
        both = joints[pair.leader], joints[pair.follower]
        _, ratio, target = self.gears.get(both, [np.nan] * 3)
        return np.array([-1.0, target]) / ratio

    def _held(self) -> set[int]:
        """Bodies that a constraint holds."""
        held = set()
        for k in range(pybullet.getNumConstraints(physicsClientId=self.c)):
            constraint = pybullet.getConstraintUniqueId(k, physicsClientId=self.c)
            info = pybullet.getConstraintInfo(constraint, physicsClientId=self.c)
            held |= {info[0], info[2]}
        return held

    def _dynamics(self, part: Part) -> Any:
        return pybullet.getDynamicsInfo(*part, physicsClientId=self.c)

    def _shapes(self, part: Part) -> Any:
        return pybullet.getCollisionShapeData(*part, physicsClientId=self.c)

    def _frame(self, part: Part) -> Pose:
        """Of a body or link, in the world."""
        c, (body, link) = self.c, part
        if link < 0:
            centre = pybullet.getBasePositionAndOrientation(body, physicsClientId=c)
        else:
            state = pybullet.getLinkState(body, link, computeForwardKinematics=1, physicsClientId=c)
            centre = state[:2]
        return pose_of(*centre) * inertial_frame(self.c, *part).inverse()


def wrench(client: int, robot: int, joint: int, subspace: FloatArray) -> FloatArray:
    """On a joint's child about the origin of its frame, in the world, (6,).

    Bullet's sensor tells it about the child's centre of mass, in the axes of its inertial frame,
    and without the motor.

    Args:
        client, robot, joint: Bullet's numbers.
        subspace: of the joint, `description.links.motion_subspace`.
    """
    told = pybullet.getJointState(robot, joint, physicsClientId=client)
    state = pybullet.getLinkState(robot, joint, physicsClientId=client)
    inertial, link = (
        pose_of((0.0, 0.0, 0.0), quaternion).rotation() for quaternion in (state[1], state[5])
    )
    force = inertial @ told[2][:3] + told[3] * link @ subspace[3:]
    torque = inertial @ told[2][3:] + told[3] * link @ subspace[:3]
    arm = np.subtract(state[0], state[4])
    return np.concatenate([force, torque + np.cross(arm, force)])
