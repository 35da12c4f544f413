"""Checks of the joint drives: law in `scene.Joint`, Pinocchio as the reference."""

from __future__ import annotations

import numpy as np

from pytest_simbench.laws.hands import close_command, gravity_effort
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import STANDARD_GRAVITY, FloatArray, Robot, Trajectory
from pytest_simbench.testing import scenes
from pytest_simbench.testing.kit import any_robot, check, coupled, grasping
from pytest_simbench.testing.subject import Subject, require, require_close

ARM_TICK = 0.004
"""Control tick of the set points [s], as in the tasks."""


@check(robot=any_robot)
def static_hold(subject: Subject) -> None:
    """Without feed-forward a spring sags: k (q* - q) equals the gravity torque of the model, per
    arm joint within 3 % of the largest one. A drive whose stiffness is a declared deviation may be
    no spring: it may hold instead, within 5 mrad."""
    robot = subject.arm
    start = robot.column("initial_position")
    with subject.world(scenes.arm_alone(robot)) as world:
        world.wait(2.0)
        q = world.joints[0]
    arm = len(robot.arm_joints)
    sag = float(np.abs(start - q)[:arm].max())
    if sag <= 5e-3 and subject.excused(f"joint/{robot.joints[0].name}/stiffness"):
        return
    held = (robot.column("stiffness") * (start - q))[:arm]
    law = gravity_effort(robot, q)[:arm]
    tolerance = 0.03 * float(np.abs(law).max())
    for joint, value, expected in zip(robot.arm_joints, held, law, strict=True):
        require_close(f"holding torque of {joint.name}", value, expected, tolerance, "N m")


@check(robot=any_robot)
def tracks_trajectory(subject: Subject) -> None:
    """With feed-forward the arm follows a smooth trajectory (quintic, 0.4 rad in 1.5 s, away from a
    limit that is near): at most two steps late plus 2 mrad, at any joint and time."""
    robot = scenes.lifted(subject.arm)
    start = robot.column("initial_position")
    arm = len(robot.arm_joints)
    goal = start + _turn(robot)
    time = np.arange(0.0, 1.5 + ARM_TICK / 2, ARM_TICK)
    s = (time / 1.5)[:, None]
    q = start + (goal - start) * (10 * s**3 - 15 * s**4 + 6 * s**5)
    v = (goal - start) * (30 * s**2 - 60 * s**3 + 30 * s**4) / 1.5
    a = (goal - start) * (60 * s - 180 * s**2 + 120 * s**3) / 1.5**2
    effort = RobotModel(robot).inverse_dynamics(np.array(STANDARD_GRAVITY), q, v, a)
    rest = gravity_effort(robot, start)
    hold = Trajectory.holding(ARM_TICK, start, rest)
    with subject.world(scenes.arm_alone(robot)) as world:
        world.follow(hold)
        world.wait(1.0)  # so that the load's own transient is over
        motion = world.follow(Trajectory(ARM_TICK, q, v, effort), log_period=0)
    late = motion.time - motion.time[0] + subject.timestep
    ideal = np.stack([np.interp(late, time, column) for column in q.T], axis=1)
    error = np.abs(motion.joints[:, 0, :arm] - ideal[:, :arm]).max(axis=0)
    allowed = 2 * subject.timestep * np.abs(v[:, :arm]).max(axis=0) + 2e-3
    for joint, value, limit in zip(robot.arm_joints, error, allowed, strict=True):
        require_close(f"tracking error of {joint.name}", value, 0.0, float(limit), "rad")


def _turn(robot: Robot) -> FloatArray:
    """How far each joint goes in `tracks_trajectory` from its start, (n_joints,) [rad, m]."""
    model, arm = RobotModel(robot), len(robot.arm_joints)
    start, turn = robot.column("initial_position"), np.full(len(robot.joints), -0.01)
    turn[:arm] = np.resize([0.4, -0.3, 0.3], arm)
    goal = (start + turn)[:arm]
    turn[:arm][(goal < model.lower) | (goal > model.upper)] *= -1
    return turn


@check(robot=any_robot)
def effort_limit_bounds_acceleration(subject: Subject) -> None:
    """A far command saturates the drive of joint 1, whose momentum p = (M(q) q')_1 then grows by
    the effort limit and nothing else: without gravity nothing depends on its position. After
    0.1 s p <= 1.05 limit t, and >= 0.8 limit t so that the limit is reached. A declared lack
    of rotor inertia is left out of M. An arm whose limit would turn it by more than 1 rad in that
    time, had it no rotor, gets the time for 1 rad, none more than the drive law saturates for;
    where other joints give way (xArm 7's), joint 1 gets three times as fast as if they held."""
    robot = scenes.lifted(subject.arm)
    start, first = robot.column("initial_position"), robot.joints[0]
    limit, late = first.effort_limit, first.damping / first.stiffness
    gain = limit / _yielding_inertia(robot, start, 0, has_armature(subject))
    left = abs(_far(robot)) - limit / first.stiffness  # until k (q* - q) = d q' + limit
    seconds = min(
        0.1,
        (2 * 1.0 * _yielding_inertia(robot, start, 0, armature=False) / limit) ** 0.5,
        (late**2 + 2 * left / gain) ** 0.5 - late,
    )
    require_limit_reached(subject, robot, 0, _far(robot), seconds)


def require_limit_reached(
    subject: Subject, robot: Robot, k: int, way: float, seconds: float
) -> None:
    """Joint `k`, told to go `way` [rad] from its start, too far to get there, without gravity,
    gains a momentum of its effort limit times the time, within -20 and +5 %."""
    goal = robot.column("initial_position")
    goal[k] += way
    with subject.world(scenes.arm_alone(robot, (0.0, 0.0, 0.0), "arm weightless")) as world:
        world.follow(Trajectory.holding(subject.timestep, goal))
        world.wait(seconds - subject.timestep)
        t, (q, v) = world.time, world.joints
    gained = abs(float(joint_momentum(robot, q, v, has_armature(subject))[k]))
    whole = robot.joints[k].effort_limit * t
    what = f"momentum gained by {robot.joints[k].name}"
    require_close(what, gained, 0.925 * whole, 0.125 * whole, "N m s")


def _far(robot: Robot) -> float:
    """A far way of joint 1, away from the nearer of its limits [rad]."""
    model, start = RobotModel(robot), robot.joints[0].initial_position
    return 2.5 if model.upper[0] - start >= start - model.lower[0] else -2.5


@check(robot=any_robot)
def saturated_drive_settles(subject: Subject) -> None:
    """The drive of joint 1, at its effort limit on the way to a set point, brakes in time: by the
    drive law from k (q* - q) = d q' on. On a way of half of limit / inertia (d / k)^2, at most 1
    rad, its limit can do that: without gravity the joint passes the set point by at most 5 % of
    the way, and after 10 d / k it stands so near."""
    robot = scenes.lifted(subject.arm)
    start, first = robot.column("initial_position"), robot.joints[0]
    late = first.damping / first.stiffness
    inertia = own_inertia(robot, start, 0, has_armature(subject))
    way = float(np.sign(_far(robot))) * min(1.0, first.effort_limit / inertia * late**2 / 2)
    with subject.world(scenes.arm_alone(robot, (0.0, 0.0, 0.0), "arm weightless")) as world:
        world.follow(Trajectory.holding(subject.timestep, start + way * np.eye(len(start))[0]))
        motion = world.wait(10 * late, log_period=0)
    left = 1 - (motion.joints[:, 0, 0] - start[0]) / way
    require_close("share of the way that joint 1 goes too far", max(0.0, -left.min()), 0, 0.05, "")
    require_close("share of the way that is left to joint 1", float(left[-1]), 0.0, 0.05, "")


@check(robot=any_robot)
def weak_joint_sags(subject: Subject) -> None:
    """A joint whose effort limit is a tenth of its gravity torque cannot hold: it moves by more
    than 0.05 rad within 0.5 s, while with its own limit it holds within 0.02 rad."""
    robot = scenes.lifted(subject.arm)
    q = robot.column("initial_position")
    load = np.abs(gravity_effort(robot, q)[: len(robot.arm_joints)])
    index = int(load.argmax())
    name = robot.joints[index].name
    moved = []
    for limit in (robot.joints[index].effort_limit, 0.1 * float(load[index])):
        weak = robot.with_joints(name, effort_limit=limit)
        with subject.world(scenes.arm_alone(weak)) as world:
            world.wait(0.5)
            moved.append(abs(float(world.joints[0, index] - q[index])))
    require_close(f"sag of {name} with its own limit", moved[0], 0.0, 0.02, "rad")
    require(moved[1] > 0.05, f"{name} held its load with a tenth of the effort it takes")


@check(robot=coupled)
def fingers_stay_coupled(subject: Subject) -> None:
    """The fingers stand equally far from the middle (1 mm, those that turn 5 mrad) though told
    different positions, 2/7 and 6/7 of their way."""
    robot = subject.arm
    goal = robot.column("initial_position")
    hand, unit = robot.gripper, RobotModel(robot).finger_unit
    shares = np.resize([6 / 7, 2 / 7], len(hand.joints))
    goal[robot.finger_indices] = hand.closed + shares * (hand.opened - hand.closed)
    split = Trajectory.holding(subject.timestep, goal)
    with subject.world(scenes.arm_alone(robot, (0.0, 0.0, 0.0), "arm weightless")) as world:
        world.follow(split)
        world.wait(1.0)
        fingers = world.joints[0, robot.finger_indices]
    allowed = 1e-3 if unit == "m" else 5e-3
    require_close("difference of the fingers", float(np.ptp(fingers)), 0.0, allowed, unit)


@check(robot=grasping)
def grip_holds(subject: Subject) -> None:
    """A cube gripped with the scene's squeeze (25 N a finger on 1 N of weight, mu 1) stays in the
    hand for 2 s within 2 mm, from when the fingers have closed."""
    scene = scenes.grip(subject.arm)
    with subject.world(scene) as world:
        world.follow(close_command(scene, subject.timestep))
        world.wait(0.5)
        before = world.bodies[0, :3].copy()
        world.wait(2.0)
        away = float(np.linalg.norm(world.bodies[0, :3] - before))
    held_at = np.asarray(scene.body("held").pose.position)
    dropped = float(np.linalg.norm(before - held_at))
    require_close("motion of the cube while gripped", dropped, 0.0, 0.02, "m")
    require_close("creep of the held cube", away, 0.0, 2e-3, "m")


def has_armature(subject: Subject) -> bool:
    """Whether the engine has rotor inertia, which an adapter may declare to lack."""
    return subject.excused(f"joint/{subject.arm.joints[0].name}/armature") is None


def joint_momentum(robot: Robot, q: FloatArray, v: FloatArray, armature: bool) -> FloatArray:
    """Momentum of each joint, M(q) v, (n_joints,) [kg m^2/s, kg m/s]."""
    model, zero = RobotModel(robot), np.zeros((1, len(q)))
    if not armature:
        model.pin.armature = zero[0]
    return np.asarray(model.inverse_dynamics(np.zeros(3), q[None], zero, v[None])[0])


def _yielding_inertia(robot: Robot, q: FloatArray, k: int, armature: bool) -> float:
    """Inertia that the drive of joint `k` meets where the others give way, the least there is:
    1 / (M(q)^-1)_kk [kg m^2]."""
    mass = [joint_momentum(robot, q, way, armature) for way in np.eye(len(q))]
    return float(1 / np.linalg.inv(mass)[k, k])


def own_inertia(robot: Robot, q: FloatArray, k: int, armature: bool) -> float:
    """Inertia that the drive of joint `k` meets while the others stand still, M(q)_kk [kg m^2]."""
    return float(joint_momentum(robot, q, np.eye(len(q))[k], armature)[k])
