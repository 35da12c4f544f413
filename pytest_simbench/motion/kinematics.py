"""Inverse kinematics: of a pose, by damped least squares on Pinocchio, with restarts; of lines and
paths; of measured motions of the tool; and of a policy's commands of the tool (`Servo`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares

from pytest_simbench.motion.errors import Unreachable
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import FloatArray, Pose, Scene
from pytest_simbench.scene.policy import LoopError

TOLERANCE = 1e-6
"""Largest remaining error of a solution, in [m] and [rad] together."""

TURN_TOLERANCE = 1e-4
"""Largest remaining turn of a solution of an arm with fewer than 6 joints [rad]. Such an arm turns
its tool about two axes only. The third one is met as the description has it: its angles are written
with 5 or 6 digits, and each joint adds an error of that size."""

TURN_WEIGHT = 0.01
"""Of 1 rad for such an arm, where 1 m counts 1: it meets the position, and turns as it can."""

LIMIT_MARGIN = 0.02
"""Distance that solutions keep from the joint limits [rad]."""

DECIMALS = (7, 6, 4)
"""Of positions [rad or m], velocities and efforts that an arm is told. What OpenBLAS computes after
them differs by processor, and a push that is told of it ends up to 0.6 mm elsewhere."""

DOWNWARD = Pose(quaternion=(0.0, 1.0, 0.0, 0.0))
"""A tool that points down, its y axis (the fingers' opening direction) along minus world y."""


def top_down_grasps(cube: Pose) -> list[Pose]:
    """Tool poses that grasp a cube from above, one for each of its four symmetric turns."""
    return [tool_over(cube, yaw) for yaw in level_turns(cube)]


def level_turns(body: Pose) -> list[float]:
    """Quarters of a turn at which fingers close along the body's axes [rad].

    It may lie on any side; the first yaw is that of the horizontal body axis nearest to x.
    """
    axes = body.rotation()
    flat = [axes[:, i] for i in range(3) if abs(axes[2, i]) < np.sqrt(0.5)]
    yaw = float(np.arctan2(flat[0][1], flat[0][0])) if flat else 0.0
    return [yaw + quarter * np.pi / 2 for quarter in range(-2, 2)]


def tool_over(place: Pose, yaw: float) -> Pose:
    """Downward tool pose at a place's position, turned by `yaw` about the vertical [rad]."""
    return Pose.at(*place.position, yaw=yaw) * DOWNWARD


def inverse_kinematics(
    model: RobotModel,
    target: Pose,
    near: FloatArray,
    rng: np.random.Generator | None = None,
    restarts: int = 10,
    wanted: Callable[[FloatArray], bool] = lambda arm: True,
) -> FloatArray:
    """Arm joints (arm,) [rad] that bring the tool to `target`.

    Args:
        near: where the search starts; solutions near it are found first.
        rng: draws further starts within the limits; None for no restarts.
        restarts: how many of them.
        wanted: whether a solution will do; the first one is returned if none does.

    Raises:
        Unreachable: no start led to the target.
    """
    goal = model.base.actInv(pin.SE3(target.matrix()))
    starts = [np.asarray(near, dtype=float)]
    if rng is not None:
        starts += list(rng.uniform(model.lower, model.upper, (restarts, model.arm)))
    first: FloatArray | None = None
    for start in starts:
        solution = _descend(model, goal, start)
        if solution is not None and wanted(solution):
            return solution
        first = solution if first is None else first
    if first is not None:
        return first
    x, y, z = target.position
    raise Unreachable(f"unreachable: tool at ({x:.3f}, {y:.3f}, {z:.3f})")


def _descend(model: RobotModel, goal: pin.SE3, start: FloatArray) -> FloatArray | None:
    """Damped least squares from one start; None when it does not arrive within the limits."""
    low, high = model.lower + LIMIT_MARGIN, model.upper - LIMIT_MARGIN
    q = np.clip(start, low, high)
    weights = np.ones(6)
    if model.arm < 6:
        weights[3:] = TURN_WEIGHT
    for _ in range(100):
        transform = model.base.actInv(model.tool_transform(q))
        error = pin.log6(transform.actInv(goal)).vector
        if _arrived(error, model.arm):
            return q
        error = weights * error
        size = float(np.linalg.norm(error))
        jacobian = pin.Jlog6(transform.actInv(goal)) @ model.tool_jacobian(q)
        jacobian = weights[:, None] * jacobian
        damping = 1e-9 + 1e-3 * min(size, 0.1) ** 2
        step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + damping * np.eye(6), error)
        step *= min(1.0, 0.5 / max(float(np.abs(step).max()), 1e-12))
        q = np.clip(q + step, low, high)
    return None


def _arrived(error: FloatArray, joints: int) -> bool:
    """Whether so small an error, (6,) [m, rad], will do for an arm of so many joints."""
    if joints >= 6:
        return float(np.linalg.norm(error)) < TOLERANCE
    shift, turn = np.linalg.norm(error[:3]), np.linalg.norm(error[3:])
    return bool(shift < TOLERANCE and turn < TURN_TOLERANCE)


def straight_line(model: RobotModel, start: FloatArray, target: Pose) -> FloatArray:
    """Joint positions along the straight tool path from `start` to `target`, each at most 1 cm and
    0.1 rad from the last, (n, arm).

    Args:
        start: arm joints at the beginning.
        target: tool pose at the end; the orientation turns evenly on the way.

    Raises:
        Unreachable: the line leaves the workspace or jumps to another arm configuration.
    """
    first = model.tool_transform(start)
    last = pin.SE3(target.matrix())
    turn = pin.log3(first.rotation.T @ last.rotation)
    length = float(np.linalg.norm(last.translation - first.translation))
    # 10 cm are 10 steps, whatever the last digits say
    steps = max(2, int(np.ceil(max(length / 0.01, float(np.linalg.norm(turn)) / 0.1) - 1e-6)))
    line = [
        pin.SE3(
            first.rotation @ pin.exp3(share * turn),
            (1 - share) * first.translation + share * last.translation,
        )
        for share in np.linspace(0, 1, steps + 1)[1:]
    ]
    return _joint_path(model, start, line, "straight line")


def tool_path(model: RobotModel, start: FloatArray, poses: Sequence[Pose]) -> FloatArray:
    """Joint positions along a path of the tool, (n + 1, arm), the first of them `start`.

    Args:
        start: arm joints at the beginning.
        poses: tool poses in the world, about 1 cm from each other.

    Raises:
        Unreachable: the path leaves the workspace or jumps to another arm configuration.
    """
    return _joint_path(model, start, [pin.SE3(pose.matrix()) for pose in poses], "path")


def _joint_path(
    model: RobotModel, start: FloatArray, poses: Sequence[pin.SE3], what: str
) -> FloatArray:
    path = [np.asarray(start, dtype=float)]
    for pose in poses:
        solution = _descend(model, model.base.actInv(pose), path[-1])
        if solution is None:
            position = tuple(np.round(pose.translation, 3).tolist())
            raise Unreachable(f"unreachable: {what} to {position}")
        path.append(solution)
    if np.abs(np.diff(np.array(path), axis=0)).max(initial=0.0) > 0.5:
        raise Unreachable(f"unreachable: the {what} needs a jump of the arm's configuration")
    return np.array(path)


POSITION, ROTATION, POSTURE, STEP = 100.0, 0.3, 0.1, 1e-5
"""Weights of 1 m of position, 1 rad of rotation, 1 rad of posture, and 1 rad from the solution
before, which chooses among those of an arm with more joints than it needs. The position is met to a
micrometre. The other two share what is left: near a singularity (a stretched wrist) a hundredth of
a degree of rotation costs tens of degrees in the joints."""


def track(
    model: RobotModel, targets: Sequence[Pose], near: FloatArray, held: Sequence[int] = ()
) -> FloatArray:
    """Arm joints that bring the tool to each target, each solution near the one before, (n, arm).

    Args:
        targets: tool poses, close to one another.
        near: where the search for the first one starts (arm,) [rad].
        held: numbers of joints that were commanded to stay at 0, and are kept near it.
    """
    path = np.empty((len(targets), model.arm))
    joints, indices = np.asarray(near, dtype=float), list(held)
    for row, target in zip(path, targets, strict=True):
        inverse = target.inverse()

        def off(
            arm: FloatArray, inverse: Pose = inverse, before: FloatArray = joints
        ) -> FloatArray:
            left = inverse * model.tool_pose(arm)
            turn = 2.0 * np.sign(left.quaternion[0]) * np.array(left.quaternion[1:])
            return np.concatenate(
                [
                    POSITION * np.array(left.position),
                    ROTATION * turn,
                    POSTURE * arm[indices],
                    STEP * (arm - before),
                ]
            )

        joints = least_squares(off, joints, method="lm", xtol=1e-8, ftol=1e-8).x
        row[:] = joints
    return path


ITERATIONS = 4
"""Of a step towards a pose at most."""

FASTEST, FASTEST_TURN = 1.7, 2.5
"""Of the tool [m/s], [rad/s]: the Panda's own limits in Cartesian space (Franka Control Interface,
robot and interface specifications)."""

AWAY = 1e-5
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
        self._weights = self.model.weighing(scene.robot.column("gravity"))
        self._weights.gravity.linear = self.model.base.rotation.T @ np.array(scene.gravity)
        self._data = self._weights.createData()
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
            if np.abs(error).max() < AWAY:
                break
            jacobian = model.tool_jacobian(arm)
            square = jacobian @ jacobian.T + DAMPING**2 * np.eye(6)
            arm = np.clip(
                arm + jacobian.T @ np.linalg.solve(square, error), model.lower, model.upper
            )
        change = arm - start
        arm = start + change / max(1.0, float((np.abs(change) / (self._fastest * seconds)).max()))
        return np.concatenate([arm.round(DECIMALS[0]), position[model.arm :]])

    def finger(self, width: float) -> float:
        """Position of each finger joint [m, or rad] where the hand is `width` [m] open."""
        return width / 2 if self.model.finger_unit == "m" else width / self.model.finger_lever

    def holding_effort(self, position: FloatArray) -> FloatArray:
        """What holds the arm against gravity, (n_joints,) [N m or N]; the fingers press alone."""
        model, effort = self.model, np.zeros_like(position)
        weights = pin.computeGeneralizedGravity(self._weights, self._data, position[: model.pin.nq])
        effort[: model.arm] = weights[: model.arm]
        return effort
