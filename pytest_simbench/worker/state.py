"""Is what an adapter returns the state of this scene: right shapes, numbers, units, order?

Looked at when a world is loaded, where everything is where the scene puts it, at each look while
stepping, and after each motion; never in the time that stepping takes. Whatever is wrong is an
error of the adapter and ends the repetition: what was expected, and what came.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.simulator import ParityError, Simulator, StateError
from pytest_simbench.worker.wire import shown

POSITION_TOLERANCE = 1e-3
"""Between scene and engine at the start [m], [rad]: single precision at 10 m is 1e-6."""

ROTATION_TOLERANCE = 1e-4
"""Of the quaternions' inner product from 1: 1.6 degrees."""

NORM_TOLERANCE = 1e-3
"""Of a quaternion's length from 1."""

REST_TOLERANCE = 1e-6
"""Speed of what is at rest at the start [m/s], [rad/s]."""

SPEED_TOLERANCE = 1e-4
"""Share by which the speed of a body at the start may differ from the scene's: as in parity."""

CLOCK_TOLERANCE = 1e-3
"""Share by which a clock may drift, beside half a step: one of single precision does."""

SAMPLED = 1e-9
"""Between a state and the sample of it, relative, and in its units: rounding is 1e-15."""

EXCHANGED = 0.1
"""A joint this far from its set point [rad] may have been taken for another one."""

ALIKE = 0.02
"""Joints that changed places stand this near to each other's set points [rad]."""


@dataclass(frozen=True)
class States:
    """Reads a simulator's clock and states, and lets nothing pass that is none."""

    simulator: Simulator
    scene: Scene

    def time(self) -> float:
        """Simulated [s].

        Raises:
            StateError: no number, or not a finite one.
        """
        time = self.simulator.time
        if isinstance(time, bool) or not isinstance(time, (float, int, np.floating)):
            raise StateError(f"{self._name}: the time must be a float, not {shown(time)}")
        if not math.isfinite(time):
            raise StateError(f"{self._name}: the time must be finite, not {time}")
        return float(time)

    def time_after(self, steps: int, begin: float) -> float:
        """Simulated time after so many steps from `begin` [s].

        Raises:
            StateError: as `time`; or it stood still, ran backwards, or went on by another time
                than that of the steps.
        """
        time, timestep = self.time(), self.simulator.settings.timestep
        passed = steps * timestep
        if abs(time - begin - passed) > timestep / 2 + CLOCK_TOLERANCE * passed:
            raise StateError(
                f"{self._name}: the time must be {begin + passed:.6g} s after {steps} steps of "
                f"{timestep:g} s from {begin:.6g} s on, not {time:.6g} s"
            )
        return time

    def joints(self) -> FloatArray:
        """Positions and velocities, (2, n_joints); errors as `bodies`."""
        count = len(self.scene.robot.joints) if self.scene.robot is not None else 0
        return _checked(self.simulator, "joint_state", (2, count))

    def bodies(self) -> FloatArray:
        """Rows as `Simulator.body_state`, (n_free, 13).

        Raises:
            StateError: a wrong type, shape or kind of number.
        """
        return _checked(self.simulator, "body_state", (len(self.scene.free_bodies), 13))

    def quick(self) -> bool:
        """Whether `Simulator.sample` stands for the states that the adapter tells."""
        simulator = self.simulator
        if vars(simulator).keys() & {"joint_state", "body_state"}:
            return False
        asked = [
            next(cls for cls in type(simulator).__mro__ if name in vars(cls))
            for name in ("sample", "joint_state", "body_state")
        ]
        return all(issubclass(asked[0], other) for other in asked[1:])

    def sampled(self, samples: Sequence[Any]) -> tuple[FloatArray, FloatArray]:
        """Joints (n, 2, n_joints) and bodies (n, n_free, 13) of what `Simulator.sample` gave.

        Raises:
            StateError: a wrong shape; or a sample of now tells another state than `joints` and
                `bodies`.
        """
        logged = self.simulator.sampled([*samples, self.simulator.sample()])
        for found, now, method in zip(
            logged, (self.joints(), self.bodies()), ("joint_state", "body_state"), strict=True
        ):
            if found.shape != (len(samples) + 1, *now.shape) or not np.allclose(
                found[-1], now, rtol=SAMPLED, atol=SAMPLED, equal_nan=True
            ):
                raise StateError(f"{self._name}: sampled() tells another state than {method}()")
        return logged[0][:-1], logged[1][:-1]

    @property
    def _name(self) -> str:
        return self.simulator.info.name


def checked_state(simulator: Simulator, scene: Scene) -> dict[str, Any]:
    """Time, joints and bodies, for an answer.

    Raises:
        StateError: a wrong type, shape or kind of number, or a quaternion that is no rotation.
    """
    states = States(simulator, scene)
    time, joints, bodies = states.time(), states.joints(), states.bodies()
    norms = np.linalg.norm(bodies[:, 3:7], axis=1)
    for body, row, norm in zip(scene.free_bodies, bodies, norms, strict=True):
        if not abs(norm - 1.0) <= NORM_TOLERANCE:
            raise StateError(
                f"{simulator.info.name}: the quaternion of {body.name!r} must have length 1, but "
                f"{_text(row[3:7])} has {norm:.4g}"
            )
    return {"time": time, "joints": joints, "bodies": bodies}


def checked_quantities(simulator: Simulator) -> dict[str, Any]:
    """What the engine says that it built.

    Raises:
        StateError: no dict of numbers by name.
    """
    title, found = f"{simulator.info.name}: read_back()", simulator.read_back()
    if not isinstance(found, dict):
        raise StateError(f"{title} must be a dict of numbers by name, not {shown(found)}")
    for name, value in found.items():
        try:
            np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            raise StateError(f"{title}[{name!r}] must be numbers, not {shown(value)}") from None
    return found


def check_start(simulator: Simulator, scene: Scene) -> None:
    """A loaded world: at time 0, every joint and body where the scene has it and as fast.

    Raises:
        StateError: as `checked_state`; or the rows are in another order than the scene's.
        ParityError: not at time 0 or not as fast as the scene says, as in a worker that served
            others before.
    """
    name, state = simulator.info.name, checked_state(simulator, scene)
    joints, bodies = state["joints"], state["bodies"]
    for what, values in (("joints", joints), ("bodies", bodies)):
        if not np.isfinite(values).all():
            raise StateError(f"{name}: the state of the {what} is not finite after loading")
    led = [body.prescribed for body in scene.free_bodies]  # they begin in the first step
    asked = np.array([body.velocity for body in scene.free_bodies]).reshape(-1, 6)
    asked[led] = bodies[led, 7:]
    wrong = [joints[1], bodies[:, 7:] - asked]
    allowed = [REST_TOLERANCE, REST_TOLERANCE + SPEED_TOLERANCE * np.abs(asked)]
    fastest = max((float(np.abs(values).max()) for values in wrong if values.size), default=0.0)
    slow = all((np.abs(v) < most).all() for v, most in zip(wrong, allowed, strict=True))
    if abs(state["time"]) > 1e-9 or not slow:
        what = "speeds up to" if not asked.any() else "speeds that differ from the scene's by up to"
        how = "at rest" if not asked.any() else "with the scene's speeds"
        raise ParityError(
            f"{name} starts a world at t = {state['time']:g} s with {what} "
            f"{fastest:.3g} (m/s, rad/s); it must start at 0 and {how}"
        )
    if scene.robot is not None:
        names = [joint.name for joint in scene.robot.joints]
        start = scene.robot.column("initial_position")
        _check_places(f"{name}: joint_state()", names, start[:, None], joints[0][:, None])
    names = [body.name for body in scene.free_bodies]
    poses = np.array([body.pose.as_array() for body in scene.free_bodies]).reshape(-1, 7)
    _check_places(f"{name}: body_state()", names, poses[:, :3], bodies[:, :3])
    alike = np.abs(np.sum(poses[:, 3:] * bodies[:, 3:7], axis=1))
    for k in np.flatnonzero(alike < 1.0 - ROTATION_TOLERANCE):
        raise StateError(
            f"{name}: body {names[k]!r} starts with quaternion {_text(bodies[k, 3:7])}, where the "
            f"scene has {_text(poses[k, 3:])} (w, x, y, z)"
        )


def check_following(simulator: Simulator, scene: Scene, joints: FloatArray, goal: Any) -> None:
    """After a motion: no joint stands at the set point of another, that one at the first's.

    What joints do late or badly is the engine's, but they do not change places. At the start some
    positions are alike (a straight arm), so an exchange of these shows only here.

    Raises:
        StateError: they changed places.
    """
    if scene.robot is None:
        return
    reached, asked = joints[0], np.asarray(goal)
    away = np.flatnonzero(np.abs(reached - asked) > EXCHANGED)
    if len(away) < 2 or not np.allclose(
        np.sort(reached[away]), np.sort(asked[away]), rtol=0.0, atol=ALIKE
    ):
        return
    names = ", ".join(scene.robot.joints[k].name for k in away)
    raise StateError(
        f"{simulator.info.name}: the joints {names} stand at each other's set points, "
        f"{_text(reached[away])} where {_text(asked[away])} was commanded: their order is not that "
        "of scene.robot.joints"
    )


def _checked(simulator: Simulator, method: str, shape: tuple[int, ...]) -> FloatArray:
    """A copy of what a method gives, which may be the engine's own array, if it is one of float64
    of this shape."""
    values: Any = getattr(simulator, method)()
    if not isinstance(values, np.ndarray):
        came = f"a {type(values).__name__}"
    elif values.dtype == np.float64 and values.shape == shape:
        return values.copy()
    else:
        came = f"{values.dtype} {values.shape}"
    name = f"{simulator.info.name}: {method}()"
    raise StateError(f"{name} must be an array of float64 {shape}, not {came}")


def _check_places(title: str, names: Sequence[str], asked: FloatArray, came: FloatArray) -> None:
    """Every row where the scene has it; else the message says whose place it stands at."""
    for k, row in enumerate(came):
        if np.abs(row - asked[k]).max() <= POSITION_TOLERANCE:
            continue
        place = f"row {k}, {names[k]!r},"
        at = np.flatnonzero(np.abs(asked - row).max(axis=1) <= POSITION_TOLERANCE)
        hint = (
            f"; that is the place of {names[at[0]]!r}, so the order is another" if len(at) else ""
        )
        raise StateError(
            f"{title} {place} starts at {_text(row)}, where the scene has {_text(asked[k])}{hint}"
        )


def _text(values: Any) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in np.asarray(values, dtype=float)) + ")"
