"""An adapter of a program of its own, `mujoco_program`, upon the base for such adapters.

Loaded by workers as `tests.simulator.outside:Outside`.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from multiprocessing.connection import Client, Connection
from pathlib import Path
from typing import Any, ClassVar

from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.sims.mujoco.settings import MuJoCoSettings

from pytest_simbench.scene import Scene
from pytest_simbench.simulator import Capability, Settings, SimulatorError, SimulatorInfo
from pytest_simbench.simulator.external import ExternalSimulator

PROGRAM = Path(__file__).with_name("mujoco_program.py")


@dataclass(frozen=True)
class OutsideSettings(MuJoCoSettings):
    """Adds `fault`, what the program does wrong; "" for nothing."""

    fault: str = ""


def _asked(name: str) -> Callable[..., Any]:
    """A method that the program answers."""
    return lambda self, *arguments: self._ask(name, *arguments)


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
        self._connection.send((name, *arguments))
        well, answer = self._connection.recv()
        if not well:
            raise SimulatorError(f"{self.info.title} refused ({name}): {answer}")
        return answer

    def _ask(self, name: str, *arguments: Any) -> Any:
        with self.asking(f"asked for {name}"):
            return self._call(name, *arguments)

    read_back = _asked("read_back")
    command = _asked("command")
    push = _asked("push")
    lead = _asked("lead")
    body_state = _asked("body_state")
    joint_state = _asked("joint_state")
    contact_count = _asked("contact_count")
    contact_forces = _asked("contact_forces")
    render = _asked("render")

    def save(self) -> Any:
        return self._steps, self._ask("save")

    def restore(self, state: Any) -> None:
        self._steps, inside = state
        self._ask("restore", inside)
