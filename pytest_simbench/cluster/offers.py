"""What a node offers, as names of Dask resources, and whether that is what a run needs.

    simbench               its slots: repetitions that it carries out at once
    simbench==0.1.0+3f...  version of pytest-simbench, and ten digits of its code
    python==3.11           of Python: a task that a test defines travels as code
    mysim==4.0.0           a simulator that is ready there, and the engine's version
    mysim==3.3.7==3.3.7    the same of a release that has an environment of its own there
    display                for windows: its own, or Xvfb

Names are all that Dask keeps, so versions stand in them. The amount of each is the number of slots.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from os import environ
from pathlib import Path

from pytest_simbench import __version__
from pytest_simbench.client.environments import existing, missing, outside
from pytest_simbench.ground.versions import RELEASE, VersionedName
from pytest_simbench.simulator import SimulatorError
from pytest_simbench.simulator.info import SimulatorInfo
from pytest_simbench.simulator.registry import adapter, problem, registered

SLOTS = "simbench"
DISPLAY = "display"
PYTHON = f"python=={sys.version_info.major}.{sys.version_info.minor}"
BESIDE = {"sims", "suites"}  # in a checkout; in the package where that is installed


def _code() -> str:
    """Ten digits of all modules of this package and of the adapters: commits share a version."""
    from pytest_simbench.data.download import digest

    files = {}
    for package in ("pytest_simbench", "pytest_simbench.sims"):
        folder = Path(getattr(find_spec(package), "origin", None) or __file__).parent
        for path in folder.rglob("*.py"):
            within = path.relative_to(folder)
            if BESIDE.isdisjoint(within.parts):
                files[f"{package}/{within.as_posix()}"] = path.read_bytes()
    return digest(files)[:10]


@cache
def plugin() -> str:
    """This package."""
    return f"{SLOTS}=={__version__}+{_code()}"


def here(slots: int, names: Iterable[str] | None = None) -> dict[str, float]:
    """What this machine offers, as Dask resources.

    Args:
        slots: repetitions at once.
        names: simulators to offer; None for all that are ready here, and their releases in
            environments of their own.
    """
    found = [SLOTS, plugin(), PYTHON]
    for name in (*registered(), *_releases()) if names is None else names:
        info = adapter(name).info
        if not (lacks := missing(info)):
            found.append(f"{name}=={_version(info)}")
        elif names is not None:
            raise SimulatorError(f"{name} cannot be offered: {lacks}")
    if environ.get("DISPLAY") or environ.get("WAYLAND_DISPLAY") or shutil.which("Xvfb"):
        found.append(DISPLAY)
    return dict.fromkeys(found, float(slots))


def _releases() -> list[str]:
    """Releases of simulators that have a folder among the environments here."""
    names = [folder.name for folder in existing() if VersionedName.of(folder.name).kind == RELEASE]
    return [name for name in names if not problem(name)]


def _version(info: SimulatorInfo) -> str:
    other = outside(info)
    try:
        return (other.version() if other else version(info.distribution)) or "unknown"
    except PackageNotFoundError:
        return "unknown"


@dataclass(frozen=True)
class Node:
    """A node as the scheduler knows it.

    Attributes:
        address: of this process of it; one that is started again has another.
        slots: repetitions at once.
        versions: of the plugin, of Python and of its simulators, by name; a release by its own
            name, `mysim==3.3.7`.
        display: whether it has one.
    """

    address: str
    name: str
    slots: int
    versions: Mapping[str, str]
    display: bool

    @classmethod
    def of(cls, address: str, name: object, resources: Mapping[str, float]) -> Node | None:
        """The node, or None for a worker of Dask's that is none of ours."""
        if SLOTS not in resources:
            return None
        parts = [offer.rpartition(RELEASE) for offer in sorted(resources) if RELEASE in offer]
        versions = {name: found for name, _, found in parts}
        return cls(address, str(name), int(resources[SLOTS]), versions, DISPLAY in resources)

    @property
    def stranger(self) -> str:
        """Why nothing can be carried out there, in words, or nothing."""
        for what, offer in (("pytest-simbench", plugin()), ("Python", PYTHON)):
            name, _, ours = offer.partition(RELEASE)
            if self.versions.get(name) != ours:
                return f"runs {what} {self.versions.get(name)}, and this is {ours}"
        return ""

    def has(self, simulator: str, mode: str) -> bool:
        """Whether it can carry out repetitions of a simulator in a mode."""
        return not self.stranger and simulator in self.versions and (mode != "gui" or self.display)

    def __str__(self) -> str:
        told = [
            name if RELEASE in name else f"{name} {found}"
            for name, found in self.versions.items()
            if name not in (SLOTS, "python")
        ]
        return f"{self.name} has {', '.join(told + [DISPLAY] * self.display) or 'no simulator'}"


def refusal(nodes: Sequence[Node]) -> str:
    """Why a run cannot begin on these nodes at all, as a sentence, or nothing."""
    if not nodes:
        return "it has no node; start one: simbench cluster node ADDRESS"
    strangers = [f"{node.name} {node.stranger}" for node in nodes if node.stranger]
    if strangers:
        return f"{'; '.join(strangers)}; install the same version and commit on both sides"
    return ""


def unmet(nodes: Sequence[Node], simulator: str, modes: Iterable[str]) -> str | None:
    """Why a simulator cannot run in these modes on any node, with what each has; None if it can."""
    for mode in modes:
        able = [node for node in nodes if node.has(simulator, mode)]
        if not able:
            what = f"{simulator} with a display" if mode == "gui" else simulator
            told = f"no node of the cluster offers {what}: {'; '.join(map(str, nodes))}"
            if RELEASE in simulator and not any(simulator in node.versions for node in nodes):
                told += f"; on one of them: simbench install {simulator}, and start it again"
            return told
        versions: dict[str, list[str]] = {}
        for node in able:
            versions.setdefault(node.versions[simulator], []).append(node.name)
        if len(versions) > 1:
            told = ", ".join(f"{v} ({', '.join(names)})" for v, names in sorted(versions.items()))
            return (
                f"the nodes of the cluster have several versions of {simulator}: {told}; their "
                "results do not belong together, so give the run nodes of one version"
            )
    return None
