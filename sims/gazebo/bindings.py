"""Gazebo's Python modules, whose names carry the version of their library up to release 9."""

from __future__ import annotations

import importlib
import re
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from pytest_simbench.simulator import UnavailableError

RELEASES: dict[str, tuple[str, str, str]] = {
    "8 (Harmonic)": ("gz.math7", "gz.transport13", "gz.sim8"),
    "9 (Ionic)": ("gz.math8", "gz.transport14", "gz.sim9"),
    "10 (Jetty)": ("gz.math", "gz.transport", "gz.sim"),
}
"""Modules of each release of gz-sim, as its and its libraries' python/CMakeLists.txt name them
(read at the tags gz-sim8_8.14.0, gz-sim9_9.5.0, gz-sim10_10.4.0). Those of 10 are 11's too."""

MODULES = tuple("|".join(names) for names in zip(*RELEASES.values(), strict=True))
"""What must be importable, for `SimulatorInfo.modules`."""

LIBRARY = re.compile(r"/libgz-sim\d*\.so\.(\d+\.\d+\.\d+)")
"""File of gz-sim's own library. Its Python package has no metadata that tells a version."""


@dataclass(frozen=True)
class Bindings:
    """The modules of one release: geometry, messages between processes, the simulator."""

    math: ModuleType
    transport: ModuleType
    sim: ModuleType


@cache
def bindings() -> Bindings:
    """Gazebo's modules, of the oldest release that is whole.

    Raises:
        UnavailableError: no release is.
    """
    for names in RELEASES.values():
        if all(map(_there, names)):
            return Bindings(*map(importlib.import_module, names))
    wanted = "; ".join(f"{release}: {', '.join(names)}" for release, names in RELEASES.items())
    raise UnavailableError(
        f"no release of gz-sim has all of its Python modules here; it takes these of one: {wanted}"
    )


def library_version() -> str:
    """Of the gz-sim library that this process has loaded; empty if there is none."""
    for line in Path("/proc/self/maps").read_text("utf-8", "replace").splitlines():
        if found := LIBRARY.search(line):
            return found[1]
    return ""


def _there(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except ImportError:
        return False
