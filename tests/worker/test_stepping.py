"""The stepping loop on the real MuJoCo."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pytest
from pytest_simbench.sims.mujoco import MuJoCo

from pytest_simbench.robot.panda import panda
from pytest_simbench.scene import Box, Pose, Scene, Trajectory
from pytest_simbench.simulator import DivergedError
from pytest_simbench.worker.stepping import Stepper

CUBE = Box("cube", (0.05, 0.05, 0.05), Pose.at(0.5, 0.0, 0.5, yaw=0.3), mass=0.1)


@pytest.fixture
def stepper() -> Iterator[Stepper]:
    simulator = MuJoCo(MuJoCo.profiles["tuned"])
    simulator.load(Scene("s", (CUBE,), panda()))
    yield Stepper(simulator, lambda at: None)
    simulator.close()


def test_time_and_clocks_advance_together(stepper: Stepper) -> None:
    stepper.wait(0.25, None)
    assert stepper.simulator.time == pytest.approx(0.25)
    assert stepper.clocks.steps == 250
    assert stepper.clocks.simulated == pytest.approx(0.25)
    assert 0 < stepper.clocks.wall < 10
    assert 0 < stepper.clocks.cpu < 10


def test_log_at_its_period(stepper: Stepper) -> None:
    log = stepper.wait(0.1, 0.02)
    assert np.allclose(log["time"], [0.02, 0.04, 0.06, 0.08, 0.10])
    assert log["joints"].shape == (5, 2, 9)
    assert log["bodies"].shape == (5, 1, 13)
    fall = 0.5 - 0.5 * 9.80665 * log["time"] ** 2
    assert np.allclose(log["bodies"][:, 0, 2], fall, atol=0.002)
    assert len(stepper.wait(0.01, 0.0)["time"]) == 10
    assert stepper.wait(0.01, None) == {}


def test_a_trajectory_is_followed_and_its_end_held(stepper: Stepper) -> None:
    start = stepper.simulator.joint_state()[0]
    s = np.linspace(0, 1, 126)[:, None]
    blend = 10 * s**3 - 15 * s**4 + 6 * s**5
    slope = (30 * s**2 - 60 * s**3 + 30 * s**4) / 0.5
    way = np.array([0.3, 0.2, -0.2, 0.3, 0.2, 0.3, 0.4, -0.01, -0.01])
    trajectory = Trajectory(0.004, start + blend * way, slope * way, np.zeros((126, 9)))
    stepper.follow(trajectory, None)
    assert np.abs(stepper.simulator.joint_state()[0] - start - way)[:7].max() < 0.02
    stepper.wait(0.5, None)
    assert np.abs(stepper.simulator.joint_state()[0] - start - way)[:7].max() < 0.02


def test_a_slow_window_takes_at_most_half_of_the_time(
    stepper: Stepper, monkeypatch: pytest.MonkeyPatch
) -> None:
    pictures = []

    def draw() -> None:
        began = time.perf_counter()
        time.sleep(0.05)
        pictures.append(time.perf_counter() - began)

    monkeypatch.setattr(stepper.simulator, "gui", True)
    monkeypatch.setattr(stepper.simulator, "refresh_window", draw)
    began = time.perf_counter()
    for _ in range(4):
        stepper.wait(1.0, None)
    elapsed = time.perf_counter() - began
    assert pictures
    assert sum(pictures) <= elapsed / 2 + pictures[-1]


def test_a_state_that_is_no_number_is_an_error(stepper: Stepper) -> None:
    stepper.simulator.data.qpos[0] = np.nan  # type: ignore[attr-defined]
    with pytest.raises(DivergedError, match=r"joints is not finite at t = .*timestep=0.001"):
        stepper.wait(1.0, None)


def test_save_and_restore_repeat_the_same_future(stepper: Stepper) -> None:
    stepper.wait(0.3, None)
    simulator = stepper.simulator
    saved = simulator.save()
    stepper.wait(0.3, None)
    first = simulator.body_state().copy(), simulator.joint_state().copy()
    simulator.restore(saved)
    stepper.wait(0.3, None)
    assert np.array_equal(first[0], simulator.body_state())
    assert np.array_equal(first[1], simulator.joint_state())
