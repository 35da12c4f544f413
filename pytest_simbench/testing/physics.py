"""Checks of the engine's mechanics with boxes alone: laws every rigid-body engine must obey."""

from __future__ import annotations

import math

import numpy as np

from pytest_simbench.client.world import Motion
from pytest_simbench.scene import FloatArray, Pose, rotation_matrix
from pytest_simbench.simulator import Capability
from pytest_simbench.testing import scenes
from pytest_simbench.testing.checks import check
from pytest_simbench.testing.scenes import EDGE, GRAVITY, RADIUS
from pytest_simbench.testing.subject import Subject, require, require_close


@check()
def free_fall(subject: Subject) -> None:
    """After 1 s of free fall v = g t and s = g t^2 / 2; first-order integrators are off by at
    most g dt in v and g t dt in s. Damping of 0.04 / s costs 0.19 m/s and is found."""
    motion = subject.motion(scenes.falling(), 1.0, 0.1)
    t, row = float(motion.time[-1]), motion.bodies[-1, 0]
    g, dt = GRAVITY, subject.timestep
    require_close("speed of free fall", -row[9], g * t, g * dt, "m/s")
    require_close("height fallen", 6.0 - row[2], g * t * t / 2, g * t * dt + 1e-5, "m")
    aside = float(np.hypot(row[0] - 0.1, row[1] - 0.2))
    require_close("sideways motion in free fall", aside, 0.0, 1e-5, "m")


@check()
def rest_on_plane(subject: Subject) -> None:
    """A cube put on the ground stays for 3 s: within 1 mm in x, y and z, within 0.5 degrees."""
    motion = subject.motion(scenes.tower(), 5.0, 0.1)
    rows = motion.bodies[motion.time < 3.05, 0]
    away = np.abs(rows[:, :3] - [0.4, 0.0, EDGE / 2]).max(axis=0)
    for axis, value in zip("xyz", away, strict=True):
        require_close(f"drift in {axis} of a resting cube", float(value), 0.0, 1e-3, "m")
    upright = min(float(rotation_matrix(row[3:7])[2, 2]) for row in rows)
    tilt = math.degrees(math.acos(min(1.0, upright)))
    require_close("tilt of a resting cube", tilt, 0.0, 0.5, "degrees")


@check()
def tower_stands(subject: Subject) -> None:
    """Three cubes upon each other stay for 5 s, each within 2 mm of its place."""
    row = subject.motion(scenes.tower(), 5.0, 0.1).bodies[-1]
    for level in range(3):
        place = np.array([0.4, 0.0, EDGE * (level + 0.5)])
        away = float(np.linalg.norm(row[level, :3] - place))
        require_close(f"displacement of level {level}", away, 0.0, 2e-3, "m")


def _slide(subject: Subject, direction: float) -> None:
    slope, mu = 0.75, 0.5
    motion = subject.motion(scenes.incline(slope, mu, direction), 0.8, 0.01)
    along = motion.bodies[:, 0, 7:9] @ [math.cos(direction), math.sin(direction)]
    used = motion.time > 0.25  # the contact has settled
    measured = float(np.polyfit(motion.time[used], along[used], 1)[0])
    angle = math.atan(slope)
    law = GRAVITY * (math.sin(angle) - mu * math.cos(angle))
    normal = GRAVITY * math.cos(angle)
    require_close("acceleration down the incline", measured, law, 0.05 * mu * normal, "m/s^2")


@check()
def slides_above_mu(subject: Subject) -> None:
    """Down a slope steeper than mu a slab accelerates by g (sin - mu cos); mu within 5 %."""
    _slide(subject, 0.0)


@check()
def slides_alike_diagonally(subject: Subject) -> None:
    """The same along a diagonal of the axes, where a friction pyramid differs from the cone."""
    _slide(subject, math.pi / 4)


@check()
def slides_flat(subject: Subject) -> None:
    """A sliding slab, 2 cm high and five times as wide, stays on the slope within 1 mm."""
    motion = subject.motion(scenes.incline(0.75, 0.5), 0.8, 0.01)
    height = motion.bodies[motion.time > 0.1, 0, 2]
    highest = float(height[np.argmax(abs(height - 0.01))])
    require_close("height of the slab's centre while it slides", highest, 0.01, 1e-3, "m")


@check()
def sticks_below_mu(subject: Subject) -> None:
    """On a slope of 0.8 mu a slab stays: less than 1 mm in 2 s, the settling left out."""
    motion = subject.motion(scenes.incline(0.4, 0.5), 2.2, 0.1)
    away = float(np.linalg.norm(motion.bodies[-1, 0, :2] - motion.bodies[1, 0, :2]))
    require_close("creep on a slope below mu", away, 0.0, 1e-3, "m")


@check()
def thrown_as_the_scene_says(subject: Subject) -> None:
    """A turned cube starts with the scene's velocities, in the world's axes, and flies on with
    them: after 0.3 s its centre is where the parabola is, within g dt t; it turned by omega t,
    within 1 %."""
    scene = scenes.thrown()
    body = scene.body("thrown")
    v, omega = np.array(body.linear_velocity), np.array(body.angular_velocity)
    with subject.world(scene) as world:
        start = world.bodies[0]
        for what, row, law in (("linear", start[7:10], v), ("angular", start[10:], omega)):
            gap = float(np.abs(row - law).max())
            require_close(f"{what} velocity's error at the start", gap, 0.0, 1e-5, "")
        world.wait(0.3)
        t, row = world.time, world.bodies[0]
    place = start[:3] + v * t + np.array(scene.gravity) * t * t / 2
    away = float(np.abs(row[:3] - place).max())
    require_close("distance from the parabola", away, 0.0, GRAVITY * subject.timestep * t, "m")
    turn = Pose(quaternion=row[3:7]) * Pose(quaternion=start[3:7]).inverse()
    vector = np.array(turn.quaternion) * (np.sign(turn.quaternion[0]) or 1.0)
    sine = float(np.linalg.norm(vector[1:]))
    turned = 2 * math.atan2(sine, float(vector[0])) * vector[1:] / sine
    error = float(np.linalg.norm(turned - omega * t))
    require_close("error of its turn", error, 0.0, 0.01 * float(np.linalg.norm(omega)) * t, "rad")


def _roll(subject: Subject, name: str, inertia: float) -> None:
    scene = scenes.bowling()
    motion = subject.motion(scene, 1.0, 0.02)
    rows = motion.bodies[:, [body.name for body in scene.free_bodies].index(name)]
    speed, law = float(rows[-1, 7]), 1 / (1 + inertia)
    require_close("speed after sliding", speed, law, 0.02 * law, "m/s")
    require_close("speed of turning times radius", rows[-1, 11] * RADIUS, law, 0.02 * law, "m/s")
    middle = float(rows[len(rows) // 2, 7])
    require_close("speed lost while it rolls 0.35 m", middle - speed, 0.0, 0.005, "m/s")


@check()
def ball_rolls(subject: Subject) -> None:
    """A ball set sliding at 1 m/s comes to roll with 5/7 of it, within 2 %, and keeps that: it
    loses at most 5 mm/s on the next 0.35 m. Its angular momentum about the contact stays."""
    _roll(subject, "ball", 2 / 5)


@check()
def can_rolls(subject: Subject) -> None:
    """A lying cylinder does so with 2/3 of it."""
    _roll(subject, "can", 1 / 2)


@check()
def rounds_rest(subject: Subject) -> None:
    """A ball, a cylinder on its end and a lying capsule stay for 2 s: within 1 mm."""
    scene = scenes.standing()
    motion = subject.motion(scene, 2.0, 0.1)
    for k, body in enumerate(scene.free_bodies):
        away = np.abs(motion.bodies[:, k, :3] - body.pose.position).max()
        require_close(f"drift of the {body.name}", float(away), 0.0, 1e-3, "m")


@check()
def meshes_rest_and_slide(subject: Subject) -> None:
    """Meshes stand and slide as boxes do. A wedge on the ground, and two blocks and a box upon each
    other, stay for 1 s, each within 1 mm for each body below it. A slab with mu = 0.5 and 1 m/s
    stops after v^2 / (2 mu g), within 10 %."""
    scene = scenes.meshes()
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
    rows = subject.motion(scenes.bouncing(), 0.15, subject.timestep).bodies[:, 0]
    struck, left = float(rows[:, 9].min()), float(rows[:, 9].max())
    require_close("speed after the bounce", left, -0.6 * struck, -0.03 * struck, "m/s")


@check()
def damps_as_the_scene_says(subject: Subject) -> None:
    """After 1 s a ball with linear damping 0.8/s and angular damping 0.5/s has exp(-0.8) of its
    speed and exp(-0.5) of its spin, within 1 %."""
    scene = scenes.damped()
    ball = scene.body("ball")
    with subject.world(scene) as world:
        world.wait(1.0)
        t, row = world.time, world.bodies[0]
    law = ball.velocity * np.exp(-np.repeat(ball.damping, 3) * t)
    for what, part in (("linear", slice(0, 3)), ("angular", slice(3, 6))):
        speed = float(np.linalg.norm(law[part]))
        gap = float(np.linalg.norm(row[7:][part] - law[part]))
        require_close(f"error of the {what} velocity", gap, 0.0, 0.01 * speed, "")


def _flight(motion: Motion) -> FloatArray:
    rows = motion.bodies[motion.bodies[:, 0, 2] < 4.8, 0]  # below the ledge, in the air
    require(len(rows) >= 5, "the box did not leave the ledge")
    spin = float(np.linalg.norm(rows[0, 10:]))
    require(spin > 1.0, f"the box spins at {spin:.2g} rad/s only: the ledge gave it no turn")
    return np.asarray(rows)


def _spin(subject: Subject, size: tuple[float, float, float], tolerance: float) -> None:
    scene = scenes.tumbling(size)
    rows = _flight(subject.motion(scene, 0.8, 0.02))
    inertia = np.diag(scene.body("box").inertia())
    energy, momentum = [], []
    for row in rows:
        rotation, omega = rotation_matrix(row[3:7]), row[10:]
        momentum.append(rotation @ inertia @ rotation.T @ omega)
        energy.append(float(omega @ momentum[-1]) / 2)
    change = energy[-1] / energy[0] - 1
    require_close("relative change of the spin's energy", change, 0.0, tolerance, "")
    turned = np.linalg.norm(momentum[-1] - momentum[0]) / np.linalg.norm(momentum[0])
    require_close("relative change of angular momentum", float(turned), 0.0, tolerance, "")


@check()
def cube_spins_on(subject: Subject) -> None:
    """A cube spinning in free flight (about 0.6 s) keeps its rotational energy and angular
    momentum within 1 %: for equal moments of inertia omega is constant, whatever the integrator."""
    _spin(subject, (EDGE, EDGE, EDGE), 0.01)


@check()
def brick_tumbles_on(subject: Subject) -> None:
    """A brick with three different moments of inertia does so too, within 10 %: engines
    integrate the gyroscopic torque to first order, or leave it out."""
    _spin(subject, (0.1, 0.06, 0.03), 0.10)


@check()
def collision_keeps_momentum(subject: Subject) -> None:
    """Two cubes that collide on frictionless ground keep a horizontal momentum of zero, within
    2 % of what they exchange: the ground can only push upward."""
    rows = subject.motion(scenes.collision(), 0.4, 0.02).bodies
    masses = np.array([scenes.MASS, 2 * scenes.MASS])
    momentum = masses[None, :, None] * rows[:, :, 7:9]
    exchanged = float(np.abs(momentum[:, 0]).max())
    require(exchanged > 0.005, f"the cubes exchanged only {exchanged:.2g} N s: they missed")
    total = float(np.abs(momentum.sum(axis=1)).max())
    require_close("total horizontal momentum", total, 0.0, 0.02 * exchanged, "N s")


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
