"""Interpreters of their own for engines whose packages clash with pytest's or with each other's.

One folder per simulator, a plain virtual environment with the adapter's pinned requirements and
nothing else: the worker's code reaches it from here. `pytest --sim-install NAME` makes it, and it
is found by its place. A marker file, written last, tells a finished environment from half of one
and remembers what was installed. Compiled kernels are kept in its `cache` folder.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import distributions
from importlib.util import find_spec
from pathlib import Path

from pytest_simbench.client.system import SystemPython
from pytest_simbench.simulator.errors import SimulatorError
from pytest_simbench.simulator.info import SimulatorInfo

MARKER = "simbench.json"
VARIABLE = "SIMBENCH_ENVIRONMENTS"


def default_folder() -> Path:
    """Where environments live: $SIMBENCH_ENVIRONMENTS, else a folder of the user's data."""
    given = os.environ.get(VARIABLE)
    if given:
        return Path(given)
    data = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(data) / "pytest-simbench" / "environments"


@dataclass(frozen=True)
class Environment:
    """The environment of one simulator, whether it exists or not.

    Attributes:
        info: of the simulator.
        folder: of this environment.
    """

    info: SimulatorInfo
    folder: Path

    @classmethod
    def of(cls, info: SimulatorInfo, root: Path | None = None) -> Environment:
        return cls(info, (root or default_folder()) / info.name)

    @property
    def python(self) -> Path:
        """Its interpreter."""
        return self.folder / "bin" / "python"

    @property
    def place(self) -> str:
        """Where that is, for `--sims`."""
        return f"in its own environment, {self.folder}"

    @property
    def problem(self) -> str | None:
        """Why it cannot be used, in words that end with what mends it; None when it can."""
        name, command = self.info.name, self.info.install
        if not self.folder.exists():
            return f"{name} needs an environment of its own, which is not there yet: {command}"
        try:
            installed = json.loads((self.folder / MARKER).read_text("utf-8"))["requirements"]
        except (OSError, ValueError, KeyError, TypeError):
            return f"the environment of {name} ({self.folder}) is only half installed: {command}"
        if list(installed) != list(self.info.requirements):
            return (
                f"the environment of {name} ({self.folder}) holds {', '.join(installed)} instead "
                f"of {', '.join(self.info.requirements)}: {command}"
            )
        if not self.python.exists():
            return f"the environment of {name} ({self.folder}) has lost its interpreter: {command}"
        return None

    def version(self) -> str | None:
        """Version of the engine in it."""
        packages = [str(path) for path in self.folder.glob("lib/python*/site-packages")]
        wanted = self.info.distribution.lower().replace("_", "-")
        for found in distributions(path=packages):
            if found.metadata["Name"].lower().replace("_", "-") == wanted:
                return found.version
        return None

    def variables(self) -> dict[str, str]:
        """Environment variables that keep compiled kernels between runs."""
        return cache_variables(self.info.caches, self.folder / "cache")

    def create(self) -> None:
        """Make it anew, showing what pip says.

        Raises:
            SimulatorError: the packages do not install; what is there stays half installed.
        """
        if not self.info.requirements:
            raise SimulatorError(
                f"{self.info.name} needs no environment of its own: {self.info.install}"
            )
        if self.folder.exists():
            shutil.rmtree(self.folder)
        self.folder.parent.mkdir(parents=True, exist_ok=True)
        pip = [str(self.python), "-m", "pip", "install", "--disable-pip-version-check"]
        for command in (
            [sys.executable, "-m", "venv", str(self.folder)],
            [*pip, *self.info.requirements],
        ):
            status = subprocess.run(command, check=False).returncode
            if status:
                raise SimulatorError(
                    f"{' '.join(command)} ended with exit status {status}; the environment of "
                    f"{self.info.name} is only half installed"
                )
        marker = {"requirements": list(self.info.requirements)}
        (self.folder / MARKER).write_text(json.dumps(marker) + "\n", "utf-8")


def cache_variables(caches: Mapping[str, str], folder: Path) -> dict[str, str]:
    """Variables of `SimulatorInfo.caches`, pointing into a folder, unless the user set them."""
    return {
        variable: str(folder / name)
        for variable, name in caches.items()
        if variable not in os.environ
    }


def missing(info: SimulatorInfo) -> str | None:
    """Why an engine can be imported neither here nor where it lives, and what mends it."""
    absent = _absent(info)
    if not absent:
        return None
    other = outside(info)
    if other is not None:
        return other.problem
    return f"{info.name} is not installed (no module {absent[0]}); install it: {info.install}"


def outside(info: SimulatorInfo) -> Environment | SystemPython | None:
    """Where an engine lives that is not for this interpreter; None for one that is.

    An engine of the system's packages may be importable here, where this is the system's Python.
    """
    if info.requirements:
        return Environment.of(info)
    if info.system_packages and _absent(info):
        return SystemPython(info)
    return None


def interpreter(info: SimulatorInfo) -> str | None:
    """The interpreter that an engine lives in, where it is ready; None for this one."""
    other = outside(info)
    return None if other is None or other.problem else str(other.python)


def _absent(info: SimulatorInfo) -> list[str]:
    """The engine's modules that cannot be imported here."""
    return [module for module in info.modules if not _importable(module)]


def _importable(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except (ImportError, ValueError):
        return False
