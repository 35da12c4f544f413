"""Engines that come as packages of the operating system: they live in the system's Python.

Debian and Ubuntu build a Python module for one interpreter, `/usr/bin/python3`. Its minor version
may be another than ours, and pytest need not be there: a worker needs the engine, numpy and the
standard library.
"""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

from pytest_simbench.simulator.info import SimulatorInfo, no_module

OLDEST = (3, 11)
"""Of Python, for the rooms that a worker runs: `requires-python` in pyproject.toml."""

TIMEOUT = 30.0
"""For an interpreter to look round, on a busy machine [s]."""

PROBE = """
import sys
sys.path[:] = [entry for entry in sys.path if entry]  # nor does a worker look where it stands
import importlib.metadata, importlib.util, json
distribution, *modules = sys.argv[1:]
try:
    version = importlib.metadata.version(distribution)
except importlib.metadata.PackageNotFoundError:
    version = None
def there(name):
    try:
        return importlib.util.find_spec(name) is not None
    except ImportError:  # of a package that is not there
        return False
absent = [names for names in modules if not any(map(there, names.split("|")))]
print(json.dumps({"python": sys.version_info[:3], "version": version, "absent": absent}))
"""
"""What an interpreter is asked. It imports no engine."""


@dataclass(frozen=True)
class SystemPython:
    """The system's Python as the home of one simulator, whether it can be that or not."""

    info: SimulatorInfo
    python: ClassVar[Path] = Path("/usr/bin/python3")

    @property
    def place(self) -> str:
        """Where that is, for `simbench list`."""
        return f"in the system's Python, {self.python}"

    @property
    def problem(self) -> str | None:
        """Why it cannot be used, in words that end with what mends it; None when it can."""
        info, other = self.info, f"; or name another: --sim-python {self.info.name}=PATH"
        found = self._found()
        if found is None:
            return f"{info.name} needs the system's Python, and {self.python} does not run{other}"
        python = ".".join(map(str, found["python"]))
        if tuple(found["python"]) < OLDEST:
            return (
                f"{info.name} runs in the system's Python, and {self.python} is Python {python}, "
                f"older than {'.'.join(map(str, OLDEST))}{other}"
            )
        if found["absent"]:
            return (
                f"{info.name} comes with packages of the system, and {self.python} has no module "
                f"{no_module(found['absent'])}; on Debian and Ubuntu: {info.install}{other}"
            )
        return None

    def version(self) -> str | None:
        """Version of the engine's Python package in it."""
        found = self._found()
        return found["version"] if found else None

    def _found(self) -> dict[str, Any] | None:
        return look_into(str(self.python), self.info.distribution, ("numpy", *self.info.modules))


@cache
def look_into(python: str, distribution: str, modules: tuple[str, ...]) -> dict[str, Any] | None:
    """What an interpreter says of an engine: its Python, the engine's version, absent modules.

    None where there is no interpreter that answers.
    """
    command = [python, "-c", PROBE, distribution, *modules]
    try:
        answer = subprocess.run(command, capture_output=True, timeout=TIMEOUT, check=True).stdout
        found: dict[str, Any] = json.loads(answer)
        return found
    except (OSError, subprocess.SubprocessError, ValueError):
        return None
