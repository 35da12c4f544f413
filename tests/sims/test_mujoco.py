"""What only MuJoCo's adapter has to show: bounces, forces of contacts, pictures without driver."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.scene import Box, Cylinder, Pose, Robot, Scene
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.testing import scenes
from pytest_simbench.worker.stepping import Stepper
from sims.mujoco.bounces import LARGEST, damping_ratio, direct, restitution_of

from .worlds import Worlds, loaded, stepped


def left(stiffness: float, damping: float) -> float:
    """Share of its speed with which a mass leaves such a contact: at the end of their force."""
    x, v, dt = 0.0, 1.0, 1e-6
    while stiffness * x + damping * v > 0:
        v -= (stiffness * x + damping * v) * dt
        x += v * dt
    return -v


@pytest.mark.parametrize("restitution", [0.25, 0.6, 0.95])
def test_a_contact_leaves_what_it_is_made_for(restitution: float) -> None:
    stiffness, damping = direct(restitution, 0.002)
    assert left(-stiffness, -damping) == pytest.approx(restitution, abs=1e-3)
    assert restitution_of(damping_ratio(restitution)) == pytest.approx(restitution)


def test_all_and_nothing() -> None:
    assert restitution_of(0.0) == 1.0
    assert damping_ratio(1.0) == pytest.approx(0.0, abs=1e-12)
    assert restitution_of(1.0) == restitution_of(LARGEST) == 0.0
    assert restitution_of(damping_ratio(0.1)) == pytest.approx(0.2079, abs=1e-3)


def test_what_brakes_a_spin_is_told() -> None:
    """Euler's law about the vertical: of 0.02 s of a cube that spins on the ground."""
    cube = replace(scenes.cube("cube", Pose.at(0, 0, 0.025)), angular_velocity=(0.0, 0.0, 20.0))
    simulator = loaded(MuJoCo, Scene("spin", (cube,)))
    spins, torques = [], []
    for _ in range(20):
        simulator.step()
        spins.append(simulator.body_state()[0, 12])
        torques.append(sum(wrench[5] for *_, wrench in simulator.contact_forces()))
    simulator.close()
    braked = cube.inertia()[2] * (spins[-1] - spins[0])
    assert braked < 0
    told = sum(torques[1:]) * MuJoCo.profiles["tuned"].timestep
    assert told == pytest.approx(braked, rel=1e-6)


def test_a_restored_world_tells_what_its_joints_carried() -> None:
    """While its drives brake the arm: as before, but for a step of its way."""
    simulator = loaded(MuJoCo, scenes.arm_alone())
    rest = simulator.joint_state()[0]
    simulator.command(rest + 0.1, 0 * rest, 0 * rest)
    told = stepped(simulator, 0.05).joint_wrenches()
    simulator.restore(simulator.save())
    np.testing.assert_allclose(simulator.joint_wrenches(), told, atol=0.02 * np.abs(told).max())
    simulator.close()


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
def test_a_round_body_has_the_friction_of_the_pair(name: str) -> None:
    """A smooth puck sticks on a rough ground that leans by 0.35."""
    puck = Cylinder("puck", 0.06, 0.03, Pose.at(0, 0, 0.015), 1.0, 0.2)
    scene = Scene("leaning", (puck,), None, (3.2, 0.0, -9.3), 0.5)
    with Worlds(adapter(name)) as worlds:
        world = worlds.load(scene)
        world.wait(0.2)
        assert abs(world.bodies[0, 7]) < 0.02


@pytest.mark.parametrize("name", ["mujoco", "newton"])
def test_both_adapters_import_it_without(name: str) -> None:
    assert adapter(name).info.environment["MUJOCO_GL"] == "disabled"


ARM, SPINNING = (
    scenes.arm_alone().robot,
    replace(scenes.cube("cube", Pose.at(0.9, 0.2, 1.0)), angular_velocity=(1.0, -2.0, 3.0)),
)


@pytest.mark.parametrize(("bodies", "robot"), [((SPINNING,), ARM), ((), ARM), ((SPINNING,), None)])
def test_a_log_of_each_step_is_of_the_states_then(
    bodies: tuple[Box, ...], robot: Robot | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulator, seen = loaded(MuJoCo, scene := Scene("logged", bodies, robot)), []
    step = simulator.step

    def looking() -> None:
        step()
        seen.append((simulator.joint_state(), simulator.body_state()))

    monkeypatch.setattr(simulator, "step", looking)
    log = Stepper(simulator, scene, lambda at: None).wait(0.02, 0.0)
    joints, rows = zip(*seen, strict=True)
    np.testing.assert_allclose(log["joints"], joints, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(log["bodies"], rows, rtol=1e-12, atol=1e-15)
    simulator.close()
