"""The capability table: what each simulator is and can do, as the study's Figure 1 showed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pytest_simbench.report.model.document import Column
from pytest_simbench.simulator.info import Capability, SimulatorInfo
from pytest_simbench.simulator.registry import adapter, registered

MARKS: tuple[tuple[str, Capability], ...] = (
    ("window", Capability.WINDOW),
    ("offscreen picture", Capability.OFFSCREEN),
    ("deterministic", Capability.DETERMINISTIC),
    ("save and restore", Capability.SAVE_RESTORE),
    ("restores exactly", Capability.EXACT_RESTORE),
    ("GPU", Capability.GPU),
)
"""Capabilities that get a column; every simulator runs headless."""


def columns(infos: Sequence[SimulatorInfo] = ()) -> list[Column]:
    """A row for each simulator; without any, for all that are registered."""
    infos = infos or [adapter(name).info for name in registered()]

    def marks(found: Iterable[object]) -> list[str]:
        return ["yes" if each else "-" for each in found]

    return [
        Column("simulator", [info.name for info in infos], left=True),
        Column("engine", [info.engine for info in infos], left=True),
        Column("licence", [info.licence for info in infos], left=True),
        Column("written in", [info.language for info in infos], left=True),
        Column("headless", marks(infos)),
        *(
            Column(heading, marks(capability in info.capabilities for info in infos))
            for heading, capability in MARKS
        ),
        Column("own environment", map(_environment, infos)),
        Column("compiles first", marks(info.costly_start for info in infos)),
        Column("on disk MB", [str(info.install_size_mb or "?") for info in infos]),
        Column("tested versions", [info.tested_range for info in infos]),
    ]


def _environment(info: SimulatorInfo) -> str:
    return "yes" if info.requirements else "system's Python" if info.system_packages else "-"
