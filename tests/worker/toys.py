"""Simulators that do nothing but take time, and say how much."""

from __future__ import annotations

import time
from typing import Any, ClassVar

import numpy as np

from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.simulator import Settings, Simulator, SimulatorInfo

INFO = SimulatorInfo("toy", "Toy", "toy", (), "", "", "", "", frozenset())


class Toy(Simulator):
    """Steps of 2 ms, each of which sleeps and burns a processor for a given time [s].

    Attributes:
        slept, burnt: seconds so far in `step`, as it measured itself.
        looked: number of looks at the state of the bodies.
        commands: what was commanded, position by position.
    """

    info: ClassVar[SimulatorInfo] = INFO
    profiles: ClassVar[dict[str, Settings]] = {"default": Settings(), "tuned": Settings()}

    def __init__(self, sleep: float = 0.0, burn: float = 0.0, look: float = 0.0) -> None:
        super().__init__(Settings(0.002))
        self.sleep, self.burn, self.look = sleep, burn, look
        self.wall = self.burnt = 0.0
        self.steps = self.looked = self.pictures = 0
        self.commands: list[FloatArray] = []
        self.bodies, self.joints = np.zeros((1, 13)), np.zeros((2, 0))

    def load(self, scene: Scene) -> None:
        pass

    def read_back(self) -> dict[str, Any]:
        return {}

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        self.commands.append(np.array([position, velocity, effort]))

    def step(self) -> None:
        began, cpu = time.perf_counter(), time.process_time()
        if self.sleep:
            time.sleep(self.sleep)
        while time.process_time() - cpu < self.burn:
            pass
        self.steps += 1
        self.burnt += time.process_time() - cpu
        self.wall += time.perf_counter() - began

    @property
    def time(self) -> float:
        return self.steps * self.settings.timestep

    def body_state(self) -> FloatArray:
        self.looked += 1
        if self.look:
            time.sleep(self.look)
        return self.bodies

    def joint_state(self) -> FloatArray:
        return self.joints

    def refresh_window(self) -> None:
        self.pictures += 1
        time.sleep(0.01)

    def close(self) -> None:
        pass
