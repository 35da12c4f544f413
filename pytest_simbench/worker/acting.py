"""What moves a scene's bodies from outside: forces for a time, and motions that are prescribed."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pytest_simbench.scene import Body, FloatArray, Pose, Scene
from pytest_simbench.simulator import Simulator


class Acting:
    """Tells a simulator before each step what acts on the bodies of its loaded scene in that step.

    Raises:
        NotSupportedError: the scene has forces or prescribed bodies, and the simulator takes none.
    """

    def __init__(self, simulator: Simulator, scene: Scene) -> None:
        self.simulator = simulator
        self._wrenches = [body.wrenches for body in scene.free_bodies]
        self._pushes = any(self._wrenches)
        self._led = scene.prescribed_bodies
        self._acts = True
        # Who takes neither says so now. Without force: engines add up what acts before a step.
        if self._pushes:
            simulator.push(np.zeros((len(self._wrenches), 6)))
        self._lead(0.0)

    @classmethod
    def of(cls, simulator: Simulator, scene: Scene) -> Acting | None:
        """None where nothing acts from outside."""
        return cls(simulator, scene) if scene.words & {"wrench", "prescribed"} else None

    def steps(self) -> Callable[[], None]:
        """What to call before each of the coming steps."""
        count = round(self.simulator.time / self.simulator.settings.timestep) - 1
        self._acts = True  # a restored world may have forces of another time

        def act() -> None:
            nonlocal count
            count += 1
            self._act(count)

        return act

    def _act(self, step: int) -> None:
        timestep = self.simulator.settings.timestep
        begin, end = step * timestep, (step + 1) * timestep
        if self._pushes:
            rows = self.wrenches(begin, end)
            acts = bool(rows.any())
            if acts or self._acts:
                self.simulator.push(rows)
            self._acts = acts
        self._lead(begin)

    def _lead(self, begin: float) -> None:
        if self._led:
            end = begin + self.simulator.settings.timestep
            self.simulator.lead(
                np.array([prescribed(body, begin) for body in self._led]),
                np.array([prescribed(body, end) for body in self._led]),
            )

    def wrenches(self, begin: float, end: float) -> FloatArray:
        """Mean force and torque on each free body between two times [s], (n_free, 6)."""
        rows = np.zeros((len(self._wrenches), 6))
        for row, wrenches in zip(rows, self._wrenches, strict=True):
            for wrench in wrenches:
                row += wrench.mean(begin, end)
        return rows


def prescribed(body: Body, time: float) -> FloatArray:
    """State of a body that moves with constant velocities, as a row of body states, (13,)."""
    place = np.asarray(body.pose.position) + time * np.asarray(body.linear_velocity)
    speed = math.hypot(*body.angular_velocity)
    half = speed * time / 2
    axis = np.asarray(body.angular_velocity) / speed if speed else np.zeros(3)
    x, y, z = (float(value) for value in math.sin(half) * axis)
    turned = Pose(quaternion=(math.cos(half), x, y, z)) * Pose(quaternion=body.pose.quaternion)
    return np.array([*place, *turned.quaternion, *body.velocity])
