"""Checks of what robot and bodies do to each other: forces act both ways, and only on contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pytest_simbench.laws.hands import close_command, gravity_effort
from pytest_simbench.laws.impact import DeadLanding
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import FloatArray, Pose, Scene
from pytest_simbench.testing import scenes
from pytest_simbench.testing.checks import check
from pytest_simbench.testing.drives import hold_command
from pytest_simbench.testing.robots import any_robot, grasping
from pytest_simbench.testing.scenes import GRAVITY, MASS
from pytest_simbench.testing.subject import Subject, asked, logged, require, require_close
from pytest_simbench.testing.touch import Approach, approaches, beside


@check(robot=grasping)
def squeeze_bounds_the_grip(subject: Subject) -> None:
    """Two fingers that press with F carry 2 mu F and no more: of what they can carry, a cube of
    0.6 times that weight stays (15 mm in 0.5 s), one of 1.3 times falls out (50 mm)."""
    force = 5.0
    robot = scenes.squeezing(subject.arm, force)
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
    weak = scenes.with_joint(robot, name, effort_limit=limit)
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
            motion = logged(world.wait(0.04 - world.time, log_period=0.002))
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


@check()
def nothing_bounces(subject: Subject) -> None:
    """A cube that falls flat upon the ground from 0.1 m rises again by at most a tenth of that
    (restitution below 0.32)."""
    asked(subject, DeadLanding(height=0.1), within=0.01)
