"""Checks of forces on bodies, those of contacts too, and of motions that are prescribed."""

from __future__ import annotations

import numpy as np

from pytest_simbench.scene import FloatArray, Pose, Scene
from pytest_simbench.simulator import Capability
from pytest_simbench.testing import scenes
from pytest_simbench.testing.checks import check
from pytest_simbench.testing.scenes import EDGE, GRAVITY, MASS
from pytest_simbench.testing.subject import Subject, require, require_close
from pytest_simbench.worker.acting import prescribed


def _kicked(subject: Subject, name: str, columns: slice, inertia: float) -> None:
    """The velocities in `columns` are the momentum of the body's wrench, and the others are 0."""
    scene = scenes.kicked()
    body = scene.body(name)
    (wrench,) = body.wrenches
    motion = subject.motion(scene, 0.5, 0.02)
    rows = motion.bodies[:, [b.name for b in scene.free_bodies].index(name), 7:]
    acted = np.clip(motion.time - wrench.start, 0.0, wrench.end - wrench.start)
    rate: FloatArray = np.array([*wrench.force, *wrench.torque]) / inertia
    away = np.abs(rows - acted[:, None] * rate)
    late = subject.timestep * float(np.abs(rate).max())
    whole = float(np.abs(acted[:, None] * rate).max())
    worst = float(away[:, columns].max())
    require_close(f"error of the {name}'s velocity", worst, 0.0, late + 1e-3 * whole, "")
    end = float(away[-1].max())
    require_close("the same 0.2 s after the end, all axes", end, 0.0, 1e-3 * whole, "")


@check()
def force_acts_for_its_time(subject: Subject) -> None:
    """A brick without weight, pulled by F for 0.2 s, has v = F t / m: nothing before, nothing more
    afterwards, and it does not turn. At all times late by at most one step, and 0.1 % at the end;
    a force that acts for a step too long is 1 % and more."""
    _kicked(subject, "brick", slice(0, 3), scenes.kicked().body("brick").mass)


@check()
def torque_acts_for_its_time(subject: Subject) -> None:
    """A turned cube under a torque T in the world's axes has omega = T t / I in the same way."""
    inertia = float(scenes.kicked().body("cube").inertia()[0])
    _kicked(subject, "cube", slice(3, 6), inertia)


@check()
def moves_as_prescribed(subject: Subject) -> None:
    """A belt under a cube, and a plate that turns as it rises, are where the scene's constant
    velocities bring them, and as fast: within 0.1 % of the way and of the speed, and 1e-4 m of
    single precision. Neither weight nor cube changes that; the scene's gravity is not small."""
    scene = scenes.driven()
    motion = subject.motion(scene, 0.6, 0.02)
    for k, body in enumerate(scene.free_bodies):
        if not body.prescribed:
            continue
        speed = float(np.abs(body.velocity).max())
        for time, row in zip(motion.time, motion.bodies[:, k], strict=True):
            law = prescribed(body, float(time))
            sign = np.sign(row[3:7] @ law[3:7])
            moved = max(np.abs(row[:3] - law[:3]).max(), np.abs(sign * row[3:7] - law[3:7]).max())
            limit = 1e-4 + 1e-3 * speed * float(time)
            require_close(f"distance of the {body.name} from its place", moved, 0.0, limit, "")
            off = float(np.abs(row[7:] - law[7:]).max())
            require_close(f"error of the {body.name}'s velocity", off, 0.0, 2e-3 * speed, "")


@check()
def belt_carries(subject: Subject) -> None:
    """A cube laid on a belt of 0.5 m/s comes to go with it: before v = mu g t says so it does not,
    within 20 % and one step, and at 0.6 s it does within 2 %."""
    scene = scenes.driven()
    motion = subject.motion(scene, 0.6, 0.02)
    rows = motion.bodies[:, [body.name for body in scene.free_bodies].index("cube")]
    speed = scene.body("belt").linear_velocity[0]
    half = int(np.argmin(np.abs(motion.time - 0.06)))
    law = scene.body("cube").friction * GRAVITY * float(motion.time[half])
    limit = 0.2 * law + GRAVITY * subject.timestep
    require_close("speed of the cube that slips", float(rows[half, 7]), law, limit, "m/s")
    require_close("speed of the cube at the end", float(rows[-1, 7]), speed, 0.02 * speed, "m/s")
    height = float(rows[-1, 2]) - scene.body("cube").pose.position[2]
    require_close("height gained on the belt", height, 0.0, EDGE / 50, "m")


def _told(subject: Subject, scene: Scene, loads: dict[tuple[str, str], float]) -> None:
    """At rest the second of each pair holds the first against the weight of its load [kg], and all
    that touches a body turns it about no axis through its centre."""
    with subject.world(scene) as world:
        world.wait(0.3)
        told, places = world.contact_forces(), world.poses()
    for pair, load in loads.items():
        require(pair in told, f"no contact of {pair[0]} with {pair[1]}; there are {sorted(told)}")
        limit = 0.02 * abs(load) * GRAVITY
        off = float(np.abs(told[pair][:3] + load * np.asarray(scene.gravity)).max())
        require_close(f"error of {pair[1]}'s force on {pair[0]}", off, 0.0, limit, "N")
        force, torque = np.hsplit(sum(told[two] for two in told if two[0] == pair[0]), 2)
        place = np.asarray(places[pair[0].partition("/")[2]].position)
        about = float(np.abs(torque - np.cross(place, force)).max())
        require_close(f"torque on {pair[0]} about its centre", about, 0.0, limit * EDGE, "N m")


@check(Capability.CONTACT_FORCES)
def weight_is_told(subject: Subject) -> None:
    """The ground carries a cube at rest with m g, upward; one that carries another with twice
    that, while the upper one weighs m g on it: each within 2 %."""
    low = scenes.cube("low", Pose.at(0.4, 0.0, EDGE / 2))
    high = scenes.cube("high", Pose.at(0.4, 0.0, 1.5 * EDGE))
    alone = scenes.cube("alone", Pose.at(-0.3, 0.2, EDGE / 2))
    loads = {
        ("body/alone", "ground"): MASS,
        ("body/low", "ground"): 2 * MASS,
        ("body/high", "body/low"): MASS,
        ("body/low", "body/high"): -MASS,
    }
    _told(subject, Scene("weighed", (low, high, alone)), loads)


@check(Capability.CONTACT_FORCES)
def friction_is_told(subject: Subject) -> None:
    """On a slope of 0.2 the ground holds a slab at rest against all of its weight, friction and
    normal force together, within 2 %."""
    _told(subject, scenes.incline(0.2, 0.5), {("body/slab", "ground"): MASS})
