"""What all tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.session.case import Case

pytest_plugins = ["pytester"]

ADAPTERS = {
    "mujoco": "pytest_simbench.sims.mujoco:MuJoCo",
    "pybullet": "pytest_simbench.sims.pybullet:PyBullet",
    "dart": "pytest_simbench.sims.dart:DART",
}


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
