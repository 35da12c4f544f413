"""Checks of forces on bodies, those of contacts too, of motions that are prescribed, of bodies of
several shapes, and of the friction of pairs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pytest_simbench.laws.sticking import slab_on
from pytest_simbench.scene import Box, Compound, Pose, Scene, Wrench
from pytest_simbench.scene.pair_friction import combined
from pytest_simbench.scene.pose import vector3
from pytest_simbench.simulator import Capability
from pytest_simbench.testing import scenes
from pytest_simbench.testing.kit import check
from pytest_simbench.testing.scenes import EDGE, GRAVITY, MASS
from pytest_simbench.testing.subject import Subject, require, require_close
from pytest_simbench.worker.stepping import prescribed


@check()
def moves_as_prescribed(subject: Subject) -> None:
    """A belt under a cube, and a plate that turns as it rises, are where the scene's constant
    velocities bring them, and as fast: within 0.1 % of the way and of the speed, and 1e-4 m of
    single precision; when loaded, while stepping and, where a state can be saved, when restored.
    Neither weight nor cube changes that; the scene's gravity is not small."""
    belt = Box("belt", (2.0, 0.4, 0.1), Pose.at(0.0, 0.0, 0.5), prescribed=True)
    plate = Box("plate", (0.4, 0.3, 0.1), Pose((0.0, 1.5, 0.8), (0.8, 0.0, 0.6, 0.0)))
    turning = {"linear_velocity": (0.0, 0.0, 0.2), "angular_velocity": (0.5, -0.3, 1.0)}
    bodies = (
        replace(belt, linear_velocity=(0.5, 0.0, 0.0)),
        replace(plate, prescribed=True, **turning),  # type: ignore[arg-type]
        scenes.cube("cube", Pose.at(0.0, 0.0, 0.55 + EDGE / 2)),
    )
    scene = Scene("driven", bodies)
    with subject.world(scene) as world:
        told = [(0.0, world.bodies)]
        motion = world.wait(0.6, log_period=0.02)
        told += zip(motion.time, motion.bodies, strict=True)
        if subject.can(Capability.SAVE_RESTORE):
            world.save()
            world.restore()
            told.append((world.time, world.bodies))
    for k, body in enumerate(scene.prescribed_bodies):
        speed = float(np.abs(body.velocity).max())
        for time, row in ((time, bodies[k]) for time, bodies in told):
            law = prescribed(body, float(time))
            sign = np.sign(row[3:7] @ law[3:7])
            moved = max(np.abs(row[:3] - law[:3]).max(), np.abs(sign * row[3:7] - law[3:7]).max())
            limit = 1e-4 + 1e-3 * speed * float(time)
            require_close(f"distance of the {body.name} from its place", moved, 0.0, limit, "")
            off = float(np.abs(row[7:] - law[7:]).max())
            require_close(f"error of the {body.name}'s velocity", off, 0.0, 2e-3 * speed, "")


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
        what = f"error of {pair[1]}'s force on {pair[0]}, told as {told[pair][:3].round(4)},"
        require_close(what, off, 0.0, limit, "N")
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
    _told(subject, slab_on("incline", 0.2, 0.0, 0.5), {("body/slab", "ground"): 1.0})


MOMENTS = (1.0e-3, 1.2e-3, 1.1e-3)
"""Of a body of two boxes [kg m^2]; spread evenly its mass would give others."""

TORQUE, SECONDS = 0.01, 0.3


@check(Capability.COMPOUND)
def compounds_turn_by_their_moments(subject: Subject) -> None:
    """Three bodies of two boxes, weightless, are turned by 0.01 N m about one principal axis each:
    after 0.3 s they spin with torque * time / moment, within 1 %, and about no other axis."""
    shapes = (
        Box("foot", (0.1, 0.1, 0.02), Pose.at(0, 0, -0.05)),
        Box("wall", (0.02, 0.1, 0.1), Pose.at(0.03, 0, 0.01, yaw=0.3)),
    )
    bodies = []
    for k, axis in enumerate(np.eye(3)):
        wrench = Wrench(torque=vector3(TORQUE * axis), end=SECONDS)
        place = Pose.at(0.0, 0.5 * k, 1.0)
        bodies.append(Compound(f"body{k}", shapes, place, 0.5, moments=MOMENTS, wrenches=(wrench,)))
    with subject.world(Scene("turned", tuple(bodies), gravity=(0.0, 0.0, 0.0))) as world:
        world.wait(SECONDS)
        spins = world.bodies[:, 10:]
    for k, spin in enumerate(spins):
        right = TORQUE * SECONDS / MOMENTS[k]
        require_close(f"spin about axis {k}", float(spin[k]), right, 0.01 * right, "rad/s")
        aside = float(np.abs(np.delete(spin, k)).max())
        require_close(f"spin aside of axis {k}", aside, 0.0, 0.01 * right, "rad/s")


@check()
def pairs_have_their_friction(subject: Subject) -> None:
    """Of two surfaces of 0.3 and 0.6 a scene says whether the larger or the smaller counts: a slab
    slides down a slope of 45 degrees as where both have that one, within 2 %. Skipped where an
    adapter does not say what its engine makes of two frictions."""
    if not subject.cls.info.friction_rule:
        pytest.skip(f"{subject.name} does not say what it makes of two frictions")
    for rule, counts in (("maximum", 0.6), ("minimum", 0.3)):
        mixed, even = _slides(subject, 0.3, 0.6, rule), _slides(subject, counts, counts, rule)
        require_close(f"acceleration by the {rule}", mixed, even, 0.02 * abs(even), "m/s^2")


def _slides(subject: Subject, own: float, other: float, rule: str) -> float:
    """Acceleration of a slab on a table by gravity that leans [m/s^2]."""
    g = GRAVITY * math.sqrt(0.5)
    slab = Box("slab", (0.2, 0.2, 0.04), Pose.at(0, 0, 0.12), 1.0, own)
    table = Box("table", (4.0, 1.0, 0.1), Pose.at(1.0, 0, 0.05), friction=other)
    scene = Scene("pair", (slab, table), None, (g, 0.0, -g), own, friction_rule=rule)
    problem = combined(scene, subject.cls.info.friction_rule)[1]
    require(not problem, problem)
    with subject.world(scene) as world:
        world.wait(0.1)
        before = float(world.bodies[0, 7])
        world.wait(0.3)
        return (float(world.bodies[0, 7]) - before) / 0.3
