"""Every option of every adapter reaches its engine.

Three ways show it, the first that an engine allows: the engine tells the option's value (`TOLD`);
the world moves as it does when the engine's own function sets the value behind the adapter's back
(`SET`); the world moves otherwise than with the default (`SHOWN`).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from pytest_simbench.client.world import World
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Pose, Trajectory
from pytest_simbench.simulator import Simulator
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.simulator.settings import changed
from pytest_simbench.testing import scenes

from ..conftest import ADAPTERS, HERE
from . import settings_told
from .worlds import Worlds, loaded

Changes = Mapping[str, Any]

SCENE = replace(
    scenes.grip(),
    bodies=(
        *scenes.grip().bodies,
        scenes.cube("high", Pose.at(0.005, 1.0, 0.0751, yaw=0.2)),
        scenes.cube("low", Pose.at(0.0, 1.0, 0.025)),
        scenes.cube("sunk", Pose.at(0.0, -1.0, 0.015)),
        replace(
            scenes.cube("sliding", Pose.at(-1.0, 0.0, 0.025)),
            linear_velocity=(-0.6, 0.4, 0.0),
            angular_velocity=(0.0, 0.0, 2.0),
        ),
        replace(
            scenes.cube("late", Pose.at(-1.0, 1.0, 0.4, yaw=0.3)),
            linear_velocity=(0.1, 0.0, -1.0),
            angular_velocity=(3.0, -2.0, 1.5),
        ),
    ),
)
"""Held, stacked, sunk into the ground, sliding, and falling upon an edge."""

GOAL = panda().column("initial_position") + 0.1
GOAL[panda().finger_indices] = panda().gripper.closed

SECONDS = 3.0
"""Of motion: after two of rest Bullet has bodies sleep [s]."""

MUJOCO = {
    "timestep": 0.003, "integrator": "implicit", "solver": "CG", "iterations": 33,
    "cone": "elliptic", "impratio": 3.0, "condim": 4, "solimp": (0.8, 0.85, 0.003),
}  # fmt: skip

TOLD: dict[str, tuple[Changes, ...]] = {
    "mujoco": ({**MUJOCO, "solref": (0.03, 0.8), "noslip_iterations": 7},),
    "newton": ({**MUJOCO, "ke": 900.0, "kd": 50.0, "multiccd": True, "gap": 0.07},),
    "pybullet": ({"timestep": 0.003, "solver_iterations": 33, "spinning_friction": 0.02},),
    "sapien": (
        {
            "timestep": 0.006, "position_iterations": 7, "velocity_iterations": 3, "tgs": False,
            "pcm": False, "friction_every_iteration": False, "enhanced_determinism": True,
            "bounce_threshold": 1.5, "contact_offset": 0.015, "sleep_threshold": 0.007,
            "angular_damping": 0.03, "link_damping": 0.02, "joint_friction": 0.04,
        },
    ),
    "drake": (
        {
            "timestep": 0.002, "contact_model": "point", "approximation": "sap",
            "near_rigid_threshold": 0.5, "compliance": "compliant", "hydroelastic_modulus": 2e7,
            "point_stiffness": 3e6, "hunt_crossley_dissipation": 30.0, "relaxation_time": 0.05,
            "corner_radius": 0.002, "pad_radius": 0.0015, "shrink": 2e-4,
        },
        {"contact_model": "hydroelastic", "approximation": "similar", "compliance": "rigid"},
    ),
    "dart": (
        {
            "timestep": 0.002, "detector": "bullet", "solver": "nsgs", "sweeps": 33,
            "tolerance": 1e-3, "sleeping": False, "split_impulse": True,
        },
        {"detector": "ode", "solver": "nsgs"},
        {"detector": "dart", "solver": "pgs"},
    ),
    "ode": (
        {
            "timestep": 0.004, "iterations": 33, "erp": 0.3, "cfm": 2e-5, "contact_erp": 0.4,
            "contact_cfm": 3e-4, "friction": "slip", "position_gain": 7.0, "sleeping": False,
        },
        {"drive": "spring"},
    ),
    "genesis": (
        {
            "timestep": 0.004, "substeps": 2, "integrator": "Euler", "impratio": 3.0,
            "constraint_timeconst": 0.03, "impedance": (0.8, 0.85), "iterations": 33,
            "tolerance": 1e-4, "noslip_iterations": 3, "box_box_detection": True, "gjk": True,
        },
        {"friction_cone": "elliptic", "precision": "64"},
    ),
    "gazebo": (
        {"timestep": 0.002, "detector": "bullet", "solver": "pgs", "position_gain": 0.3},
        {"engine": "bullet-featherstone"},
        {"engine": "bullet-featherstone", "torsional_friction": 0.3},
    ),
    "coppeliasim": (
        {
            "timestep": 0.002, "drive": "velocity", "position_gain": 0.3, "cone": "elliptic",
            "iterations": 70, "sticky": True,
        },
        {"engine": "ode"},
        {"engine": "mujoco", "solref": (0.01, 1.2), "solimp": (0.8, 0.9, 0.002)},
        {"engine": "mujoco"},
    ),
    "ovphysx": (
        {
            "solver": "PGS", "body_iterations": 7, "arm_iterations": 9, "velocity_iterations": 2,
            "linear_damping": 0.01, "angular_damping": 0.02, "sleeping": False,
            "max_depenetration_velocity": 2.0, "contact_offset": 0.01, "rest_offset": 0.001,
            "friction_offset_threshold": 0.03, "friction_correlation_distance": 0.02,
            "forces_every_iteration": False, "contact_last": True, "threads": 3,
        },
    ),
}  # fmt: skip
"""Worlds in which each option that the engine tells has another value than by default."""


def pybullet_world(**parameters: Any) -> Callable[[Any], None]:
    def set_(s: Any) -> None:
        import pybullet

        pybullet.setPhysicsEngineParameter(**parameters, physicsClientId=s.client)

    return set_


def pybullet_bodies(**parameters: Any) -> Callable[[Any], None]:
    def set_(s: Any) -> None:
        import pybullet

        for number in (s._ground, *s._bodies.values(), s._robot):
            pybullet.changeDynamics(number, -1, **parameters, physicsClientId=s.client)

    return set_


def pybullet_gains(arm: float, fingers: float, velocity: float) -> Callable[[Any], None]:
    def set_(s: Any) -> None:
        s._drives.gains = [arm] * 7 + [fingers] * 2, [velocity] * 9

    return set_


def dart_pgs(s: Any) -> None:
    import dartpy

    options = dartpy.constraint.PgsBoxedLcpSolverOption()
    options.mMaxIteration, options.mDeltaXThreshold = 3, 0.5
    options.mRelativeDeltaXTolerance = 0.5
    s.world.getConstraintSolver().getBoxedLcpSolver().setOption(options)


SET: dict[str, tuple[tuple[Changes, Changes, Callable[[Any], None]], ...]] = {
    "pybullet": (
        ({}, {"solver_residual": 0.01}, pybullet_world(solverResidualThreshold=0.01)),
        ({}, {"contact_erp": 0.3}, pybullet_world(contactERP=0.3)),
        ({"friction_anchor": True}, {"friction_erp": 0.05}, pybullet_world(frictionERP=0.05)),
        ({}, {"cone_friction": False}, pybullet_world(enableConeFriction=0)),
        ({}, {"ordered_pairs": True}, pybullet_world(deterministicOverlappingPairs=1)),
        ({}, {"linear_damping": 0.125}, pybullet_bodies(linearDamping=0.125)),
        ({}, {"angular_damping": 0.125}, pybullet_bodies(angularDamping=0.125)),
        ({}, {"sleeping": True}, pybullet_bodies(activationState=1)),
        ({}, {"position_gain": 0.2}, pybullet_gains(0.2, 0.1, 1.0)),
        ({}, {"finger_gain": 0.2}, pybullet_gains(0.1, 0.2, 1.0)),
        ({}, {"velocity_gain": 0.7}, pybullet_gains(0.1, 0.1, 0.7)),
    ),
    "drake": (
        (
            {"timestep": 0.004},
            {"stiction_tolerance": 0.01},
            lambda s: s.plant.set_stiction_tolerance(0.01),
        ),
    ),
    "dart": (({"solver": "pgs"}, {"sweeps": 3, "tolerance": 0.5}, dart_pgs),),
}
"""Of a world with the first changes: the options, and the engine's function that does the same."""

SHOWN: dict[str, Changes] = {
    "pybullet": {"friction_anchor": True},
    "sapien": {"coupling_stiffness": 100.0},
    "ode": {"solver": "quickstep", "contacts": 2},
    "ovphysx": {
        **{name: value for name, value in TOLD["ovphysx"][0].items() if name != "threads"},
        "timestep": 0.004,
        "body_iterations": 40,
        "friction_offset_threshold": 1e-6,
        "friction_correlation_distance": 0.001,
    },
}
"""What only the motion shows, and what the stage says and PhysX may not heed."""


WorldsOf = Callable[[type[Simulator]], Worlds]


def elsewhere(worlds_of: WorldsOf, name: str, changes: Changes) -> World:
    """Of an engine with an interpreter of its own."""
    return worlds_of(getattr(settings_told, name)).load(SCENE, "default", parity=False, **changes)


def here(name: str, changes: Changes) -> closing[Simulator]:
    return closing(loaded(adapter(name), SCENE, "default", **changes))


def told(worlds_of: WorldsOf, name: str, changes: Changes) -> dict[str, Any]:
    """What the engine tells of a world with these changes, by option."""
    if name in HERE:
        with here(name, changes) as simulator:
            return settings_told.tell(simulator)
    numbers = elsewhere(worlds_of, name, changes).process.request("read_back")["told"]
    return json.loads(bytes(map(int, numbers)))


def moves(
    worlds_of: WorldsOf | None, name: str, changes: Changes, also: Callable[[Any], None] = id
) -> str:
    """A sum of all that moves in such a world; `also` is done to it first."""
    if name not in HERE:
        world = elsewhere(worlds_of, name, changes)
        world.follow(Trajectory.holding(0.1, GOAL))
        motion = world.wait(SECONDS, log_period=0.0)
        return hashlib.sha256(motion.bodies.tobytes() + motion.joints.tobytes()).hexdigest()
    sum_ = hashlib.sha256()
    with here(name, changes) as simulator:
        also(simulator)
        simulator.command(GOAL, 0 * GOAL, 0 * GOAL)
        for _ in range(round(SECONDS / simulator.settings.timestep)):
            simulator.step()
            sum_.update(simulator.body_state().tobytes() + simulator.joint_state().tobytes())
    return sum_.hexdigest()


_unchanged: dict[str, str] = {}


def unchanged(worlds_of: WorldsOf | None, name: str, base: Changes) -> str:
    """The sum without the option that a test is about: made once, and again to be the same."""
    world = f"{name} {base}"
    if world not in _unchanged:
        _unchanged[world] = moves(worlds_of, name, base)
        assert moves(worlds_of, name, base) == _unchanged[world]
    return _unchanged[world]


def settings(name: str, changes: Changes) -> dict[str, Any]:
    """By option, in the engine's words."""
    s = changed(adapter(name).profiles["default"], changes, name).to_wire()
    if name == "genesis":
        s["impratio"] = s["impratio"] or (100.0 if s["friction_cone"] == "elliptic" else 1.0)
        s["tolerance"] = s["tolerance"] or (1e-8 if s["precision"] == "64" else 1e-5)
        step = s["timestep"] / s["substeps"]
        s["constraint_timeconst"] = max(s["constraint_timeconst"], 2 * step)
    return s


def same(told: Any, asked: Any) -> bool:
    if asked is None or isinstance(asked, str):
        return str(told).lower() == str(asked).lower()
    return np.allclose(told, asked, rtol=1e-5, atol=0)


@pytest.mark.parametrize("name", TOLD)
def test_the_engine_tells_what_was_asked_for(worlds_of: WorldsOf, name: str) -> None:
    """So many times that it tells each option with two values at least; and it has no others."""
    seen: dict[str, list[Any]] = {}
    for changes in ({}, *TOLD[name], {}):  # what a world was given leaves nothing behind
        wanted = settings(name, changes)
        found = told(worlds_of, name, changes)
        wrong = {k: (wanted[k], value) for k, value in found.items() if not same(value, wanted[k])}
        assert not wrong, changes
        for option in found:
            seen.setdefault(option, []).append(wanted[option])
    assert [option for option, values in seen.items() if len({*map(str, values)}) < 2] == []
    others = {*SHOWN.get(name, {})} | {k for _, changes, _ in SET.get(name, ()) for k in changes}
    options = {field.name for field in fields(adapter(name).profiles["default"])}
    assert options == seen.keys() | others, "an option without a test that it reaches"


@pytest.mark.parametrize(
    ("name", "base", "changes", "set_"),
    [
        pytest.param(name, *case, id=f"{name}-{'-'.join(case[1])}")
        for name, cases in SET.items()
        for case in cases
    ],
)
def test_an_option_does_what_the_engines_own_function_does(
    name: str, base: Changes, changes: Changes, set_: Callable[[Any], None]
) -> None:
    by_option = moves(None, name, {**base, **changes})
    assert by_option != unchanged(None, name, base)
    assert by_option == moves(None, name, base, set_)


@pytest.mark.parametrize(
    ("name", "option"),
    [pytest.param(name, option, id=f"{name}-{option}") for name in SHOWN for option in SHOWN[name]],
)
def test_an_option_changes_the_motion(worlds_of: WorldsOf, name: str, option: str) -> None:
    without = unchanged(worlds_of, name, {})
    assert moves(worlds_of, name, {option: SHOWN[name][option]}) != without


def test_every_adapter_is_here() -> None:
    assert {*TOLD} == {*ADAPTERS}
