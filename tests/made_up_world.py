"""A world that is made up: what reads a world is asked here what it reads, without an engine."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from pytest_simbench.client.motion import Motion
from pytest_simbench.scene import FloatArray, Pose, Scene, Trajectory

DT = 0.0107
"""No law ends at 1 s then, where t, t^2 and 1 / t are the same."""


class MadeUp:
    """A world whose bodies and joints swing, drift and turn, each in its own way."""

    def __init__(self, scene: Scene) -> None:
        self.time, self.scene = 0.0, scene

    @property
    def bodies(self) -> FloatArray:
        t, rows = self.time, []
        for k, body in enumerate(self.scene.free_bodies, 1):
            half, far = 0.05 * k * t, 0.004 * k**2 * t
            turn = (math.cos(half), 0.6 * math.sin(half), 0.0, 0.8 * math.sin(half))
            turned = Pose(quaternion=turn) * Pose(quaternion=body.pose.quaternion)
            way = far * np.array([1.0, math.sin(9 * t + k), math.sin(12 * t - k)])
            speeds = np.cos((2 + np.arange(6)) * t + k) - 0.3 * np.arange(6) * t
            rows.append([*(body.pose.position + way), *turned.quaternion, *speeds])
        return np.reshape(rows, (-1, 13))

    @property
    def joints(self) -> FloatArray:
        robot, t = self.scene.robot, self.time
        start = np.zeros(0) if robot is None else robot.column("initial_position")
        angle = 8 * t + np.arange(float(len(start)))
        return np.array([start + 0.5 * np.sin(angle), 4.0 * np.cos(angle) - t])

    def wait(self, duration: float, *, log_period: float | None = None) -> Motion:
        seen = []
        for _ in range(max(1, round(duration / DT))):
            self.time += DT
            seen.append((self.time, self.joints, self.bodies))
        return Motion(*map(np.array, zip(*seen, strict=True)))

    def follow(self, rows: Trajectory, *, log_period: float) -> Motion:
        return self.wait(rows.tick * (len(rows.position) - 1))

    def contact_forces(self) -> dict[tuple[str, str], FloatArray]:
        """None in every third step."""
        if round(self.time / DT) % 3 == 0:
            return {}
        names = ["ground", *(f"body/{body.name}" for body in self.scene.free_bodies)]
        force = np.array([1.0, 2.0, 30.0 + self.time, 4.0, 5.0, 6.0])
        return {(b, a): force * k for k, (a, b) in enumerate(pairwise(names), 1)}

    def joint_wrenches(self) -> FloatArray:
        return np.array([[1.0, -2.0, 3.0, -0.4, 0.5, 0.6 + self.time]])
