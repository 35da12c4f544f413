"""Checks of the engine's mechanics without the arm: laws every rigid-body engine must obey."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pytest_simbench.laws.drives import StepResponse
from pytest_simbench.laws.free import rotation_of
from pytest_simbench.laws.mechanisms import MOUNT, Part, Y, mechanism
from pytest_simbench.laws.sliding import SlideX, block
from pytest_simbench.scene import (
    Capsule,
    ConvexMesh,
    Cylinder,
    FloatArray,
    Pose,
    Scene,
    Sphere,
    Vector3,
)
from pytest_simbench.simulator import Capability
from pytest_simbench.testing import scenes
from pytest_simbench.testing.kit import check
from pytest_simbench.testing.scenes import EDGE, GRAVITY, MASS
from pytest_simbench.testing.subject import Subject, asked, require, require_close

RADIUS = 0.03
"""Of round bodies [m]."""

_LENGTH = 0.3
"""Of the pendulums [m]."""

_APART = 0.16
"""Of their hinges [m]; 0.1 m less 6 cm of thickness is between them."""

_START = 1.0
"""From where the first one falls [rad]. It strikes at -0.34."""


def _ball(height: float, **values: Any) -> Sphere:
    """A ball whose centre is so high above the origin [m]."""
    return Sphere("ball", RADIUS, Pose.at(0.0, 0.0, height), MASS, **values)


@check()
def slides_flat(subject: Subject) -> None:
    """A sliding slab, 2 cm high and five times as wide, stays on the slope within 1 mm."""
    motion = subject.motion(SlideX().build(), 0.8, 0.01)
    height = motion.bodies[motion.time > 0.1, 0, 2]
    highest = float(height[np.argmax(abs(height - 0.01))])
    require_close("height of the slab's centre while it slides", highest, 0.01, 1e-3, "m")


@check()
def thrown_as_the_scene_says(subject: Subject) -> None:
    """A turned cube starts with the scene's velocities, in the world's axes, and flies on with
    them: after 0.3 s its centre is where the parabola is, within g dt t; it turned by omega t,
    within 1 %."""
    body = replace(
        scenes.cube("thrown", Pose((0.1, -0.2, 2.0), (0.5, 0.5, -0.1, 0.7))),
        linear_velocity=(1.0, -0.7, 1.5),
        angular_velocity=(3.0, -2.0, 1.5),
    )
    scene = Scene("thrown", (body,))
    with subject.world(scene) as world:
        start = world.bodies[0]
        off = float(np.abs(start[7:] - body.velocity).max())
        require_close("velocity's error at the start", off, 0.0, 1e-5, "")
        world.wait(0.3)
        t, row = world.time, world.bodies[0]
    v, omega = body.velocity[:3], body.velocity[3:]
    place = start[:3] + v * t + np.array(scene.gravity) * t * t / 2
    away = float(np.abs(row[:3] - place).max())
    require_close("distance from the parabola", away, 0.0, GRAVITY * subject.timestep * t, "m")
    turn = (rotation_of(row[3:7]) * rotation_of(start[3:7]).inv()).as_rotvec()
    error = float(np.linalg.norm(turn - omega * t))
    require_close("error of its turn", error, 0.0, 0.01 * float(np.linalg.norm(omega)) * t, "rad")


@check()
def rounds_rest(subject: Subject) -> None:
    """A ball, a cylinder on its end and a lying capsule stay for 2 s: within 1 mm."""
    lying = Pose((0.6, 0.0, RADIUS), (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0))
    bodies = (
        _ball(RADIUS),
        Cylinder("can", RADIUS, 2 * RADIUS, Pose.at(0.3, 0.0, RADIUS), MASS),
        Capsule("pill", RADIUS, 2 * RADIUS, lying, MASS),
    )
    scene = Scene("standing", bodies)
    motion = subject.motion(scene, 2.0, 0.1)
    for k, body in enumerate(scene.free_bodies):
        away = np.abs(motion.bodies[:, k, :3] - body.pose.position).max()
        require_close(f"drift of the {body.name}", float(away), 0.0, 1e-3, "m")


@check()
def meshes_rest_and_slide(subject: Subject) -> None:
    """Meshes stand and slide as boxes do. A wedge on the ground, and two blocks and a box upon each
    other, stay for 1 s, each within 1 mm for each body below it. A slab with mu = 0.5 and 1 m/s
    stops after v^2 / (2 mu g), within 10 %."""
    slab = ConvexMesh("slab", block((0.1, 0.1, 0.02)), Pose.at(0.0, 0.0, 0.01), MASS, 0.5)
    slab = replace(slab, linear_velocity=(1.0, 0.0, 0.0))
    lying = ConvexMesh("wedge", scenes.wedge(), Pose.at(0.0, 0.3, 0.04 / 3), MASS, 0.5)
    cubes = [
        ConvexMesh(name, block((EDGE,) * 3), Pose.at(0.4, 0.3, EDGE * (level + 0.5)), MASS, 0.5)
        for level, name in enumerate(("low", "high"))
    ]
    top = scenes.cube("top", Pose.at(0.4, 0.3, 2.5 * EDGE), friction=0.5)
    scene = Scene("meshes", (slab, lying, *cubes, top), ground_friction=0.5)
    rows = subject.motion(scene, 1.0, 0.1).bodies
    for level, (body, row) in enumerate(zip(scene.free_bodies, rows[-1], strict=True)):
        away = row[:3] - body.pose.position
        limit = 1e-3 * max(1, level - 1)
        if body.name == "slab":
            away[0] -= 1 / (2 * body.friction * GRAVITY)
            limit = 0.1 / (2 * body.friction * GRAVITY)
        far = float(np.abs(away).max())
        require_close(f"distance of the {body.name} from its place", far, 0.0, limit, "m")


@check()
def bounces_as_restitution_says(subject: Subject) -> None:
    """A ball that strikes the plane at 3.2 m/s leaves it with 0.6 of that, within 5 %."""
    falling = _ball(RADIUS + 0.05, linear_velocity=(0.0, 0.0, -3.0), restitution=0.6)
    scene = Scene("bouncing", (falling,), ground_restitution=0.6)
    rows = subject.motion(scene, 0.15, subject.timestep).bodies[:, 0]
    struck, left = float(rows[:, 9].min()), float(rows[:, 9].max())
    require_close("speed after the bounce", left, -0.6 * struck, -0.03 * struck, "m/s")


@check()
def damps_as_the_scene_says(subject: Subject) -> None:
    """After 1 s a ball with linear damping 0.8/s and angular damping 0.5/s has exp(-0.8) of its
    speed and exp(-0.5) of its spin, within 1 %."""
    flying = _ball(3.0, linear_velocity=(1.0, 0.0, 0.5), angular_velocity=(2.0, -1.0, 4.0))
    ball = replace(flying, linear_damping=0.8, angular_damping=0.5)
    scene = Scene("damped", (ball,), gravity=(0.0, 0.0, 0.0))
    with subject.world(scene) as world:
        world.wait(1.0)
        t, row = world.time, world.bodies[0]
    law = ball.velocity * np.exp(-np.repeat(ball.damping, 3) * t)
    for what, part in (("linear", slice(0, 3)), ("angular", slice(3, 6))):
        speed = float(np.linalg.norm(law[part]))
        gap = float(np.linalg.norm(row[7:][part] - law[part]))
        require_close(f"error of the {what} velocity", gap, 0.0, 0.01 * speed, "")


@check()
def collision_keeps_momentum(subject: Subject) -> None:
    """Two cubes that collide on frictionless ground keep a horizontal momentum of zero, within
    2 % of what they exchange: the ground can only push upward."""
    roll = (math.cos(0.3), 0.0, math.sin(0.3), 0.0)
    moving = scenes.cube("moving", Pose((-0.035, 0.0, 0.3), roll), friction=0.0)
    standing = scenes.cube("standing", Pose.at(0.0, 0.0, EDGE / 2), mass=2 * MASS, friction=0.0)
    scene = Scene("collision", (moving, standing), ground_friction=0.0)
    rows = subject.motion(scene, 0.4, 0.02).bodies
    masses = np.array([MASS, 2 * MASS])
    momentum = masses[None, :, None] * rows[:, :, 7:9]
    exchanged = float(np.abs(momentum[:, 0]).max())
    require(exchanged > 0.005, f"the cubes exchanged only {exchanged:.2g} N s: they missed")
    total = float(np.abs(momentum.sum(axis=1)).max())
    require_close("total horizontal momentum", total, 0.0, 0.02 * exchanged, "N s")


@check()
def drives_are_springs(subject: Subject) -> None:
    """A joint that is told to go elsewhere comes there as its spring and damper have it, x0 (1 + w
    t) exp(-w t) when they are critical: 0.01 rad of 0.5 after 0.1 s, which takes both within 15 %.
    Skipped where an adapter declares that it has none."""
    law = StepResponse()
    drive = law.build().arm.joint_names[0]
    if reason := subject.excused(f"joint/{drive}/damping"):
        pytest.skip(reason)
    asked(subject, law, within=0.01)


@check(Capability.CONTACT_COUNT)
def contacts_counted(subject: Subject) -> None:
    """No contact in free flight, at least one for each cube of a tower that rests."""
    flying = scenes.tumbling((EDGE, EDGE, EDGE))
    with subject.world(flying) as world:
        world.wait(2 * subject.timestep)
        require(world.contact_count() == 0, f"{world.contact_count()} contacts in free flight")
    with subject.world(scenes.tower()) as world:
        world.wait(0.5)
        count, cubes = world.contact_count(), len(world.scene.free_bodies)
        require(count >= cubes, f"{count} contacts in a tower of {cubes} cubes that rests")


@check(Capability.SELF_COLLIDE)
def links_collide_when_asked(subject: Subject) -> None:
    """A pendulum, with a weight hinged within it, falls beside one that hangs, both from a beam
    that they reach into. Where links collide, it takes the other one along (0.2 rad in 0.8 s) and
    turns back before 0.8 rad; where not, it swings on beyond that and the other one hangs still
    (1 mrad). Up to the strike both move alike (2 mrad): links that one joint joins never touch."""
    apart, together = (_swings(subject, collide) for collide in (False, True))
    before = np.minimum.accumulate(apart[:, 0]) > -0.2
    off = float(np.abs(apart - together)[before].max())
    require_close("what collisions change before the strike", off, 0.0, 2e-3, "rad")
    away = float(np.abs(apart[:, -1]).max())
    require_close("how far the hanging link moves untouched", away, 0.0, 1e-3, "rad")
    reach = -float(apart[:, 0].min())
    require(reach > 0.8, f"a link that touches none swings up to {reach:.3g} rad only")
    struck, reach = -float(together[:, -1].min()), -float(together[:, 0].min())
    require(struck > 0.2, f"a link that another one strikes moves by {struck:.3g} rad only")
    require(reach < 0.8, f"a link that strikes another one swings on up to {reach:.3g} rad")


def _swings(subject: Subject, collide: bool) -> FloatArray:
    """Positions of the three joints over 0.8 s, (n, 3) [rad]."""
    name = "colliding links" if collide else "passing links"
    inertia: Vector3 = (8e-3, 8e-3, 1e-3)
    bob, small = (0.06, 0.1, _LENGTH), (0.03, 0.1, 0.03)
    centre, at = (0.0, 0.0, -_LENGTH / 2), (_APART, 0.0, 0.0)
    robot = mechanism(
        name,
        Part("falling", Y, centre=centre, inertia=inertia, start=_START, shape=bob),
        Part("weight", Y, centre, (0.0, 0.0, -0.01), 0.2, shape=small),
        Part("hanging", Y, at, centre, inertia=inertia, shape=bob, on=MOUNT),
        friction=0.0,
        self_collide=collide,
        shape=(0.6, 0.04, 0.04),
    )
    with subject.world(Scene(name, robot=robot)) as world:
        return np.asarray(world.wait(0.8, log_period=0.01).joints[:, 0])
