"""What all tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.client.environments import missing
from pytest_simbench.session.case import Case
from pytest_simbench.simulator.registry import adapter, registered
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.registry import adapter

pytest_plugins = ["pytester"]

ADAPTERS = {
    name: entry.value
    for name, entry in registered().items()
    if not adapter(name).info.requirements and not missing(adapter(name).info)
}
"""Adapters of the engines in this environment, as workers name them."""


def able_to(capability: Capability) -> list[str]:
    """Those of `ADAPTERS` that claim the capability."""
    return [name for name in ADAPTERS if capability in adapter(name).info.capabilities]


@pytest.fixture
def case(tmp_path: Path) -> Case:
    """A headless MuJoCo case with short time-outs, its run folder in `tmp_path`."""
    return Case(
        test="tests::test_x[mujoco-headless]",
        simulator="mujoco",
        mode="headless",
        profile="tuned",
        adapter=ADAPTERS["mujoco"],
        folder=tmp_path,
        stall_timeout=20.0,
    )
