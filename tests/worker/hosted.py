"""Simulators without an engine: one that a server can construct, loaded as
`tests.worker.hosted:Hosted`, and one that takes time, and says how much."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.parity.quantities import expected_quantities
from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.simulator import Deviation, Settings, Simulator, SimulatorInfo

DEVIATION = Deviation("body/*/margin", "has margins")
OF_CYLINDERS = Deviation("body/*/mass", "weighs cylinders by their hulls", only="cylinder")


@dataclass(frozen=True)
class HostedSettings(Settings):
    stiffness: float = 1.0


class Hosted(Simulator):
    """Answers honestly but for what `raises` (an exception of `step`) and `built` (quantities that
    it builds otherwise) say, for all instances.

    Attributes:
        calls: what was asked of any instance.
        touching: what any instance tells of its contacts.
        instances: all that were constructed.
    """

    info: ClassVar[SimulatorInfo] = SimulatorInfo(
        "hosted", "Hosted", "pytest-simbench", ("json",), "", "", "", "", frozenset(),
        deviations=(DEVIATION, OF_CYLINDERS),
        environment={"HOSTED_SET": "ours", "HOSTED_KEPT": "ours"},
    )  # fmt: skip
    profiles: ClassVar[dict[str, Settings]] = {
        "default": HostedSettings(),
        "tuned": HostedSettings(0.004, 2.0),
    }
    calls: ClassVar[list[Any]] = []
    touching: ClassVar[list[Any]] = []
    instances: ClassVar[list[Hosted]] = []
    raises: ClassVar[list[BaseException]] = []
    built: ClassVar[dict[str, Any]] = {}

    def __init__(self, settings: Settings, *, gui: bool = False) -> None:
        super().__init__(settings, gui=gui)
        self.instances.append(self)
        self.steps = 0
        self.pose: FloatArray = np.zeros((0, 7))

    def compile(self, scene: Scene) -> None:
        self.calls.append(("compile", scene.name))

    def load(self, scene: Scene) -> None:
        self.calls.append(("load", scene.name))
        self.scene = scene
        self.pose = np.array([b.pose.as_array() for b in scene.free_bodies]).reshape(-1, 7)

    def read_back(self) -> dict[str, Any]:
        found = {**expected_quantities(self.scene, self.settings), **self.built}
        return {name: value for name, value in found.items() if value is not None}

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        self.calls.append(("command", position.tolist(), velocity.tolist(), effort.tolist()))

    def step(self) -> None:
        for error in self.raises:
            raise error
        self.steps += 1

    @property
    def time(self) -> float:
        return self.steps * self.settings.timestep

    def body_state(self) -> FloatArray:
        return np.hstack([self.pose, np.zeros((len(self.pose), 6))])

    def joint_state(self) -> FloatArray:
        return np.zeros((2, 0))

    def save(self) -> Any:
        return self.steps

    def restore(self, state: Any) -> None:
        self.steps = state

    def contact_count(self) -> int:
        return 7

    def contact_forces(self) -> list[Any]:
        return self.touching

    def render(self, width: int, height: int) -> NDArray[np.uint8]:
        return np.zeros((height, width, 3), np.uint8)

    def refresh_window(self) -> None:
        self.calls.append("picture")

    def close(self) -> None:
        self.calls.append("close")

    def untested(self) -> str:
        return "not tested"


class Lame(Hosted):
    """Its engine is not there."""

    info: ClassVar[SimulatorInfo] = SimulatorInfo(
        "lame", "Lame", "lame", ("json", "no_such_engine"), "pip install lame", "", "", "",
        frozenset(),
    )  # fmt: skip


class Toy(Hosted):
    """Steps of 2 ms, each of which sleeps and burns a processor for a given time [s]; each look at
    its state sleeps, or burns if `burns_looking`.

    Attributes:
        slept, burnt: seconds so far in `step`, as it measured itself.
        looked: number of looks at the state of the bodies.
        commands: what was commanded, position by position.
    """

    info: ClassVar[SimulatorInfo] = SimulatorInfo(
        "toy", "Toy", "toy", (), "", "", "", "", frozenset()
    )

    def __init__(self, sleep: float = 0.0, burn: float = 0.0, look: float = 0.0) -> None:
        super().__init__(Settings(0.002))
        self.sleep, self.burn, self.look = sleep, burn, look
        self.wall = self.burnt = 0.0
        self.looked = self.pictures = 0
        self.burns_looking = False
        self.commands: list[FloatArray] = []
        self.bodies, self.joints = np.zeros((1, 13)), np.zeros((2, 0))

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

    def body_state(self) -> FloatArray:
        self.looked += 1
        if self.look and not self.burns_looking:
            time.sleep(self.look)
        began = time.process_time()
        while self.burns_looking and time.process_time() - began < self.look:
            pass
        return self.bodies

    def joint_state(self) -> FloatArray:
        return self.joints

    def refresh_window(self) -> None:
        self.pictures += 1
        time.sleep(0.01)
