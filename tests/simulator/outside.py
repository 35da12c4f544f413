"""An adapter of a program of its own, `mujoco_program`, upon the base for such adapters.

Loaded by workers as `tests.simulator.outside:Outside`.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from multiprocessing.connection import Client, Connection
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.sims.mujoco.settings import MuJoCoSettings

from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.simulator import Capability, Settings, SimulatorError, SimulatorInfo
from pytest_simbench.simulator.external import ExternalSimulator

PROGRAM = Path(__file__).with_name("mujoco_program.py")


@dataclass(frozen=True)
class OutsideSettings(MuJoCoSettings):
    """Adds `fault`, what the program does wrong; "" for nothing."""

    fault: str = ""


class Outside(ExternalSimulator):
    """MuJoCo in a process of its own."""

    info: ClassVar[SimulatorInfo] = replace(
        MuJoCo.info,
        name="outside",
        title="MuJoCo's program",
        capabilities=MuJoCo.info.capabilities - {Capability.WINDOW},
    )
    profiles: ClassVar[Mapping[str, Settings]] = {
        name: OutsideSettings(**asdict(settings)) for name, settings in MuJoCo.profiles.items()
    }
    settings: OutsideSettings
    _connection: Connection | None = None

    def command_line(self) -> Sequence[str]:
        return [sys.executable, str(PROGRAM), str(self.folder / "socket")]

    def variables(self) -> Mapping[str, str]:
        return {"OUTSIDE_FAULT": self.settings.fault}

    def connect(self) -> bool:
        try:
            self._connection = Client(str(self.folder / "socket"))
        except (FileNotFoundError, ConnectionRefusedError):
            return False
        return True

    def build(self, scene: Scene) -> None:
        values = {
            field.name: getattr(self.settings, field.name)
            for field in dataclasses.fields(MuJoCoSettings)
        }
        self._call("build", values, scene.to_wire())

    def make_steps(self, steps: int) -> int:
        return int(self._call("make_steps", steps))

    def ask_to_end(self) -> None:
        if self._connection is not None:
            self._connection.send(("end",))

    def _call(self, name: str, *arguments: Any) -> Any:
        """The program's answer.

        Raises:
            SimulatorError: it raised something.
        """
        assert self._connection is not None
        self._connection.send((name, *arguments))
        well, answer = self._connection.recv()
        if not well:
            raise SimulatorError(f"{self.info.title} refused ({name}): {answer}")
        return answer

    def _ask(self, name: str, *arguments: Any) -> Any:
        with self.asking(f"asked for {name}"):
            return self._call(name, *arguments)

    def read_back(self) -> dict[str, Any]:
        return dict(self._ask("read_back"))

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        self._ask("command", position, velocity, effort)

    def push(self, wrenches: FloatArray) -> None:
        self._ask("push", wrenches)

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        self._ask("lead", before, after)

    def body_state(self) -> FloatArray:
        return np.asarray(self._ask("body_state"))

    def joint_state(self) -> FloatArray:
        return np.asarray(self._ask("joint_state"))

    def save(self) -> Any:
        return self._steps, self._ask("save")

    def restore(self, state: Any) -> None:
        self._steps, inside = state
        self._ask("restore", inside)

    def contact_count(self) -> int:
        return int(self._ask("contact_count"))

    def contact_forces(self) -> Iterable[tuple[str, str, FloatArray]]:
        return list(self._ask("contact_forces"))

    def render(self, width: int, height: int) -> NDArray[np.uint8]:
        return np.asarray(self._ask("render", width, height))
