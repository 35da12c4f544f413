"""What each simulator is and can do, for docs/simulators.md."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_simbench.report.markdown.run import table
from pytest_simbench.report.model.capabilities import columns
from pytest_simbench.simulator.info import SimulatorInfo
from pytest_simbench.simulator.registry import adapter, registered


def capability_markdown(infos: Sequence[SimulatorInfo]) -> str:
    """The table for a page of documentation."""
    return table(columns(infos))


def all_capabilities() -> str:
    """The table of all registered simulators."""
    return capability_markdown([adapter(name).info for name in registered()])
