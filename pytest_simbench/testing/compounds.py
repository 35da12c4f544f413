"""Checks of bodies of several shapes, and of the friction of pairs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pytest_simbench.scene import Box, Compound, Pose, Scene, Wrench
from pytest_simbench.scene.pair_friction import combined
from pytest_simbench.scene.pose import vector3
from pytest_simbench.simulator import Capability
from pytest_simbench.testing.checks import check
from pytest_simbench.testing.scenes import GRAVITY
from pytest_simbench.testing.subject import Subject, require, require_close

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
