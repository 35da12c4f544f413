"""Scripted worlds in which cubes fly: a cube that the hand lets go follows a parabola.

It flies on with the velocity of the hand, or as the script changes it, until it touches a cube of
the pyramid or the ground. There it falls straight down and lies, and the cubes that the script
names are pushed away.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pytest_simbench.scene import STANDARD_GRAVITY, FloatArray, Pose
from tests.tasks.scripted import Mishap, ScriptedProcess

GRAVITY = np.array(STANDARD_GRAVITY)

PUSH_TIME = 0.2
"""For which a pushed cube is on its way [s]."""

PROJECTILE = "projectile"


class FlyingProcess(ScriptedProcess):
    """A world in which the thrown cube flies.

    Args:
        pushed: where the cubes end that the thrown one pushes, relative to their places [m].
        late: the fingers open so much after their command [s], never if infinite; before it if
            negative, by a mishap.
        velocity: what becomes of the cube's velocity as it is let go.
        drop: the integrator's error: fall in excess of a parabola [m] per second of flight, as of
            semi-implicit Euler with a step of 2 drop / g.
    """

    def __init__(
        self,
        script: Iterable[Mishap] = (),
        *,
        pushed: Mapping[str, tuple[float, float, float]] | None = None,
        late: float = 0.0,
        velocity: Callable[[FloatArray], FloatArray] = lambda velocity: velocity,
        drop: float = 0.0,
        timestep: float = 0.004,
        scale: float = 1.0,
    ) -> None:
        super().__init__(script, timestep=timestep, scale=scale)
        self.pushed = dict(pushed or {})
        self.late = late
        self.change = velocity
        self.drop = drop
        self.flying: tuple[float, FloatArray, FloatArray] | None = None
        self.landed_at: float | None = None
        self.touched_at: float | None = None
        self._speeds: tuple[FloatArray, FloatArray] | None = None
        self._rates = np.zeros(0)
        self._places: dict[str, Pose] = {}
        self._was: list[tuple[float, FloatArray]] = []

    def do_follow(
        self, tick: float, position: Any, velocity: Any, effort: Any, log_period: float | None
    ) -> dict[str, Any]:
        if self.where.phase == "throw" and self.late > 0:
            position = self._delayed(tick, np.array(position))
        self._speeds = self.time + tick * np.arange(len(position)), velocity
        answer = super().do_follow(tick, position, velocity, effort, log_period)
        self._speeds = None
        return answer

    def _delayed(self, tick: float, position: FloatArray) -> FloatArray:
        rows = len(position) if np.isinf(self.late) else round(self.late / tick)
        fingers = position[:, -2:].copy()
        position[:, -2:] = fingers[0]
        position[rows:, -2:] = fingers[: len(fingers) - rows]
        return position

    def fall(self, name: str) -> None:
        if name != PROJECTILE or self.where.phase != "throw":
            super().fall(name)
            return
        self.throw(name, self.change(self._tool_velocity()))

    def throw(self, name: str, velocity: ArrayLike) -> None:
        """From where it is a cube flies off with `velocity` [m/s], (3,)."""
        velocity = np.asarray(velocity, dtype=float)
        self.flying = self.time, np.array(self.poses[name].position), velocity
        self.velocities[name] = np.concatenate([velocity, np.zeros(3)])

    def _grasp(self) -> None:
        if self.flying is None:  # fingers do not catch what flies on between them
            super()._grasp()

    def fly(self, seconds: float) -> None:
        now = self.time + seconds
        if self.flying is not None:
            began, start, velocity = self.flying
            t = now - began
            place = start + velocity * t + GRAVITY * t * t / 2 - np.array([0, 0, self.drop * t])
            yaw = self.poses[PROJECTILE].yaw
            self.poses[PROJECTILE] = Pose.at(*place, yaw=yaw)
            self.velocities[PROJECTILE] = np.concatenate([velocity + GRAVITY * t, np.zeros(3)])
            touched = self._touched(place)
            if touched or place[2] <= self.half:
                self.flying = None
                self.velocities[PROJECTILE] = np.zeros(6)
                self.landed_at = now
                self.poses[PROJECTILE] = Pose.at(place[0], place[1], self.half, yaw=yaw)
                if touched:
                    self.touched_at = now
                    self.poses[PROJECTILE] = Pose.at(*place, yaw=yaw)
                    self._places = {name: self.poses[name] for name in self.pushed}
        if self.touched_at is not None and self._places:
            share = min(1.0, (now - self.touched_at) / PUSH_TIME)
            for name, offset in self.pushed.items():
                x, y, z = (share * part for part in offset)
                self.poses[name] = self._places[name].translated(x, y, z)
            if share == 1.0:
                self._places = {}
                x, y, _ = self.poses[PROJECTILE].position
                self.poses[PROJECTILE] = Pose.at(x, y, self.half)

    def _touched(self, place: FloatArray) -> bool:
        return any(
            name != PROJECTILE
            and np.abs(np.subtract(pose.position, place)).max() < 2 * self.half + 0.001
            for name, pose in self.poses.items()
        )

    def _command(self, position: FloatArray) -> None:
        if self._speeds is not None:
            times, rows = self._speeds
            self._rates = np.array([np.interp(self.time, times, column) for column in rows.T])
        else:
            self._rates = np.zeros_like(position)
        super()._command(position)

    def _tool_velocity(self) -> FloatArray:
        arm = self.model.arm
        return self.model.tool_velocity(self.position[:arm], self._rates[:arm])

    def _joints(self) -> FloatArray:
        rates = self._rates if len(self._rates) else np.zeros_like(self.position)
        return np.array([self.position, rates])
