"""Kinematics and dynamics of the robot, by Pinocchio, and how large its scenes are."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from pytest_simbench.description.links import check_robot
from pytest_simbench.description.robot_files import robot_cache
from pytest_simbench.scene import Body, Box, FloatArray, MotionLimits, Pose, Robot
from pytest_simbench.simulator import DescriptionError


class RobotModel:
    """The robot's model; joint vectors are in the order of `robot.joints`, arm first, without those
    beside the arm.

    Attributes:
        lower, upper: position limits of the arm joints [rad], (arm,).
        effort_limits: of the arm joints [N m], (arm,).

    Raises:
        DescriptionError: the URDF cannot be read.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.pin = _checked(robot).copy()  # gravity and armature are set in it
        self.pin.gravity.linear = np.zeros(3)
        self.data = self.pin.createData()
        self.arm = len(robot.arm_joints)
        self.lower = np.array(self.pin.lowerPositionLimit[: self.arm])
        self.upper = np.array(self.pin.upperPositionLimit[: self.arm])
        self.tool = self.pin.getFrameId(robot.tool_frame)
        self.base = pin.SE3(robot.base.matrix())
        self.pin.armature = robot.column("armature")[: self.pin.nq]
        self._loaded: dict[tuple[object, ...], pin.Model] = {}
        self.effort_limits = robot.column("effort_limit")[: self.arm]
        self._fingers = robot.column("initial_position")[self.arm : self.pin.nq]
        borne = 1.0 - robot.column("gravity")
        self._borne = self.weighing(borne) if borne.any() else None

    @property
    def home(self) -> FloatArray:
        """Arm joints where the robot begins, (arm,) [rad]."""
        return self.robot.column("initial_position")[: self.arm]

    @property
    def limits(self) -> MotionLimits:
        """Of the arm's motion.

        Raises:
            DescriptionError: the robot has none.
        """
        if self.robot.limits is None:
            raise DescriptionError(
                f"robot {self.robot.name!r} has no limits of motion, which planning needs: give it "
                "Robot(limits=MotionLimits(...))"
            )
        return self.robot.limits

    @property
    def reach(self) -> float:
        """How far the tool can be from the axis of the first joint at most [m]: the lengths from
        joint to joint, and to the tool frame, and the strokes of joints that slide."""
        tool = self.pin.frames[self.tool].placement.translation
        return self.wrist_reach + float(np.linalg.norm(tool))

    @property
    def wrist_reach(self) -> float:
        """The same up to the last joint, without the hand [m]."""
        ends = [self.pin.jointPlacements[joint] for joint in range(2, self.arm + 1)]
        return sum(float(np.linalg.norm(end.translation)) for end in ends) + sum(self.strokes)

    @property
    def strokes(self) -> list[float]:
        """How far each arm joint slides from 0 at most [m], (arm,); 0 for one that turns."""
        farthest = np.maximum(np.abs(self.lower), np.abs(self.upper)).tolist()
        return [end if self._slides(k) else 0.0 for k, end in enumerate(farthest, 1)]

    def _slides(self, joint: int) -> bool:
        return bool(self.pin.joints[joint].shortname().startswith("JointModelP"))

    @property
    def has_one_jaw(self) -> bool:
        """Whether the hand is one jaw that turns, towards a fixed one."""
        return len(self._fingers) == 1 and self.finger_unit == "rad"

    @property
    def has_parallel_fingers(self) -> bool:
        """Whether the hand is two fingers that slide."""
        return len(self._fingers) == 2 and self.finger_unit == "m"

    @property
    def finger_unit(self) -> str:
        """Of the fingers' positions: "m" where they slide, "rad" where one turns."""
        fingers = range(self.arm + 1, self.pin.njoints)
        return "m" if all(map(self._slides, fingers)) else "rad"

    @property
    def finger_lever(self) -> float:
        """How far a fingertip moves for 1 of its joint's position: 1 [m/m] for fingers that slide;
        for those that turn, from the axis of the first to the tool centre point [m/rad]."""
        if self.finger_unit == "m":
            return 1.0
        axis = self.pin.jointPlacements[self.arm + 1].translation
        tip = self.pin.frames[self.tool].placement.translation
        return float(np.linalg.norm(tip - axis))

    def full(self, arm: FloatArray) -> FloatArray:
        """Arm joints (arm,) with the fingers at their start appended, (n_joints,)."""
        return np.concatenate([arm[: self.arm], self._fingers])

    def tool_transform(self, arm: FloatArray) -> pin.SE3:
        """Tool frame in the world as a Pinocchio transform."""
        pin.forwardKinematics(self.pin, self.data, self.full(arm))
        return self.base * pin.updateFramePlacement(self.pin, self.data, self.tool)

    def tool_pose(self, arm: FloatArray) -> Pose:
        """Pose of the tool centre point in the world."""
        transform = self.tool_transform(arm)
        x, y, z, w = pin.Quaternion(transform.rotation).coeffs()
        return Pose.from_array([*transform.translation, w, x, y, z])

    def tool_jacobian(self, arm: FloatArray) -> FloatArray:
        """Jacobian of the tool, its own axes, rows linear then angular, (6, arm)."""
        jacobian = pin.computeFrameJacobian(
            self.pin, self.data, self.full(arm), self.tool, pin.ReferenceFrame.LOCAL
        )
        return np.asarray(jacobian[:, : self.arm])

    def tool_velocity(self, arm: FloatArray, arm_velocity: FloatArray) -> FloatArray:
        """Linear velocity of the tool centre point in the world [m/s], (3,)."""
        rotation = self.tool_transform(arm).rotation
        return np.asarray(rotation @ (self.tool_jacobian(arm)[:3] @ arm_velocity))

    def inverse_dynamics(
        self,
        gravity: FloatArray,
        q: FloatArray,
        v: FloatArray,
        a: FloatArray,
        held: Body | None = None,
    ) -> FloatArray:
        """Joint efforts of a motion, rows of (n, n_joints), rotor inertia included, and of gravity
        each link's share (`Joint.gravity`) [N m, N].

        Args:
            gravity: in the world [m/s^2], (3,).
            q, v, a: positions, velocities and accelerations of all joints, each (n, n_joints).
            held: a body that the hand carries, its centre at the tool centre point.
        """
        model = self.pin if held is None else self._carrying(held)
        model.gravity.linear = self.base.rotation.T @ np.asarray(gravity, dtype=float)
        data = self.data if held is None else model.createData()
        rows = np.array([pin.rnea(model, data, *row).copy() for row in zip(q, v, a, strict=True)])
        if self._borne is not None:
            self._borne.gravity.linear = model.gravity.linear
            for efforts, row in zip(rows, q, strict=True):
                efforts -= pin.computeGeneralizedGravity(self._borne, self.data, row)
        return rows

    def weighing(self, shares: FloatArray) -> pin.Model:
        """The model, each link with a share of its mass, (n_joints,): for its weight alone."""
        model = self.pin.copy()
        for k, share in enumerate(shares[: model.nq], 1):
            link = model.inertias[k]
            model.inertias[k] = pin.Inertia(share * link.mass, link.lever, link.inertia)
        return model

    def effort_shares(
        self,
        gravity: FloatArray,
        arm: FloatArray,
        velocity: FloatArray,
        acceleration: FloatArray,
        held: Body | None = None,
    ) -> FloatArray:
        """What an arm motion asks of the motors, as signed shares of their limits, (n, arm); the
        fingers at rest."""
        still = np.zeros((len(arm), len(self._fingers)))
        q = np.hstack([arm, still + self._fingers])
        v, a = np.hstack([velocity, still]), np.hstack([acceleration, still])
        efforts = self.inverse_dynamics(gravity, q, v, a, held)
        return np.asarray(efforts[:, : self.arm] / self.effort_limits)

    def _carrying(self, body: Body) -> pin.Model:
        """The model with a body fixed in the hand."""
        key = type(body), body.mass, body.extents, *body.inertia().tolist()
        if key not in self._loaded:
            model = self.pin.copy()
            tool = model.frames[self.tool]
            inertia = pin.Inertia(body.mass, np.zeros(3), np.diag(body.inertia()))
            if isinstance(body, Box):
                inertia = pin.Inertia.FromBox(body.mass, *body.size)
            model.appendBodyToJoint(tool.parentJoint, inertia, tool.placement)
            self._loaded[key] = model
        return self._loaded[key]


FULL_REACH = 0.85
"""An arm of this reach (`RobotModel.reach`) does a task where the study has it [m]: that of the
Kinova Mico2, the smallest one that was seen to. The Panda's is 1.09."""

FULL_WRIST_REACH = 0.80
"""The same for grasps from above, of the reach without the hand (`RobotModel.wrist_reach`) [m]: a
hand that points down reaches no farther. The xArm 7, the smallest one that was seen to stack in the
study's layout, has 0.82."""


@robot_cache
def scale_of(robot: Robot) -> float:
    """All lengths of a robot's scene over those of the study's layout: in tenths, at most 1.

    A scene shrinks towards the world's origin: all lengths take the scale. Densities, friction and
    gravity stay. So masses go with the third power. Accelerations stay with gravity, so the speeds
    and times of what falls go with the square root.
    """
    return _tenths(RobotModel(robot).reach / FULL_REACH)


@robot_cache
def grasping_scale_of(robot: Robot) -> float:
    """The same for a scene in which cubes are grasped from above."""
    return _tenths(RobotModel(robot).wrist_reach / FULL_WRIST_REACH)


def _tenths(share: float) -> float:
    return min(10, max(1, math.floor(10.0 * share))) / 10.0


@robot_cache
def _checked(robot: Robot) -> pin.Model:
    """Pinocchio's model of a robot whose files are sound. Raises `DescriptionError` for a URDF that
    cannot be read."""
    check_robot(robot)
    try:
        model = pin.buildModelFromUrdf(robot.urdf, mimic=False)
    except TypeError:
        model = pin.buildModelFromUrdf(robot.urdf)
    except Exception as error:
        raise DescriptionError(f"cannot use the robot description {robot.urdf}: {error}") from None
    if robot.beside:
        model = _without_things(model, robot)
    names = list(model.names)[1:]
    if names != [name for name in robot.joint_names if name not in robot.beside]:
        raise DescriptionError(f"{robot.urdf} has joints {names}, not {robot.joint_names}")
    return model


def _without_things(model: pin.Model, robot: Robot) -> pin.Model:
    """The model with the joints beside the arm fixed where they start."""
    q = pin.neutral(model)
    for joint in robot.joints:
        if joint.name in robot.beside:
            q[model.joints[model.getJointId(joint.name)].idx_q] = joint.initial_position
    return pin.buildReducedModel(model, [model.getJointId(name) for name in robot.beside], q)
