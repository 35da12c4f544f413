"""The capability table: what each simulator is and can do, as the study's Figure 1 showed."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_simbench.ground.text import for_markdown
from pytest_simbench.report.terminal.grid import Column, render
from pytest_simbench.simulator.info import Capability, SimulatorInfo

MARKS: tuple[tuple[str, Capability], ...] = (
    ("window", Capability.WINDOW),
    ("offscreen picture", Capability.OFFSCREEN),
    ("deterministic", Capability.DETERMINISTIC),
    ("save and restore", Capability.SAVE_RESTORE),
    ("restores exactly", Capability.EXACT_RESTORE),
    ("GPU", Capability.GPU),
)
"""Capabilities that get a column; every simulator runs headless."""


def rows(infos: Sequence[SimulatorInfo]) -> dict[str, list[str]]:
    """Cells by heading, one for each simulator."""
    table = {
        "simulator": [info.name for info in infos],
        "engine": [info.engine for info in infos],
        "licence": [info.licence for info in infos],
        "written in": [info.language for info in infos],
        "headless": ["yes" for _ in infos],
    }
    for heading, capability in MARKS:
        table[heading] = ["yes" if capability in info.capabilities else "-" for info in infos]
    table["own environment"] = [_environment(info) for info in infos]
    table["compiles first"] = ["yes" if info.costly_start else "-" for info in infos]
    table["on disk MB"] = [str(info.install_size_mb or "?") for info in infos]
    table["tested versions"] = [info.tested_range for info in infos]
    return table


def _environment(info: SimulatorInfo) -> str:
    return "yes" if info.requirements else "system's Python" if info.system_packages else "-"


def capability_table(infos: Sequence[SimulatorInfo], width: int) -> str:
    """The table for a terminal of `width` columns."""
    texts = ("simulator", "engine", "licence", "written in")
    columns = [
        Column(heading, [[cell] for cell in cells], left=heading in texts)
        for heading, cells in rows(infos).items()
    ]
    return render(columns, width)


def capability_markdown(infos: Sequence[SimulatorInfo]) -> str:
    """The table for a page of documentation."""
    table = rows(infos)
    texts = [list(table), *map(list, zip(*table.values(), strict=True))]
    lines = [[for_markdown(cell, cell=True) for cell in line] for line in texts]
    lines.insert(1, ["---"] * len(table))
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def main() -> None:
    """Print the Markdown table of all registered simulators, for docs/simulators.md."""
    from pytest_simbench.simulator.registry import adapter, registered

    print(capability_markdown([adapter(name).info for name in registered()]))


if __name__ == "__main__":
    main()
