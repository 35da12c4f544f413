"""Checks of the arm's own dynamics: inertia, gravity torque and effort limit of every joint, what
joints transmit; and of loops."""

from __future__ import annotations

from typing import Any

import numpy as np

from pytest_simbench.laws.loops import FourBarSwing
from pytest_simbench.scene import STANDARD_GRAVITY, FloatArray, Robot, Trajectory
from pytest_simbench.simulator import Capability, PreparedRobot
from pytest_simbench.simulator.links import ends, link_poses, reduced
from pytest_simbench.testing import scenes
from pytest_simbench.testing.checks import check
from pytest_simbench.testing.drives import (
    gravity_effort,
    has_armature,
    hold_command,
    joint_momentum,
    model_of,
    own_inertia,
)
from pytest_simbench.testing.robots import any_robot
from pytest_simbench.testing.subject import Subject, logged, require, require_close

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
            robot = scenes.with_joint(robot, joint.name, **limp)
        path, speeds = _fall(robot, has_armature(subject))
        limits = PreparedRobot(robot).limits
        low, high = np.array([limits[joint.name] for joint in robot.arm_joints]).T
        if (path > low + 0.05).all() and (path < high - 0.05).all():
            return robot, speeds


def _fall(robot: Robot, armature: bool) -> tuple[FloatArray, FloatArray]:
    """Positions (n, n_arm) and final speeds (n_arm,) of the falling arm, its fingers held."""
    import pinocchio as pin

    full, q = model_of(robot).pin, robot.column("initial_position")
    fingers = [full.getJointId(name) for name in robot.gripper.joints]
    model: Any = pin.buildReducedModel(full, fingers, q)
    n = model.nv
    model.armature = robot.column("armature")[:n] if armature else np.zeros(n)
    model.gravity.linear = robot.base.rotation().T @ np.array(STANDARD_GRAVITY)
    data, q, v, path = model.createData(), q[:n].copy(), np.zeros(n), []
    dt = 1e-4
    for _ in range(round(_FALL / dt)):
        v = v + dt * pin.aba(model, data, q, v, np.zeros(n))
        q = q + dt * v
        path.append(q)
    return np.array(path), v


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
        strong = scenes.with_joint(strong, joint.name, effort_limit=1.25 * float(effort) + 0.1)
    moved = _gives_way(subject, strong, gravity)
    for joint, value in zip(robot.arm_joints, moved, strict=True):
        require_close(f"motion of {joint.name} with 1.25 times the effort", value, 0, 0.01, "rad")
    for k, joint in enumerate(robot.arm_joints):
        inertia = own_inertia(robot, q, k, has_armature(subject))
        if 0.3 * load[k] / inertia * _GIVING**2 / 2 < 4 * 0.02:
            _speeds_up(subject, robot, k)
            continue
        weak = scenes.with_joint(strong, joint.name, effort_limit=0.7 * float(load[k]))
        value = float(_gives_way(subject, weak, gravity)[k])
        require(
            value > 0.02,
            f"{joint.name} holds {load[k]:.3g} N m with a limit of {0.7 * load[k]:.3g}: it gave "
            f"way by {value:.2g} rad",
        )


def _speeds_up(subject: Subject, robot: Robot, k: int) -> None:
    """Joint `k`, under a far command without gravity, gains its limit times the time."""
    seconds, name, armature = 0.05, robot.joints[k].name, has_armature(subject)
    start = robot.column("initial_position")
    limit = min(0.5, 2 * 0.3 * own_inertia(robot, start, k, armature) / seconds**2)
    robot = scenes.with_joint(robot, name, effort_limit=limit, stiffness=100.0, damping=1e-3)
    goal = start.copy()
    goal[k] += 1.0 if goal[k] < 0 else -1.0
    far = Trajectory.holding(subject.timestep, goal)
    with subject.world(scenes.arm_alone(robot, (0.0, 0.0, 0.0), "speeding up")) as world:
        world.follow(far)
        world.wait(seconds - subject.timestep)
        t, (q, v) = world.time, world.joints
    gained = abs(float(joint_momentum(robot, q, v, armature)[k]))
    require_close(f"momentum gained by {name}", gained, 0.925 * limit * t, 0.125 * limit * t, "")


def _gives_way(subject: Subject, robot: Robot, gravity: tuple[float, float, float]) -> FloatArray:
    """How far the arm's joints move in `_GIVING` under a command to stay, gravity compensated."""
    start = robot.column("initial_position")
    effort = gravity_effort(robot, start, gravity)
    hold = Trajectory.holding(subject.timestep, start, effort)
    with subject.world(scenes.arm_alone(robot, gravity, "weak arm")) as world:
        world.follow(hold)
        world.wait(_GIVING)
        moved = np.abs(world.joints[0] - start)[: len(robot.arm_joints)]
    return np.asarray(moved)


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
    """A four-bar linkage that is let go swings (0.1 rad in 0.5 s) with its loop closed: the ends
    that are held together are where each other is, within a step's way at 2 m/s and 1 mm."""
    scene = FourBarSwing().build()
    assert scene.robot is not None
    prepared = PreparedRobot(scene.robot)
    (closure,) = reduced(prepared)
    with subject.world(scene) as world:
        paths = logged(world.wait(0.5, log_period=0.02)).joints[:, 0]
    gaps = [np.linalg.norm(np.subtract(*ends(prepared, closure, q))) for q in paths]
    limit = 2.0 * subject.timestep + 1e-3
    require_close("opening of the loop", float(max(gaps)), 0.0, limit, "m")
    moved = float(np.abs(paths[:, 0] - paths[0, 0]).max())
    require(moved > 0.1, f"the crank of a four-bar linkage moved by {moved:.3g} rad only")


@check(Capability.JOINT_WRENCHES, any_robot)
def joint_loads_are_told(subject: Subject) -> None:
    """Each joint of an arm that stands still carries what hangs on it: the weight, upward, and the
    torque of that weight about the joint, each within 2 % of the largest."""
    robot = scenes.at_random(scenes.lifted(subject.arm), np.random.default_rng(5))
    scene = scenes.arm_alone(robot, name="loaded arm")
    with subject.world(scene) as world:
        world.follow(hold_command(scene, subject.timestep))
        world.wait(0.5)
        told, positions = world.joint_wrenches(), world.joints[0]
    law = _loads(PreparedRobot(robot), positions)
    arm = len(robot.arm_joints)
    require(told.shape == law.shape, f"joint wrenches are {told.shape}, not {law.shape}")
    for which, what, unit in ((slice(0, 3), "force", "N"), (slice(3, 6), "torque", "N m")):
        limit = 0.02 * float(np.abs(law[:arm, which]).max())
        for joint, row, right in zip(robot.arm_joints, told[:, which], law[:, which], strict=False):
            off = float(np.abs(row - right).max())
            require_close(f"error of the {what} of {joint.name}", off, 0.0, limit, unit)


def _loads(prepared: PreparedRobot, positions: FloatArray) -> FloatArray:
    """Wrenches by which joints hold still what hangs on them, as `Simulator.joint_wrenches`."""
    robot = prepared.robot
    poses = link_poses(prepared, dict(zip(robot.joint_names, positions, strict=True)))
    carried = {name: np.zeros(6) for name in prepared.links}  # about the world's origin
    for joint in reversed(prepared.joints):  # children first
        link, pose = prepared.links[joint.child], poses[joint.child]
        lift = -link.mass * np.array(STANDARD_GRAVITY)
        centre = pose.rotation() @ link.centre + pose.position
        carried[joint.child] += np.concatenate([lift, np.cross(centre, lift)])
        carried[joint.parent] += carried[joint.child]
    children = {joint.name: joint.child for joint in prepared.joints}
    rows = []
    for name in robot.joint_names:
        force, torque = np.hsplit(carried[children[name]], 2)
        origin = np.asarray(poses[children[name]].position)
        rows.append(np.concatenate([force, torque - np.cross(origin, force)]))
    return np.array(rows)
