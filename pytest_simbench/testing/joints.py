"""Checks of what a joint does by itself (damping, friction, a spring, its rotor), of links that
feel a share of gravity or are held together, of joints that move together, of pairs kept apart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pytest_simbench.laws.base import solved
from pytest_simbench.laws.mechanisms import STRONG, Part, Y, mechanism
from pytest_simbench.scene import (
    Box,
    Closure,
    Coupling,
    FloatArray,
    Pose,
    Robot,
    Scene,
    Trajectory,
    Vector3,
)
from pytest_simbench.scene.pose import vector3
from pytest_simbench.simulator import Capability
from pytest_simbench.testing import scenes
from pytest_simbench.testing.kit import check
from pytest_simbench.testing.scenes import GRAVITY as G
from pytest_simbench.testing.subject import Subject, require, require_close

MASS = 1.0
"""Of what moves on a joint here [kg]."""

LEVER = 0.3
"""From the axis of a hinge to the centre of mass [m]."""

INERTIA: Vector3 = (0.01, 0.01, 0.01)
"""About that centre [kg m^2]."""

ABOUT_AXIS = INERTIA[1] + MASS * LEVER**2

SECONDS = 0.5

Z: Vector3 = (0.0, 0.0, 1.0)

Acceleration = Callable[[float, float], float]
"""Of a joint, by its position and velocity."""


def slider(name: str, **values: Any) -> Part:
    """A mass on a vertical slider, which falls."""
    return Part(name, Z, slides=True, inertia=INERTIA, **values)


def lever(name: str, offset: Vector3 = (0.0, 0.0, 0.0), **values: Any) -> Part:
    """A mass on a hinge, beside it at position 0; it falls to positive positions."""
    return Part(name, Y, offset, (LEVER, 0.0, 0.0), inertia=INERTIA, on="mount", **values)


def followed(law: Acceleration, time: FloatArray) -> FloatArray:
    """Positions from rest at 0, (n,), by DOP853."""
    grid = np.linspace(0.0, time[-1], 2000)
    found = solved(lambda _, state: [state[1], law(*state)], [0.0, 0.0], grid[-1], len(grid))
    return np.interp(time, grid, found[:, 0])


def declared(subject: Subject, word: str) -> None:
    """Skip where the adapter declares what it lacks of scenes with this word."""
    for deviation in subject.cls.info.deviations:
        if deviation.only == word and deviation.quantity and deviation.within is None:
            pytest.skip(deviation.reason)


def moves(
    subject: Subject, robot: Robot, effort: float | None = None
) -> tuple[FloatArray, FloatArray]:
    """Times, (n,) [s], and positions of the joints, (n, n_joints), of what nobody drives, or of
    what is told an effort for one step and then no more [N m or N]."""
    with subject.world(Scene(robot.name, robot=robot)) as world:
        if effort is not None:
            rest = np.zeros(len(robot.joints))
            world.follow(Trajectory.holding(subject.timestep, rest, rest + effort))
        motion = world.wait(SECONDS, log_period=0.01)
    return motion.time, motion.joints[:, 0]


def moves_by(
    subject: Subject,
    *parts: Part,
    law: Acceleration,
    rotor: float = 0.0,
    told: float | None = None,
    **held: Any,
) -> FloatArray:
    """The first part moves as the law says, within 2 % of its way and two steps' travel; positions
    of all, (n, n_parts). `rotor`: armature of that part's joint; `told`: effort [N m or N];
    `held`: see `mechanism`."""
    robot, part = mechanism(parts[0].name, *parts, **held), parts[0]
    if rotor:
        robot = robot.with_joints(part.name, armature=rotor)
    time, positions = moves(subject, robot, told)
    right = followed(law, time)
    fastest = float(np.abs(np.gradient(right, time)).max())
    allowed = 0.02 * float(np.ptp(right)) + 2 * subject.timestep * fastest
    worst = int(np.abs(positions[:, 0] - right).argmax())
    what = f"position of {part.name} after {time[worst]:.2f} s"
    unit = "m" if part.slides else "rad"
    require_close(what, float(positions[worst, 0]), float(right[worst]), allowed, unit)
    return positions


def held(subject: Subject, part: Part, told: float | None = None) -> None:
    """What pulls less than the friction, or as much as a motor that is told an effort [N m or N],
    moves nothing: 2 mm or 5 mrad in half a second."""
    _, positions = moves(subject, mechanism(part.name, part), told)
    way, unit = (2e-3, "m") if part.slides else (5e-3, "rad")
    require_close(f"creep of {part.name}", float(np.abs(positions).max()), 0.0, way, unit)


def turning(q: float) -> float:
    """Torque of the weight of a lever [N m]."""
    return MASS * G * LEVER * float(np.cos(q))


@check()
def joints_are_damped(subject: Subject) -> None:
    """A mass on a slider falls against 20 N s/m, up to 0.49 m/s, and a lever against 1 N m s/rad,
    as the equation of motion says, though the drive's effort limit is next to nothing."""
    declared(subject, "passive_damping")
    moves_by(
        subject, slider("damped slider", passive_damping=20.0), law=lambda q, v: -G - 20 * v / MASS
    )
    damped = lever("damped lever", passive_damping=1.0)
    moves_by(subject, damped, law=lambda q, v: (turning(q) - v) / ABOUT_AXIS)


@check()
def joints_have_friction(subject: Subject) -> None:
    """Of a mass on a slider and of a lever: friction of 1.25 times the weight's effort holds it,
    with 0.6 times it falls with the rest."""
    declared(subject, "joint_friction")
    weight, torque = MASS * G, MASS * G * LEVER
    held(subject, slider("held slider", friction=1.25 * weight))
    held(subject, lever("held lever", friction=1.25 * torque))
    moves_by(subject, slider("braked slider", friction=0.6 * weight), law=lambda q, v: -0.4 * G)
    moves_by(
        subject,
        lever("braked lever", friction=0.6 * torque),
        law=lambda q, v: max(turning(q) - 0.6 * torque, 0.0) / ABOUT_AXIS,
    )


@check()
def joints_have_springs(subject: Subject) -> None:
    """A mass on a slider swings about where its spring of 200 N/m, at rest 0.1 m above, holds its
    weight; a lever likewise. A drive as stiff that holds 0 doubles stiffness and halves the way."""
    declared(subject, "spring")
    part = slider("sprung slider", spring=200.0, rest=0.1)
    moves_by(subject, part, law=lambda q, v: -G + 200 * (0.1 - q) / MASS)
    part = lever("sprung lever", spring=20.0, rest=-0.4)
    moves_by(subject, part, law=lambda q, v: (turning(q) + 20 * (-0.4 - q)) / ABOUT_AXIS)
    driven = slider("driven slider", spring=200.0, rest=0.1, stiffness=200.0, effort=STRONG)
    if not subject.excused(f"joint/{driven.name}/stiffness"):
        moves_by(subject, driven, law=lambda q, v: -G + (200 * (0.1 - q) - 200 * q) / MASS)


@check()
def links_feel_their_share_of_gravity(subject: Subject) -> None:
    """A mass on a slider stays, and a lever, where their weight is compensated. With half of it
    both fall half as fast, and a mass on the slider, which feels the whole, as much faster."""
    declared(subject, "link_gravity")
    held(subject, slider("borne slider", gravity=0.0))
    held(subject, lever("borne lever", gravity=0.0))
    half = lever("light lever", gravity=0.5)
    moves_by(subject, half, law=lambda q, v: turning(q) / 2 / ABOUT_AXIS)
    pair = slider("light slider", gravity=0.5), slider("heavy slider")
    way = moves_by(subject, *pair, law=lambda q, v: -G / 2)
    gap = float(np.abs(way[:, 1] - way[:, 0]).max())
    require_close("way of a heavy slider on a light one", gap, 0.0, 0.02 * G / 4 * SECONDS**2, "m")


@check(Capability.COUPLINGS)
def joints_move_together(subject: Subject) -> None:
    """A lever falls and turns another one, -0.5 times as far and from 0.2 rad: within 5 mrad, and
    as fast as both inertias let it (2 %). So does one that turns a light one, -2 times as far."""
    _move_together(subject, Coupling("turned", "falling", -0.5, 0.2), 1.0)
    _move_together(subject, Coupling("turned", "falling", -2.0, 0.2), 0.2)


def _move_together(subject: Subject, pair: Coupling, share: float) -> None:
    """`share`: of the lever that is turned, its mass and inertia in those of the other."""
    light = vector3(share * np.array(INERTIA))
    turned = replace(lever("turned", (0.0, 0.5, 0.0), start=pair.offset, mass=share), inertia=light)

    def law(q: float, v: float) -> float:
        torque = turning(q) + pair.ratio * share * turning(pair.ratio * q + pair.offset)
        return torque / (ABOUT_AXIS * (1 + share * pair.ratio**2))

    positions = moves_by(subject, lever("falling"), turned, law=law, couplings=(pair,))
    apart = positions[:, 1] - (pair.ratio * positions[:, 0] + pair.offset)
    require_close("gap of the coupled joints", float(np.abs(apart).max()), 0.0, 5e-3, "rad")


@check(Capability.LOOPS)
def welded_links_are_one(subject: Subject) -> None:
    """The first and the last of four levers that hang on each other are welded together: all swing
    as one body, the joints between them within 5 mrad. A ball and its socket in place of the weld
    lets them fold."""
    offsets = ((0.6, 0.0, 0.0), (0.2, 0.0, 0.2), (0.2, 0.0, -0.1))
    parts = [lever("first")]
    for k, offset in enumerate(offsets):
        parts.append(Part(f"lever {k}", Y, offset, (LEVER, 0.0, 0.0), inertia=INERTIA))
    last = tuple(np.sum(offsets, axis=0).tolist())
    weld = Closure(parts[0].link, parts[-1].link, vector3(last), rigid=True)
    centres = np.cumsum([(LEVER, 0.0, 0.0), *offsets], axis=0)
    inertia = len(parts) * INERTIA[1] + MASS * float(np.sum(centres**2))
    x, _, z = centres.sum(axis=0)

    def law(q: float, v: float) -> float:
        return MASS * G * float(x * np.cos(q) + z * np.sin(q)) / inertia

    positions = moves_by(subject, *parts, law=law, closures=(weld,))
    require_close("turn of welded links", float(np.abs(positions[:, 1:]).max()), 0.0, 5e-3, "rad")


@check()
def rotors_are_heavy(subject: Subject) -> None:
    """With a rotor as heavy as the mass on it a slider falls half as fast. Skipped where an adapter
    declares that it has none."""
    part = slider("geared slider")
    if reason := subject.excused(f"joint/{part.name}/armature"):
        pytest.skip(reason)
    moves_by(subject, part, law=lambda q, v: -G / 2, rotor=MASS)


@check()
def motors_push(subject: Subject) -> None:
    """A mass on a slider, with a motor (a drive without stiffness and damping): told an effort as
    large as its weight it stays, told half of that it falls half as fast, told ten times that it
    rises with what the effort limit, 1.5 times the weight, leaves: half of g. A lever likewise, but
    for the last; a motor that is told nothing lets it fall."""
    declared(subject, "motor")
    weight, torque = MASS * G, MASS * G * LEVER
    strong = slider("motor", effort=STRONG)
    held(subject, strong, weight)
    moves_by(subject, strong, law=lambda q, v: -G / 2, told=weight / 2)
    weak = slider("weak motor", effort=1.5 * weight)
    moves_by(subject, weak, law=lambda q, v: G / 2, told=10 * weight)
    joint = lever("motor of a lever", effort=STRONG)
    held(subject, joint, -torque)
    moves_by(subject, joint, law=lambda q, v: turning(q) / ABOUT_AXIS)
    half = -torque / 2
    moves_by(subject, joint, law=lambda q, v: (turning(q) + half) / ABOUT_AXIS, told=half)


@check(Capability.APART)
def pairs_are_kept_apart(subject: Subject) -> None:
    """Three cubes fall on a table: one lies on it, one that is kept apart from it falls through and
    lies on the ground, one that is kept apart from both is below the ground. A lever with a shape
    falls through a post that it is kept apart from, and is stopped by one that it is not."""
    top, edge = 0.3, scenes.EDGE
    for kept in (False, True):
        cubes = [
            scenes.cube(name, Pose.at(0.0, y, top + edge / 2 + 0.01))
            for name, y in (("held", -0.2), ("let", 0.0), ("lost", 0.2))
        ]
        table = Box("table", (0.4, 0.6, 0.04), Pose.at(0.0, 0.0, top - 0.02))
        post = Box("post", (0.1, 0.1, 0.5), Pose.at(1.25, 0.0, 1.53))
        swing = Part("swing", Y, centre=(LEVER, 0.0, 0.0), inertia=INERTIA, shape=(0.1, 0.05, 0.05))
        robot = mechanism("swing", swing, base=Pose.at(1.0, 0.0, 2.0))
        pairs = (
            ("body/let", "body/table"),
            ("body/table", "body/lost"),
            ("ground", "body/lost"),
            (f"link/{swing.link}", "body/post"),
        )
        scene = Scene("apart", (table, post, *cubes), robot, apart=pairs if kept else ())
        with subject.world(scene) as world:
            world.wait(SECONDS)
            heights, angle = world.bodies[:, 2], float(world.joints[0, 0])
        lying = top + edge / 2
        right = (lying, edge / 2, None) if kept else (lying,) * 3
        for cube, height, expected in zip(cubes, heights, right, strict=True):
            what = f"height of the cube {cube.name!r}, kept {'apart' if kept else 'nowhere'}"
            if expected is None:
                require(height < -edge, f"{what}, is {height:.3g} m: it lies on something")
            else:
                require_close(what, float(height), expected, 2e-3, "m")
        far = angle > 1.2
        require(far == kept, f"a lever and a post, {kept = }: the lever turns to {angle:.3g} rad")
