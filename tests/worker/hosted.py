"""An adapter that a server can construct: one cube that never moves, and a diary of its calls.

Loaded as `tests.worker.hosted:Hosted`.
"""

from __future__ import annotations

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
