"""Torques that contacts of MuJoCo have of their own, about their normals."""

from __future__ import annotations

from dataclasses import replace

import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.scene import Pose, Scene
from pytest_simbench.testing import scenes


def test_what_brakes_a_spin_is_told() -> None:
    """Euler's law about the vertical: of 0.02 s of a cube that spins on the ground."""
    cube = replace(scenes.cube("cube", Pose.at(0, 0, 0.025)), angular_velocity=(0.0, 0.0, 20.0))
    simulator = MuJoCo(MuJoCo.profiles["tuned"])
    simulator.load(Scene("spin", (cube,)))
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
