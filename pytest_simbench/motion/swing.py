"""Finds a swing for the throw of any arm; `[throw]` in the robot's file keeps it.

    simbench swing ur5
    simbench swing my_arm.toml

The arm swings from rest to rest on a straight line in joint space and lets go halfway, where all
joints are fastest (`throw.feasible_swing`). So a swing is a position q and a velocity v of the
joints at the release: it begins at q - v T / 2 and ends at q + v T / 2.

Only the joints move that keep the hand in one upright plane, which the first joint turns towards
the target. A hand that leaves its plane throws aside: fingers take 20 to 40 ms to let go, and a
UR5 that swung about its first joint too sent the cube past the pyramid by 0.4 m. Positions of these
joints are drawn at random; each asks for a velocity of the tool, which the joints make with the
smallest shares of their limits. The first that is free of collisions lands where it should once its
length is adjusted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.optimize import linprog

from pytest_simbench.motion.collision import PlanningScene
from pytest_simbench.motion.errors import PlanningError, RobotError
from pytest_simbench.motion.grasping import grasp_of, grasping
from pytest_simbench.motion.model import RobotModel, grasping_scale_of
from pytest_simbench.motion.registry import find
from pytest_simbench.motion.throw import LANDING_HEIGHT, SPEED_SHARE, feasible_swing, released
from pytest_simbench.scene import STANDARD_GRAVITY, Box, FloatArray, Pose, Robot, Scene

DRAWN = 4000
"""Positions of the joints in the plane that are looked at."""

LOWEST = 0.4
"""Lowest release above the ground [m]. It and the lengths below go with the scene's scale."""

OUTWARDS = 0.0
"""Least cosine between the flight and the way out of the hand: not into the palm."""

ALONG = 0.999
"""Cosine of two axes that are parallel."""

ELEVATIONS = (0.0, 0.2, 0.4)
"""Of the flight as it begins [rad]."""

ACCELERATION_SHARE = 0.5
"""Of the acceleration limits, for the first guess of a swing's length."""

TRIED = 12
"""Swings whose length is adjusted, the easiest ones first; each takes about 2 s."""

LANDING_TOLERANCE = 0.002
"""[m]"""

LANDING = 1.367
"""Where the Panda's throw lands, at the front of the pyramid [m]."""

THROWN = Box("thrown", (0.05, 0.05, 0.05), Pose(), mass=0.1)
"""The study's cube."""


class _Candidate(NamedTuple):
    """A release: joints (arm,), their velocity (arm,), and the largest share of a limit."""

    share: float
    joints: FloatArray
    velocity: FloatArray


def found_swing(
    robot: Robot, held: Box, gravity: FloatArray, landing: float, scale: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """Arm joints before and after a throw that lands at x = `landing`, y = 0, each (arm,) [rad].

    Args:
        robot: with its base; it throws along x.
        held: what it throws.
        gravity: [m/s^2], (3,).
        landing: where the flight crosses `throw.LANDING_HEIGHT` times the scale [m].
        scale: of the scene over the study's.

    Raises:
        RobotError: no such swing was found.
    """
    model = RobotModel(robot)
    planning = PlanningScene(model, Scene("throw", (held,), robot), scale)
    planning.attach(held.name, Pose())
    planning.opening = grasp_of(robot, held.size[1], scale).touching
    candidates = sorted(_candidates(model, gravity, landing, scale), key=lambda c: c.share)
    for candidate in candidates[:TRIED]:
        swing = _adjusted(model, planning, candidate, held, gravity, landing)
        if swing is not None:
            return swing
    raise RobotError(
        f"robot {robot.name!r} cannot throw to x = {landing:g} m: no swing within its limits was "
        "found"
    )


def _candidates(
    model: RobotModel, gravity: FloatArray, landing: float, scale: float
) -> Iterator[_Candidate]:
    """Releases from which the flight lands where it should, within the limits of velocity."""
    limits = model.limits.column("velocity")
    ready, moving = _in_plane(model, landing)
    rng = np.random.default_rng(0)
    for drawn in rng.uniform(model.lower[moving], model.upper[moving], (DRAWN, len(moving))):
        joints = ready.copy()
        joints[moving] = drawn
        tool = model.tool_transform(joints)
        away = np.array([landing, 0.0]) - tool.translation[:2]
        distance, height = float(np.hypot(*away)), float(tool.translation[2])
        if height < LOWEST * scale or away[0] <= 0:
            continue
        plane = np.array([[*(away / distance), 0.0], [0.0, 0.0, 1.0]])
        turned = plane @ tool.rotation @ model.tool_jacobian(joints)[:3, moving]
        for elevation in ELEVATIONS:
            speed = _speed(distance, height - LANDING_HEIGHT * scale, elevation, gravity)
            flight = plane.T @ [np.cos(elevation), np.sin(elevation)]
            if flight @ tool.rotation[:, 2] < OUTWARDS:
                continue
            wanted = speed * (plane @ flight)
            if np.abs(wanted @ turned) @ limits[moving] < speed**2:  # too slow, whatever they do
                continue
            velocity = np.zeros(model.arm)
            velocity[moving] = _easiest(turned, wanted, limits[moving])
            share = float((np.abs(velocity) / limits).max())
            if share < SPEED_SHARE:
                yield _Candidate(share, joints, velocity)


def _in_plane(model: RobotModel, landing: float) -> tuple[FloatArray, list[int]]:
    """The ready position, turned so that the hand's plane goes through the target and the fingers
    open across it; and the joints that move the hand in that plane.

    Raises:
        RobotError: the arm has no such joints.
    """
    name = model.robot.name
    ready = model.home
    tool, axes = model.tool_transform(ready), _axes(model, ready)
    if abs(axes[0, 2]) < ALONG or abs(axes[-1] @ tool.rotation[:, 2]) < ALONG:
        raise RobotError(
            f"robot {name!r}: swings are found for arms whose first joint is upright and whose "
            "last one turns the hand about itself"
        )
    moving = [i for i in range(1, model.arm - 1) if abs(axes[i, 1]) > ALONG]
    if len(moving) < 2:
        raise RobotError(
            f"robot {name!r}: in its ready position no two joints move it along x and z"
        )
    across = tool.rotation[:, :2].T @ np.array([0.0, 1.0, 0.0])  # world y in the tool's x and y
    turn = np.arctan2(-across[0] * np.sign(across[1]), abs(across[1]))
    ready[-1] += np.sign(axes[-1] @ tool.rotation[:, 2]) * turn
    beside = float(tool.translation[1])
    ready[0] -= np.sign(axes[0, 2]) * np.arcsin(beside / (landing - model.base.translation[0]))
    return ready, moving


def _axes(model: RobotModel, arm: FloatArray) -> FloatArray:
    """Axes of the arm's joints in the world, (arm, 3)."""
    pin.computeJointJacobians(model.pin, model.data, model.full(arm))
    columns = model.data.J[3:, : model.arm]
    return np.asarray((model.base.rotation @ columns).T)


def _easiest(jacobian: FloatArray, velocity: FloatArray, limits: FloatArray) -> FloatArray:
    """Joint velocities (n,) that give the tool a velocity in its plane (2,) with the smallest
    largest share of their limits: linear programming in shares and their bound."""
    n = len(limits)
    bounded = np.block([[np.eye(n), -np.ones((n, 1))], [-np.eye(n), -np.ones((n, 1))]])
    found = linprog(
        np.append(np.zeros(n), 1.0),
        A_ub=bounded,
        b_ub=np.zeros(2 * n),
        A_eq=np.hstack([jacobian * limits, np.zeros((2, 1))]),
        b_eq=velocity,
        bounds=[(None, None)] * n + [(0, None)],
    )
    return np.full(n, np.inf) if found.x is None else np.asarray(found.x[:n] * limits)


def _speed(away: float, drop: float, elevation: float, gravity: FloatArray) -> float:
    """Of a flight that goes so far and drops so deep: drop = g t^2 / 2 - v sin(e) t,
    away = v cos(e) t [m/s]."""
    g, rise = -float(gravity[2]), away * np.tan(elevation)
    return float(away / np.cos(elevation) / np.sqrt(2 * (drop + rise) / g))


def _adjusted(
    model: RobotModel,
    planning: PlanningScene,
    release: _Candidate,
    held: Box,
    gravity: FloatArray,
    landing: float,
) -> tuple[FloatArray, FloatArray] | None:
    """Start and end of the swing through a release, as long as it must be to throw so far."""
    acceleration = ACCELERATION_SHARE * model.limits.column("acceleration")
    first = float((np.abs(release.velocity) / acceleration).max())

    def ends(time: float) -> tuple[FloatArray, FloatArray]:
        half = release.velocity * time / 2
        return release.joints - half, release.joints + half

    def lands(time: float) -> float:
        timed, duration = feasible_swing(model, *ends(time), gravity, held)
        throw = released(model, timed, duration, 0.5, planning.scale)
        found = throw.landing(gravity)
        return -np.inf if found is None else found

    def possible(time: float) -> bool:
        path = np.linspace(*ends(time), 60)
        inside = bool(((path > model.lower) & (path < model.upper)).all())
        return inside and planning.first_collision(path, ignored=(held.name,)) is None

    low, high = 0.2 * first, 3.0 * first
    while high > low and not possible(high):
        high *= 0.85
    try:
        if high <= low or not lands(low) < landing < lands(high):
            return None
        for _ in range(12):
            middle = (low + high) / 2
            at = lands(middle)
            if abs(at - landing) < LANDING_TOLERANCE * planning.scale:
                return ends(middle)
            low, high = (middle, high) if at < landing else (low, middle)
    except PlanningError:  # too weak
        return None
    return None


def print_swing(robot: str, landing: float | None = None) -> int:
    """Print the swing of a robot as its file takes it.

    Raises:
        RobotError: there is no such robot, or no swing within its limits.
    """
    arm = find(robot)
    scale = grasping_scale_of(arm)
    size = scale * THROWN.size[0]
    held = replace(THROWN, size=(size,) * 3, mass=THROWN.mass * scale**3)
    at = (LANDING if landing is None else landing) * scale
    gravity = np.array(STANDARD_GRAVITY)
    start, end = found_swing(grasping(arm, size, scale), held, gravity, at, scale)
    print("[throw]")
    for name, joints in (("start", start), ("end", end)):
        print(f"{name} = {[round(float(angle), 4) for angle in joints]}")
    return 0
