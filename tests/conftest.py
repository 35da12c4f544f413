"""What all tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.session.case import Case
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.registry import adapter

pytest_plugins = ["pytester"]

ADAPTERS = {
    "mujoco": "pytest_simbench.sims.mujoco:MuJoCo",
    "pybullet": "pytest_simbench.sims.pybullet:PyBullet",
    "sapien": "pytest_simbench.sims.sapien:SAPIEN",
}


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
