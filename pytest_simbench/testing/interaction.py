"""Checks of what robot and bodies do to each other: forces act both ways, and only on contact.
Friction alone holds what is in the hand, and nothing leads on what left it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pytest_simbench.client.motion import Motion
from pytest_simbench.laws.free import rotation_of
from pytest_simbench.laws.hands import close_command, gravity_effort, hold_command
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import FloatArray, Pose, Scene, Wrench
from pytest_simbench.tasks.manipulator import Manipulator
from pytest_simbench.tasks.throw_analysis import Thrown
from pytest_simbench.testing import scenes
from pytest_simbench.testing.kit import any_robot, check, grasping, throwing
from pytest_simbench.testing.scenes import EDGE, GRAVITY, MASS, Approach, approaches, beside
from pytest_simbench.testing.subject import Subject, require, require_close

_GRASP = 0.5
"""For how long the hand closes before anything is asked [s]."""


@check(robot=grasping)
def squeeze_bounds_the_grip(subject: Subject) -> None:
    """Two fingers that press with F carry 2 mu F and no more: of what they can carry, a cube of
    0.6 times that weight stays (15 mm in 0.5 s), one of 1.3 times falls out (50 mm)."""
    force = 5.0
    robot = subject.arm.squeezing(force)
    moved = []
    for share in (0.6, 1.3):
        mass = share * 2 * robot.friction * force / GRAVITY
        scene = scenes.grip(robot, mass, name=f"weak grip {share}")
        with subject.world(scene) as world:
            world.follow(close_command(scene, subject.timestep))
            world.wait(0.5)
            place = np.asarray(scene.body("held").pose.position)
            moved.append(float(np.linalg.norm(world.bodies[0, :3] - place)))
    require_close("motion of what the squeeze can carry", moved[0], 0.0, 0.015, "m")
    require(
        moved[1] > 0.05,
        f"fingers that press with {force:g} N each hold {mass * GRAVITY:.3g} N at mu = 1: the cube "
        f"fell by {1000 * moved[1]:.2g} mm only",
    )


@check(robot=grasping)
def open_hand_holds_nothing(subject: Subject) -> None:
    """A cube between open fingers, and one before a hand that closes upon nothing, fall freely:
    s = g t^2 / 2 and v = g t after 0.1 s, within what a step changes and 1 %."""
    robot = subject.arm
    between = scenes.grip(robot, gap=0.01, name="open hand")
    tool = RobotModel(robot).tool_pose(robot.column("initial_position"))
    x, y, z = (tool * Pose.at(0.0, 0.0, 0.06)).position
    below = Scene("closing hand", (scenes.cube("below", Pose.at(x, y, z)),), robot=robot)
    for scene, closing in ((between, False), (below, True)):
        with subject.world(scene) as world:
            if closing:
                world.follow(close_command(scene, subject.timestep))
            world.wait(0.1 - world.time)
            _require_free_fall(subject, scene, world.time, world.bodies)


@check(robot=any_robot)
def every_body_falls(subject: Subject) -> None:
    """Free bodies of any mass and place, near the arm too, fall as in `open_hand_holds_nothing`:
    no body is without gravity, held, or slowed down."""
    robot = subject.arm
    places = [(0.3, 0.3), (0.3, -0.3), (-0.3, 0.3), (-0.3, -0.3), (0.7, 0.0)]
    cubes = [
        scenes.cube(f"c{k}", Pose.at(*beside(robot, x, y), 0.6 + 0.1 * k, yaw=k), MASS * 3.0**k / 3)
        for k, (x, y) in enumerate(places)
    ]
    scene = Scene("all fall", tuple(cubes), robot=robot)
    with subject.world(scene) as world:
        world.wait(0.2)
        _require_free_fall(subject, scene, world.time, world.bodies)


def _require_free_fall(subject: Subject, scene: Scene, t: float, rows: FloatArray) -> None:
    dt = subject.timestep
    for body, row in zip(scene.free_bodies, rows, strict=True):
        fallen, law = body.pose.position[2] - float(row[2]), GRAVITY * t * t / 2
        limit = GRAVITY * t * dt + 0.01 * law
        require_close(f"height fallen by {body.name}", fallen, law, limit, "m")
        limit = GRAVITY * dt + 0.01 * GRAVITY * t
        require_close(f"speed of {body.name}", -float(row[9]), GRAVITY * t, limit, "m/s")
        aside = float(np.hypot(*(row[:2] - body.pose.position[:2])))
        require_close(f"sideways motion of {body.name}", aside, 0.0, 1e-4, "m")


@check(robot=grasping)
def held_weight_is_felt(subject: Subject) -> None:
    """What the hand carries weighs on the arm. A joint that can carry the arm and half of what a
    held cube of 1.5 kg adds holds without the cube (0.02 rad in 0.5 s) and sags with it (0.05)."""
    mass, robot = 1.5, subject.arm
    q = robot.column("initial_position")
    arm_load = gravity_effort(robot, q)[: len(robot.arm_joints)]
    model = RobotModel(robot)
    lift = model.tool_transform(q).rotation.T @ np.array([0.0, 0.0, mass * GRAVITY])
    cube_load = model.tool_jacobian(q)[:3].T @ lift
    joint = int(np.argmax(cube_load * np.sign(arm_load)))
    limit = float(abs(arm_load[joint]) + abs(cube_load[joint]) / 2)
    name = robot.joints[joint].name
    weak = robot.with_joints(name, effort_limit=limit)
    held = scenes.grip(weak, mass, name="heavy grip")
    sags = []
    for scene in (replace(held, name="empty grip", bodies=()), held):
        with subject.world(scene) as world:
            world.follow(close_command(scene, subject.timestep))
            world.wait(0.5)
            sags.append(abs(float(world.joints[0, joint] - q[joint])))
    require_close(f"sag of {name} without the cube", sags[0], 0.0, 0.02, "rad")
    require(sags[1] > 0.05, f"{name} does not feel the cube: it sags by {sags[1]:.2g} rad")


@check(robot=any_robot)
def links_are_felt(subject: Subject) -> None:
    """A cube that falls towards a link from 5 mm away stops where the link's shape begins: each
    link collides, with a shape that reaches as far as the description's within 3 mm there, and what
    the adapter declares of its meshes. It would have fallen 11 mm farther."""
    for robot, group in approaches(subject.arm):
        x, y, z = (float(part) for part in 2 * GRAVITY * group[0].direction)
        cubes = tuple(approach.cube() for approach in group)
        scene = Scene(f"fly {group[0].link}", cubes, robot=robot, gravity=(x, y, z))
        with subject.world(scene) as world:
            world.follow(hold_command(scene, subject.timestep))
            motion = world.wait(0.04 - world.time, log_period=0.002)
        for k, approach in enumerate(group):
            _require_touch(subject, approach, motion.bodies[:, k, :3])


def _require_touch(subject: Subject, approach: Approach, places: FloatArray) -> None:
    """The cube stopped at the link's surface."""
    name = f"link/{approach.link}/meshes"
    declared = [d.within or 0.0 for d in subject.cls.info.deviations if d.excuses(name)]
    allowed = 3e-3 + max(declared, default=0.0)
    travelled = (places - approach.start) @ approach.direction
    what = f"way of a cube that flies upon {approach.link}"
    require_close(what, float(travelled.max()), approach.distance, allowed, "m")


@check(robot=grasping)
def pulled_grip_slips(subject: Subject) -> None:
    """Fingers that have held a cube for 0.5 s carry 2 mu F of a force along their pads, and no
    more, F the squeeze of each. Pulled with 0.8 of that for 0.3 s the cube stays in the hand,
    within half its edge: it may turn about a corner of the pads, since rigid bodies do not tell
    where on them they press. Pulled with 1.25 of it the cube goes by more than an edge in 0.3 s. A
    hand that is glued to what it holds does not let it go."""
    force = 5.0
    robot = subject.arm.squeezing(force)
    scene = replace(scenes.grip(robot, name="pulled grip"), gravity=(0.0, 0.0, 0.0))
    along = RobotModel(robot).tool_pose(robot.column("initial_position")).rotation()[:, 2]
    ends = np.array([_GRASP, _GRASP + 0.3, _GRASP + 0.6])
    wrenches = []
    for share, start, end in zip((0.8, 1.25), ends[:-1], ends[1:], strict=True):
        x, y, z = (float(part) for part in share * 2 * robot.friction * force * along)
        wrenches.append(Wrench(force=(x, y, z), start=float(start), end=float(end)))
    held = replace(scene.body("held"), wrenches=tuple(wrenches))
    scene = scene.with_body(held)
    with subject.world(scene) as world:
        world.follow(close_command(scene, subject.timestep))
        places = []
        for end in ends:
            world.wait(end - world.time)
            tool = RobotModel(robot).tool_pose(world.joints[0])
            places.append(np.asarray((tool.inverse() * world.pose("held")).position))
    held_by, left_by = np.linalg.norm(np.diff(places, axis=0), axis=1)
    require_close("way in the hand under 0.8 of 2 mu F", float(held_by), 0.0, EDGE / 2, "m")
    require(
        left_by > EDGE,
        f"a cube that is pulled along the pads with 1.25 of 2 mu F moves by {left_by:.2g} m in 0.3 "
        "s: something else than friction holds it in the hand",
    )


@check(robot=grasping)
def released_cube_is_let_be(subject: Subject) -> None:
    """A cube that is let go 3 mm above another one, 9 mm and 0.1 rad aside of its middle, lies
    there as it was let go: within 3 mm and 0.05 rad after 0.5 s. No step moves it by more than 1
    m/s does, and 0.5 mm, or turns it by more than 10 rad/s does, and 10 mrad. Nothing puts it into
    its place."""
    robot = subject.arm
    scene = scenes.grip(robot, name="let go")
    at = np.asarray(scene.body("held").pose.position)
    x, y, z = (float(part) for part in at - [0.008, 0.004, EDGE + 0.003])
    yaw = scene.body("held").pose.yaw + 0.1
    pillar = scenes.cube("pillar", Pose.at(x, y, (z - EDGE / 2) / 2, yaw=yaw), mass=0.0)
    pillar = replace(pillar, size=(EDGE, EDGE, z - EDGE / 2))
    below = scenes.cube("below", Pose.at(x, y, z, yaw=yaw))
    scene = replace(scene, bodies=(*scene.bodies, pillar, below))
    opened = hold_command(scene, subject.timestep)
    opened.position[:, robot.finger_indices] = robot.gripper.opened
    with subject.world(scene) as world:
        world.follow(close_command(scene, subject.timestep))
        world.wait(_GRASP)
        start = world.bodies[0].copy()
        parts = (world.follow(opened, log_period=0.0), world.wait(0.5, log_period=0.0))
    rows = np.vstack([start, *(part.bodies[:, 0] for part in parts)])
    ways = np.linalg.norm(np.diff(rows[:, :3], axis=0), axis=1)
    limit = 1.0 * subject.timestep + 5e-4
    require_close("longest way of a released cube in a step", ways.max(), 0.0, limit, "m")
    limit = 10.0 * subject.timestep + 0.01
    turns = rotation_of(rows[:, 3:7])
    turn = float((turns[1:] * turns[:-1].inv()).magnitude().max())
    require_close("largest turn of a released cube in a step", turn, 0.0, limit, "rad")
    aside = float(np.hypot(*(rows[-1, :2] - start[:2])))
    require_close("way aside of a released cube", aside, 0.0, 3e-3, "m")
    turn = float((turns[-1] * turns[0].inv()).magnitude())
    require_close("turn of a released cube", turn, 0.0, 0.05, "rad")
    fallen = float(start[2] - rows[-1, 2])
    require(fallen > 1e-3, f"the hand did not let the cube go: it fell by {fallen:.2g} m")


@check(robot=throwing)
def thrown_cube_flies_free(subject: Subject) -> None:
    """A cube that the hand threw flies, from the release to the first contact, as gravity has it:
    at each time its velocity is v + g t and its place p + v t + g t^2 / 2, each late by at most one
    step, and 1 % of what gravity did. What left a hand weighs what it weighed."""
    start, goal = (np.array(rows) for rows in subject.arm.swing or ())
    robot = subject.arm
    for joint, value in zip(robot.arm_joints, start, strict=True):
        robot = robot.with_joints(joint.name, initial_position=float(value))
    scene = scenes.grip(robot, name="throw")
    with subject.world(scene) as world:
        world.follow(close_command(scene, subject.timestep))
        world.wait(_GRASP)
        hand, began = Manipulator(world, np.random.default_rng(0)), world.time
        swing, perfect = hand.throw(goal, 0.5, feasible=True)
        motion = Motion.joined([swing, world.wait(0.6, log_period=0.0)])
    flight = Thrown(RobotModel(robot), motion, scene, "held", began, perfect).flight
    require(flight is not None, "the cube did not leave the hand that threw it")
    assert flight is not None
    opened = (motion.joints[:, 0, robot.finger_indices] > EDGE / 2 + 1e-3).all(axis=1)
    used = slice(max(flight.clear, int(np.argmax(opened))), flight.last + 1)
    t, rows = motion.time[used] - motion.time[used.start], motion.bodies[used, 0]
    require(t[-1] > 0.2, f"the thrown cube flew for {t[-1]:.2g} s only")
    g, dt, late = np.array(scene.gravity), subject.timestep, t[:, None]
    gained = np.abs(rows[:, 7:10] - rows[0, 7:10] - g * late).max(axis=1)
    gone = np.abs(rows[:, :3] - rows[0, :3] - rows[0, 7:10] * late - g * late**2 / 2).max(axis=1)
    for value, what, allowed, unit in (
        (gained, "velocity", GRAVITY * dt + 0.01 * GRAVITY * t, "m/s"),
        (gone, "place", GRAVITY * t * dt + 0.005 * GRAVITY * t**2 + 1e-5, "m"),
    ):
        k = int(np.argmax(value / allowed))
        name = f"error of a thrown cube's {what} {t[k]:.2f} s after its release"
        require_close(name, float(value[k]), 0.0, float(allowed[k]), unit)
