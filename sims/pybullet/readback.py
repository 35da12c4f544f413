"""What Bullet says that it built, for the parity check.

Bullet keeps links and bodies in their inertial frames: poses, shapes and inertias are given there,
and led back to the frames of the description here.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pytest_simbench.description.shapes import (
    box_corners,
    cylinder_reach,
    outlines,
    placed,
    reach,
    round_reach,
)
from pytest_simbench.parity import readback
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.simulator import heavy, lazy_import

from .world import points, pose_of

pybullet = lazy_import("pybullet")


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` that Bullet tells."""

    def __init__(self, simulator: Any) -> None:
        super().__init__(simulator)
        self.c, self.ground, self.bodies = simulator.client, simulator._ground, simulator._bodies
        self.robot, self.links, self.joints = simulator._robot, simulator._links, simulator._joints
        self.couplings, self.loops = simulator._couplings, simulator._closures
        self.held = self._held()

    def world(self) -> dict[str, Any]:
        engine = pybullet.getPhysicsEngineParameters(physicsClientId=self.c)
        ground = self._dynamics(self.ground)
        place, _ = pybullet.getBasePositionAndOrientation(self.ground, physicsClientId=self.c)
        return {
            "gravity": [engine[f"gravityAcceleration{axis}"] for axis in "XYZ"],
            "timestep": engine["fixedTimeStep"],
            "ground/height": place[2],
            "ground/friction": ground[1] ** 2,
            "ground/restitution": ground[5] ** 2,
        }

    def body(self, prefix: str, name: str) -> dict[str, Any]:
        body = self.bodies[name]
        # else fixed, or it moves as prescribed
        free = 0 < self._dynamics(body)[0] < heavy(self.scene)
        found = self._part(prefix, body, -1)
        if free:
            found |= self._inertial(prefix, body, -1)
            velocity = pybullet.getBaseVelocity(body, physicsClientId=self.c)
            found[f"{prefix}/velocity"] = np.concatenate(velocity)
        found[f"{prefix}/dynamic"] = float(free and body not in self.held)
        return found

    def link(self, prefix: str, name: str) -> dict[str, Any]:
        link = self.links[name]
        found = self._part(prefix, self.robot, link)
        return found | self._inertial(prefix, self.robot, link) if link >= 0 else found

    def joint(self, prefix: str, name: str) -> dict[str, Any]:
        joint = self.joints[self.prepared.robot.joint_names.index(name)]
        info = pybullet.getJointInfo(self.robot, joint, physicsClientId=self.c)
        state = pybullet.getJointState(self.robot, joint, physicsClientId=self.c)
        return {
            f"{prefix}/limits": info[8:10],
            f"{prefix}/friction": info[6] + info[7],  # a motor has no damping besides
            f"{prefix}/initial_position": state[0],
            f"{prefix}/axis": self._axis(joint),
        }

    def closures(self) -> list[FloatArray]:
        return [points(self.c, closure) for closure in self.loops]

    def touches(self) -> dict[str, Any]:
        return {}

    def _part(self, prefix: str, body: int, link: int) -> dict[str, Any]:
        """Pose, shapes and surface of a body or link."""
        dynamics, inertial = self._dynamics(body, link), self._inertial_frame(body, link)
        boxes, meshes, rounds = self._shapes(body, link)
        place = self._centre(body, link) * inertial.inverse()
        found: dict[str, Any] = {f"{prefix}/pose": place.as_array()}
        corners = ([reach(placed(points, inertial)) for points in kind] for kind in (boxes, meshes))
        outline = [*corners, rounds]
        found |= outlines(prefix, *outline)
        if boxes or meshes or rounds:
            found[f"{prefix}/friction"] = dynamics[1] ** 2
            found[f"{prefix}/restitution"] = dynamics[5] ** 2
            found[f"{prefix}/margin"] = dynamics[11] - self._thickness(body, link)
        return found

    def _inertial(self, prefix: str, body: int, link: int) -> dict[str, Any]:
        dynamics, inertial = self._dynamics(body, link), self._inertial_frame(body, link)
        axes = inertial.rotation()
        return {
            f"{prefix}/mass": dynamics[0],
            f"{prefix}/com": inertial.position,
            f"{prefix}/inertia": axes @ np.diag(dynamics[2]) @ axes.T,
        }

    def _shapes(self, body: int, link: int) -> tuple[list[FloatArray], ...]:
        """Corners (n, 3) of each box and of each mesh, in the inertial frame; and the reach of each
        sphere, cylinder and capsule, which only bodies have."""
        rounds: list[FloatArray] = []
        boxes: list[FloatArray] = []
        meshes: list[FloatArray] = []
        data = pybullet.getCollisionShapeData(body, link, physicsClientId=self.c)
        for k, (_, _, kind, size, _, place, turn) in enumerate(data):
            if kind == pybullet.GEOM_BOX:
                boxes.append(placed(box_corners(size), pose_of(place, turn)))
            elif kind == pybullet.GEOM_SPHERE:
                rounds.append(round_reach(size[0], 0.0, pose_of(place, turn)))
            elif kind == pybullet.GEOM_CAPSULE:
                rounds.append(round_reach(size[1], size[0], pose_of(place, turn)))
            elif kind == pybullet.GEOM_CYLINDER:
                rounds.append(cylinder_reach(size[1], size[0], pose_of(place, turn)))
            else:  # Bullet's own corners, already in the inertial frame
                mesh = pybullet.getMeshData(
                    body, link, collisionShapeIndex=k, physicsClientId=self.c
                )
                meshes.append(np.reshape(mesh[1], (-1, 3)) if mesh[0] else np.full((1, 3), np.nan))
        return boxes, meshes, rounds

    def _thickness(self, body: int, link: int) -> float:
        """Radius of a sphere or capsule, which are a point and a line to Bullet, their margin the
        rest [m]; else 0."""
        data = pybullet.getCollisionShapeData(body, link, physicsClientId=self.c)
        kind, size, _, place, turn = data[0][2:7]
        if len(data) > 1 or any([*place, *turn[:3]]):  # Bullet tells the margin of the compound
            return 0.0
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
        frame = self._centre(self.robot, joint) * self._inertial_frame(self.robot, joint).inverse()
        turn = frame.rotation().T
        return np.concatenate(
            [turn @ np.array(angular)[:, column], turn @ np.array(linear)[:, column]]
        )

    def coupled(self, pairs: tuple[tuple[str, str], ...]) -> bool:
        """Whether the constraints are gears between the fingers."""
        found = set()
        for constraint in self.couplings:
            info = pybullet.getConstraintInfo(constraint, physicsClientId=self.c)
            if info[0] == info[2] == self.robot and info[4] == pybullet.JOINT_GEAR:
                found.add(frozenset((info[1], info[3])))
        joints = dict(zip(self.prepared.robot.joint_names, self.joints, strict=True))
        return found == {frozenset(joints[name] for name in pair) for pair in pairs}

    def _held(self) -> set[int]:
        """Bodies that a constraint holds."""
        held = set()
        for k in range(pybullet.getNumConstraints(physicsClientId=self.c)):
            constraint = pybullet.getConstraintUniqueId(k, physicsClientId=self.c)
            info = pybullet.getConstraintInfo(constraint, physicsClientId=self.c)
            held |= {info[0], info[2]}
        return held

    def _dynamics(self, body: int, link: int = -1) -> Any:
        return pybullet.getDynamicsInfo(body, link, physicsClientId=self.c)

    def _inertial_frame(self, body: int, link: int) -> Pose:
        """In the frame of the body or link."""
        dynamics = self._dynamics(body, link)
        return pose_of(dynamics[3], dynamics[4])

    def _centre(self, body: int, link: int) -> Pose:
        """The inertial frame in the world."""
        c = self.c
        if link < 0:
            return pose_of(*pybullet.getBasePositionAndOrientation(body, physicsClientId=c))
        state = pybullet.getLinkState(body, link, computeForwardKinematics=1, physicsClientId=c)
        return pose_of(state[0], state[1])


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
