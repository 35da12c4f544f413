"""What an engine does while a world is stepped, and must not: a repetition is watched.

- It is asked again what it holds, at steps drawn after loading and at the end; what lasts must be
  what it told when the world was loaded (`parity.compare`).
- What flies free accelerates as gravity has it.
- Nothing jumps: bodies and joints (but those of a user's file) move no farther than their speeds
  explain.

All of it happens where the stepping looks at the state anyway, outside of its clocks.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.description.links import link_poses
from pytest_simbench.description.shapes import DIRECTIONS, OUTLINES
from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.parity.compare import Lasting
from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.scene.overlap import rotations
from pytest_simbench.scene.plausibility import implausible
from pytest_simbench.simulator import DivergedError, ParityError, Simulator
from pytest_simbench.worker.state import checked_quantities

WINDOW, GROWTH = 1.0, 4
"""One step is drawn in the first `WINDOW` of simulated time [s], and one in each time span that
ends `GROWTH` times as late: four in the first minute. How long a task takes nobody knows before."""

GLIMPSE = 0.01
"""Simulated time in which the acceleration of what flies is measured [s]: in a single step of
0.1 ms single precision would be off by 0.6 m/s^2."""

FLYING = 0.6
"""A body that is slower is not looked at for free flight [m/s]: arms carry them so fast, and where
their links are takes 0.5 ms."""

CLEAR = 0.01
"""What flies free is at least so far from everything else [m], and twice as far as it moves in a
`GLIMPSE`."""

GRAVITY_TOLERANCE = 0.05
"""Share of gravity by which the acceleration of what flies free may differ."""

SURGE, JOINT_SURGE = 0.5, 5.0
"""Between two looks a body may be faster than anything at either by `SURGE` [m/s], a joint than at
either by `JOINT_SURGE` [rad/s, m/s]: pushed and braked again, or moved out of another body."""

NEVER = 1 << 62


@dataclass(frozen=True)
class _Look:
    step: int
    time: float
    joints: FloatArray
    bodies: FloatArray


class Watch:
    """Watches one simulator from loading to the end of its repetition.

    Args:
        expected: the scene's quantities (`parity.quantities`).
        reported: what the engine told of them.
        seed: of the repetition; draws the steps.

    Attributes:
        due: the step, counted since loading, after which it wants to look.
        seconds: wall time of the readings since `spent` was last asked [s].
    """

    def __init__(
        self,
        simulator: Simulator,
        scene: Scene,
        expected: Mapping[str, Any],
        reported: Mapping[str, Any],
        seed: int,
    ) -> None:
        self._simulator, self._title = simulator, simulator.info.title
        declared = [d.with_robot(scene.robot) for d in simulator.info.deviations]
        self._lasting = Lasting(reported, scene, self._title, declared)
        self._step = simulator.settings.timestep
        self._scene = scene
        self._random = np.random.default_rng(seed)
        self._begin, self._end = 0, max(1, round(WINDOW / self._step))
        self._drawn = self._draw()
        self._glimpse, self._ends = max(1, round(GLIMPSE / self._step)), NEVER
        self.seconds = 0.0
        self._last = self._start = _Look(
            0, simulator.time, np.array(simulator.joint_state()), np.array(simulator.body_state())
        )
        self._names = [body.name for body in scene.free_bodies]
        self._joints = () if scene.robot is None else scene.robot.joint_names
        self._led = np.array([body.prescribed for body in scene.free_bodies], dtype=bool)
        pushed = np.array([bool(body.wrenches) for body in scene.free_bodies], dtype=bool)
        # What an engine loads from the user's own file has whatever damping the file says.
        own = [d for d in declared if d.only == "file"]
        damped = [any(d.excuses(f"body/{name}/damping") for d in own) for name in self._names]
        self._free = ~self._led & ~pushed & ~np.array(damped, dtype=bool)
        self._radius = np.array([np.linalg.norm(body.extents) / 2 for body in scene.free_bodies])
        self._damping = np.array(
            [expected.get(f"body/{name}/damping", np.zeros(2))[0] for name in self._names]
        )
        self._gravity = np.asarray(scene.gravity, dtype=float)
        self._obstacles = Obstacles(scene, expected)

    @property
    def due(self) -> int:
        return min(self._drawn, self._ends)

    def _draw(self) -> int:
        return int(self._random.integers(self._begin, self._end)) + 1

    def restored(self, step: int, joints: FloatArray, bodies: FloatArray) -> None:
        """The world was put back to another state: what comes next is no jump."""
        self._last, self._ends = _Look(step, self._simulator.time, joints, bodies), NEVER

    def look(self, step: int, joints: FloatArray, bodies: FloatArray) -> None:
        """Look at the state after a step, counted since loading.

        Raises:
            ParityError: something jumps, falls otherwise than by gravity or changed.
            DivergedError: something is where nothing can be.
        """
        now = _Look(step, self._simulator.time, joints, np.array(bodies))
        before, self._last = self._last, now
        if before.step == step:
            return
        span = (step - before.step) * self._step
        if not (
            np.abs(bodies[:, :3] - before.bodies[:, :3]).max(initial=0.0) <= SURGE * span / 2
            and np.abs(joints[0] - before.joints[0]).max(initial=0.0) <= JOINT_SURGE * span
        ):  # else no speed need be looked at
            pair = np.stack([before.joints, joints]), np.stack([before.bodies, bodies])
            try:
                self._continuous(np.array([span]), *pair, np.array([now.time]))
            except ParityError:
                wrong = implausible(self._scene, bodies)
                if wrong is None:
                    raise
                raise DivergedError(  # who explodes does not cheat
                    f"{wrong}, at t = {now.time:.3f} s; a smaller timestep may help"
                ) from None
        if step >= self._drawn:
            while self._drawn <= step:
                self._begin, self._end = self._end, self._end * GROWTH
                self._drawn = self._draw()
            self.read()
        if step >= self._ends:
            self._flight(now)
        elif self._ends == NEVER and self._clear(now).any():
            self._start, self._ends = now, step + self._glimpse

    def spent(self) -> float:
        """Wall time of the readings since the last call [s]."""
        seconds, self.seconds = self.seconds, 0.0
        return seconds

    def check_log(self, log: Mapping[str, FloatArray]) -> None:
        """The samples of a motion, as `Stepper` gives them: whether anything jumps.

        Raises:
            ParityError: something does.
        """
        if log:
            times = log["time"]
            self._continuous(np.diff(times), log["joints"], log["bodies"], times[1:])

    def read(self) -> None:
        """Ask the engine again what it holds.

        Raises:
            ParityError: something that lasts is another one than when the world was loaded.
        """
        began = time.perf_counter()
        self._lasting.check(checked_quantities(self._simulator), self._simulator.time)
        self.seconds += time.perf_counter() - began

    def _continuous(
        self, spans: FloatArray, joints: FloatArray, bodies: FloatArray, times: FloatArray
    ) -> None:
        """Samples (n + 1, ...), the spans between them, and the later ones' times, (n,) [s]."""
        points = np.linalg.norm(bodies[:, :, 7:10], axis=2)
        speed = points + self._radius * np.linalg.norm(bodies[:, :, 10:], axis=2)
        fastest = speed.max(axis=1, keepdims=True, initial=0.0)  # it may have pushed the others
        moved = np.linalg.norm(np.diff(bodies[:, :, :3], axis=0), axis=2)
        moved[:, self._led] = 0.0
        self._explained(moved, fastest, SURGE, spans, times, "m")
        if self._scene.file:  # its joints may hang free, and swing there and back in a span
            return
        moved = np.abs(np.diff(joints[:, 0], axis=0))
        self._explained(moved, np.abs(joints[:, 1]), JOINT_SURGE, spans, times, "rad or m")

    def _explained(
        self, moved: FloatArray, speed: FloatArray, surge: float, spans: Any, times: Any, unit: str
    ) -> None:
        most = (np.maximum(speed[1:], speed[:-1]) + surge) * spans[:, None]
        for at, row in np.argwhere(~(moved <= most)):
            name = (self._names if unit == "m" else self._joints)[row]
            limit = most[at, min(row, most.shape[1] - 1)]
            raise ParityError(
                f"{self._title} let {name!r} jump: it moved by {moved[at, row]:.3g} {unit} in the "
                f"{spans[at]:.4g} s before t = {times[at]:.3f} s, where the speeds explain "
                f"{limit:.3g} at most"
            )

    def _clear(self, now: _Look) -> NDArray[np.bool_]:
        """Which bodies fly and are far from everything, (n_free,)."""
        speed = np.linalg.norm(now.bodies[:, 7:10], axis=1)
        need = self._radius + CLEAR + 2 * GLIMPSE * speed
        flying: NDArray[np.bool_] = self._free & (speed > FLYING) & (now.bodies[:, 2] > need)
        if flying.any():
            apart = self._obstacles.distances(now.bodies, now.joints[0], np.flatnonzero(flying))
            flying[flying] = apart > need[flying]
        return flying

    def _flight(self, now: _Look) -> None:
        """Whether what flew from the glimpse's start on was accelerated by gravity alone."""
        start, self._ends = self._start, NEVER
        span = (now.step - start.step) * self._step
        velocity = np.stack([start.bodies[:, 7:10], now.bodies[:, 7:10]])
        found = (velocity[1] - velocity[0]) / span
        speed = np.linalg.norm(velocity, axis=2).max(axis=0)
        allowed = GRAVITY_TOLERANCE * max(1.0, float(np.linalg.norm(self._gravity)))
        allowed = allowed + 2 * self._damping * speed * (1 + speed) + 1e-6 * (1 + speed) / span
        off = np.linalg.norm(found - self._gravity, axis=1)
        wrong = ~(off <= allowed)
        if wrong.any():  # what was clear in between may touch something now
            wrong &= self._clear(start) & self._clear(now)
        for row in np.flatnonzero(wrong):
            raise ParityError(
                f"{self._title} accelerated {self._names[row]!r} by {_vector(found[row])} m/s^2 at "
                f"t = {now.time:.3f} s, where it flew free and gravity is "
                f"{_vector(self._gravity)} m/s^2"
            )


class Obstacles:
    """Boxes around all that a body can touch, but for the ground: from the outlines of a scene's
    quantities."""

    def __init__(self, scene: Scene, expected: Mapping[str, Any]) -> None:
        self._robot = None if scene.robot is None else PreparedRobot(scene.robot)
        self._fixed = np.array([body.pose.as_array() for body in scene.fixed_bodies]).reshape(-1, 7)
        names = [f"body/{body.name}" for body in (*scene.free_bodies, *scene.fixed_bodies)]
        names += [] if self._robot is None else [f"link/{name}" for name in self._robot.links]
        self._boxes = np.array([_around(expected, name) for name in names])

    def distances(self, bodies: FloatArray, joints: FloatArray, rows: Any) -> FloatArray:
        """How far the centres of some bodies are from the nearest box that is not theirs [m].

        Args:
            bodies: states of the free bodies, (n_free, 13).
            joints: positions of the robot's joints, (n_joints,).
            rows: of those bodies, (n,).
        """
        frames = [bodies[:, :7], self._fixed]
        if self._robot is not None:
            poses = link_poses(self._robot, joints)
            frames.append(np.array([poses[name].as_array() for name in self._robot.links]))
        at = np.concatenate(frames)
        local = np.einsum("nij,nki->nkj", rotations(at[:, 3:]), bodies[rows, :3] - at[:, None, :3])
        low, high = self._boxes[:, 0, None], self._boxes[:, 1, None]
        outside = np.maximum(np.maximum(low - local, local - high), 0.0)
        apart = np.linalg.norm(outside, axis=2)
        apart[rows, np.arange(len(rows))] = np.inf
        return np.asarray(apart.min(axis=0))


def _around(expected: Mapping[str, Any], prefix: str) -> FloatArray:
    """The box around the shapes of a body or link in its frame: its ends, (2, 3) [m].

    Of a link without shapes: nowhere.
    """
    reaches = np.concatenate([expected[f"{prefix}/{kind}"] for kind in OUTLINES])
    most = reaches.max(axis=0, initial=-np.inf)
    return np.array([-most[_SIDES[0]], most[_SIDES[1]]])


_SIDES = [[int(np.argmax(DIRECTIONS @ (sign * axis))) for axis in np.eye(3)] for sign in (-1, 1)]
"""Which of `DIRECTIONS` are those of the axes: against them, along them."""


def _vector(values: FloatArray) -> str:
    return "(" + ", ".join(f"{value:.3g}" for value in values) + ")"
