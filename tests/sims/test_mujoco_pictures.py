"""A headless MuJoCo holds no OpenGL driver in memory until it draws its first picture."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.simulator.registry import adapter

CODE = """
from pytest_simbench.scene import Box, Pose, Scene
from pytest_simbench.sims.mujoco.adapter import MuJoCo

def driver():
    with open("/proc/self/maps") as maps:
        return any(name in line for line in maps for name in ("libEGL", "libGL", "libOSMesa"))

simulator = MuJoCo(MuJoCo.profiles["tuned"])
simulator.load(Scene("one", (Box("cube", (0.05, 0.05, 0.05), Pose.at(0.5, 0, 0.5), mass=0.1),)))
simulator.step()
before = driver()
picture = simulator.render(64, 48)
print(before, driver(), picture.shape, len(set(picture.reshape(-1).tolist())) > 1)
"""


def test_the_driver_comes_with_the_first_picture() -> None:
    environment = {k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "DISPLAY")}
    found = subprocess.run(
        [sys.executable, "-c", CODE],
        env={**environment, **MuJoCo.info.environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert found.stdout.strip() == "False True (48, 64, 3) True", found.stderr


@pytest.mark.parametrize("name", ["mujoco", "newton"])
def test_both_adapters_import_it_without(name: str) -> None:
    assert adapter(name).info.environment["MUJOCO_GL"] == "disabled"
