"""What a policy's commands of the tool become: joint set points, by differential kinematics."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import FloatArray, Pose, Scene
from pytest_simbench.scene.policy import LoopError

ITERATIONS = 4
"""Of a step towards a pose at most."""

FASTEST, FASTEST_TURN = 1.7, 2.5
"""Of the tool [m/s], [rad/s]: the Panda's own limits in Cartesian space (Franka Control Interface,
robot and interface specifications)."""

TOLERANCE = 1e-5
"""Of a step [m], [rad]: a hundredth of a millimetre."""

DAMPING = 1e-3
"""Of the least squares: near a singularity the tool lags instead of the joints racing."""


class Servo:
    """The `scene.policy.Kinematics` of a scene's robot.

    Raises:
        LoopError: it has none.
        DescriptionError: its URDF cannot be read.
    """

    def __init__(self, scene: Scene) -> None:
        if scene.robot is None:
            raise LoopError(f"scene {scene.name!r} has no robot that a policy could move")
        self.model = RobotModel(scene.robot)
        self._gravity = np.array(scene.gravity, dtype=float)
        limits = scene.robot.limits
        own = np.array(self.model.pin.velocityLimit[: self.model.arm])
        self._fastest = own if limits is None else np.array(limits.velocity)

    def tool_pose(self, position: FloatArray) -> Pose:
        """The tool centre point in the world, of joint positions (n_joints,)."""
        return self.model.tool_pose(position[: self.model.arm])

    def towards(self, position: FloatArray, tool: Pose, seconds: float) -> FloatArray:
        """Joint positions (n_joints,) nearer to a pose of the tool, within the limits."""
        model, start = self.model, position[: self.model.arm]
        here = model.tool_transform(start)
        way = pin.log6(here.actInv(pin.SE3(tool.matrix()))).vector
        gone = np.linalg.norm(way[:3]) / FASTEST, np.linalg.norm(way[3:]) / FASTEST_TURN
        goal = here * pin.exp6(way / max(1.0, *(float(part) / seconds for part in gone)))
        arm = start
        for _ in range(ITERATIONS):
            error = pin.log6(model.tool_transform(arm).actInv(goal)).vector
            if np.abs(error).max() < TOLERANCE:
                break
            jacobian = model.tool_jacobian(arm)
            square = jacobian @ jacobian.T + DAMPING**2 * np.eye(6)
            arm = np.clip(
                arm + jacobian.T @ np.linalg.solve(square, error), model.lower, model.upper
            )
        change = arm - start
        arm = start + change / max(1.0, float((np.abs(change) / (self._fastest * seconds)).max()))
        return np.concatenate([arm, position[model.arm :]])

    def finger(self, width: float) -> float:
        """Position of each finger joint [m, or rad] where the hand is `width` [m] open."""
        return width / 2 if self.model.finger_unit == "m" else width / self.model.finger_lever

    def holding_effort(self, position: FloatArray) -> FloatArray:
        """What holds the arm against gravity, (n_joints,) [N m or N]; the fingers press alone."""
        still = np.zeros((1, len(position)))
        effort = self.model.inverse_dynamics(self._gravity, position[None], still, still)[0]
        effort[self.model.arm :] = 0.0
        return np.asarray(effort)
