"""Checks of the arm's own dynamics: inertia, gravity torque and effort limit of every joint, what
joints transmit; and of loops."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from pytest_simbench.laws.hands import gravity_effort, hold_command
from pytest_simbench.laws.joints import passive_motion
from pytest_simbench.laws.loops import FourBarClosure, FourBarSwing
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import STANDARD_GRAVITY, FloatArray, Robot, Trajectory, Vector3
from pytest_simbench.simulator import Capability, PreparedRobot
from pytest_simbench.testing import scenes
from pytest_simbench.testing.drives import has_armature, own_inertia, require_limit_reached
from pytest_simbench.testing.kit import any_robot, check
from pytest_simbench.testing.subject import Subject, asked, require, require_close

_FALL = 0.2
"""For how long the limp arm falls [s]."""

_GIVING = 0.3
"""For how long a joint may give way [s]."""


@check(robot=any_robot)
def limp_arm_falls(subject: Subject) -> None:
    """An arm without drives falls as its inertia and its weight say, and nothing else brakes it:
    from two random postures, after 0.2 s every joint's speed is that of Pinocchio's forward
    dynamics within 5 % of the fastest joint's. A declared lack of rotor inertia is left out."""
    rng = np.random.default_rng(3)
    for _ in range(2):
        robot, law = _falling_arm(subject, rng)
        with subject.world(scenes.arm_alone(robot, name="limp arm")) as world:
            world.wait(_FALL)
            speeds = world.joints[1, : len(law)]
        tolerance = 0.05 * float(np.abs(law).max())
        for joint, value, expected in zip(robot.arm_joints, speeds, law, strict=True):
            require_close(f"speed of limp {joint.name}", value, expected, tolerance, "rad/s")


def _falling_arm(subject: Subject, rng: np.random.Generator) -> tuple[Robot, FloatArray]:
    """A robot high above the ground whose arm has no drives, and its speeds after the fall.

    Its posture is random, but such that no joint reaches its limits.
    """
    while True:
        robot = scenes.at_random(scenes.lifted(subject.arm), rng)
        for joint in robot.arm_joints:
            limp = {"stiffness": 1e-3, "damping": 1e-3, "effort_limit": 1e-6}
            robot = robot.with_joints(joint.name, **limp)
        path, speeds = _fall(robot, has_armature(subject))
        limits = PreparedRobot(robot).limits
        low, high = np.array([limits[joint.name] for joint in robot.arm_joints]).T
        if (path > low + 0.05).all() and (path < high - 0.05).all():
            return robot, speeds


def _fall(robot: Robot, armature: bool) -> tuple[FloatArray, FloatArray]:
    """Positions (n, n_arm) and final speeds (n_arm,) of the falling arm, its fingers held."""
    full, q = RobotModel(robot).pin, robot.column("initial_position")
    fingers = [full.getJointId(name) for name in robot.gripper.joints]
    model: Any = pin.buildReducedModel(full, fingers, q)
    n = model.nv
    model.armature = robot.column("armature")[:n] if armature else np.zeros(n)
    model.gravity.linear = robot.base.rotation().T @ np.array(STANDARD_GRAVITY)
    path, speeds, _ = passive_motion(model, q[:n], _FALL)
    return path, speeds[-1]


@check(robot=any_robot)
def every_effort_limit_counts(subject: Subject) -> None:
    """Each arm joint does what its effort limit allows and no more. With 1.25 times the effort that
    gravity asks of every joint the arm holds (0.01 rad in 0.3 s). With 0.7 times in one joint that
    one gives way (0.02 rad), where its own inertia would let it by four times that. Where not:
    under a far command with a limit L of 0.5 N m, or what turns a light joint by 0.3 rad, its
    momentum (M(q) q')_j is L t after 50 ms, within -20 and +5 %."""
    gravity = (7.0, 5.0, -11.0)
    robot = scenes.at_random(scenes.lifted(subject.arm), np.random.default_rng(14))
    q = robot.column("initial_position")
    load = np.abs(gravity_effort(robot, q, gravity)[: len(robot.arm_joints)])
    strong = robot
    for joint, effort in zip(robot.arm_joints, load, strict=True):
        strong = strong.with_joints(joint.name, effort_limit=1.25 * float(effort) + 0.1)
    moved = _gives_way(subject, strong, gravity)
    for joint, value in zip(robot.arm_joints, moved, strict=True):
        require_close(f"motion of {joint.name} with 1.25 times the effort", value, 0, 0.01, "rad")
    for k, joint in enumerate(robot.arm_joints):
        inertia = own_inertia(robot, q, k, has_armature(subject))
        if 0.3 * load[k] / inertia * _GIVING**2 / 2 < 4 * 0.02:
            _speeds_up(subject, robot, k)
            continue
        weak = strong.with_joints(joint.name, effort_limit=0.7 * float(load[k]))
        value = float(_gives_way(subject, weak, gravity)[k])
        require(
            value > 0.02,
            f"{joint.name} holds {load[k]:.3g} N m with a limit of {0.7 * load[k]:.3g}: it gave "
            f"way by {value:.2g} rad",
        )


def _speeds_up(subject: Subject, robot: Robot, k: int) -> None:
    """Joint `k`, under a far command without gravity, gains its limit times the time."""
    seconds, name, start = 0.05, robot.joints[k].name, robot.column("initial_position")
    inertia = own_inertia(robot, start, k, has_armature(subject))
    limit = min(0.5, 2 * 0.3 * inertia / seconds**2)
    robot = robot.with_joints(name, effort_limit=limit, stiffness=100.0, damping=1e-3)
    require_limit_reached(subject, robot, k, 1.0 if start[k] < 0 else -1.0, seconds)


def _gives_way(subject: Subject, robot: Robot, gravity: Vector3) -> FloatArray:
    """How far the arm's joints move in `_GIVING` under a command to stay, gravity compensated."""
    scene = scenes.arm_alone(robot, gravity, "weak arm")
    with subject.world(scene) as world:
        world.follow(hold_command(scene, subject.timestep))
        world.wait(_GIVING)
        moved = np.abs(world.joints[0] - robot.column("initial_position"))
    return np.asarray(moved[: len(robot.arm_joints)])


@check(robot=any_robot)
def joints_stop_at_their_limits(subject: Subject) -> None:
    """Led 0.2 rad beyond each of its limits within 2 s, or at 1.6 rad/s if that takes longer, every
    arm joint stops within 0.1 rad of it, on the way up and on the way down."""
    robot = scenes.lifted(subject.arm)
    limits = PreparedRobot(robot).limits
    low, high = np.array([limits[joint.name] for joint in robot.arm_joints]).T
    for name, end, beyond in (("upper", high, 0.2), ("lower", low, -0.2)):
        with subject.world(scenes.arm_alone(robot, (0.0, 0.0, 0.0), f"{name} limits")) as world:
            start = robot.column("initial_position")
            goal = start.copy()
            goal[: len(end)] = end + beyond
            seconds = max(2.0, float(np.abs(goal - start).max()) / 1.6)
            ramp = np.linspace(0.0, 1.0, round(seconds / 0.004) + 1)[:, None]
            path = start + ramp * (goal - start)
            still = np.zeros_like(path)
            world.follow(Trajectory(0.004, path, still, still))
            world.wait(0.3)
            for joint, value, stop in zip(robot.arm_joints, world.joints[0], end, strict=False):
                require_close(f"{joint.name} at its {name} limit", value, stop, 0.1, "rad")


@check(Capability.LOOPS)
def loops_stay_closed(subject: Subject) -> None:
    """A four-bar linkage that is let go swings as its one degree of freedom has it, with its loop
    closed within 2 mm."""
    asked(subject, FourBarClosure(seconds=0.5), within=2.0)
    asked(subject, FourBarSwing(seconds=0.5))


@check(Capability.JOINT_WRENCHES, any_robot)
def joint_loads_are_told(subject: Subject) -> None:
    """Each joint of an arm that stands still carries what hangs on it: the weight, upward, and the
    torque of that weight about the joint, each within 2 % of the largest. So does one that its
    drives brake, 0.05 s after all set points went by 0.1 rad: also what speeds up the links."""
    robot = scenes.at_random(scenes.lifted(subject.arm), np.random.default_rng(5))
    scene, arm = scenes.arm_alone(robot, name="loaded arm"), len(robot.arm_joints)
    with subject.world(scene) as world:
        command = hold_command(scene, subject.timestep)
        for aside, seconds in ((0.0, 0.5), (0.1, 0.05)):
            command.position[:, :arm] += aside
            world.follow(command)
            world.wait(seconds)
            q, v = world.joints
            world.wait(subject.timestep)
            change = (world.joints[1] - v) / subject.timestep
            _require_loads(robot, world.joint_wrenches(), _loads(robot, q, v, change))


def _require_loads(robot: Robot, told: FloatArray, law: FloatArray) -> None:
    require(told.shape == law.shape, f"joint wrenches are {told.shape}, not {law.shape}")
    arm = len(robot.arm_joints)
    for which, what, unit in ((slice(0, 3), "force", "N"), (slice(3, 6), "torque", "N m")):
        limit = 0.02 * float(np.abs(law[:arm, which]).max())
        for joint, row, right in zip(robot.arm_joints, told[:, which], law[:, which], strict=False):
            off = float(np.abs(row - right).max())
            require_close(f"error of the {what} of {joint.name}", off, 0.0, limit, unit)


def _loads(robot: Robot, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """Wrenches by which joints move what hangs on them, as `Simulator.joint_wrenches`."""
    model = RobotModel(robot)
    model.inverse_dynamics(np.array(STANDARD_GRAVITY), q[None], v[None], a[None])
    pin.forwardKinematics(model.pin, model.data, q)
    rows = []
    for place, wrench in list(zip(model.data.oMi, model.data.f, strict=True))[1:]:
        turn = model.base.rotation @ place.rotation
        rows.append(np.concatenate([turn @ wrench.linear, turn @ wrench.angular]))
    return np.array(rows)
