"""Real impacts: the measure, and what engines make of an impact that has a closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pytest_simbench.data import Impact, Impacts
from pytest_simbench.data.impacts import MOMENT, SCALE, corner
from pytest_simbench.experiment.case import Case
from pytest_simbench.records.record import Record
from pytest_simbench.scene import Box, FloatArray, Pose
from pytest_simbench.tasks import Impacting, Jitter
from pytest_simbench.tasks.impacting import AFTER, GREY, off
from tests.conftest import case_of, measured
from tests.tasks.scripted import perform
from tests.tasks.test_tossing import tossed


def smooth(angle: float, before: FloatArray, restitution: float) -> FloatArray:
    """Velocities after the impact of a corner without friction (Newton's and Poisson's alike)."""
    x, _ = corner(angle)
    impulse = -(1 + restitution) * (before[1] + before[2] * x) / (1 + x * x / MOMENT)
    return before + impulse * np.array([0.0, 1.0, x / MOMENT])


def impact(toss: int = 1, angle: float = 0.65, restitution: float = 0.5) -> Impact:
    before = np.array([-0.5, -1.0, 4.0 if angle > 0 else -4.0])
    place = np.array([0.2, -corner(angle)[1], angle])
    return Impact(toss, 0, place, before, smooth(angle, before, restitution))


MADE_UP = Impacts((impact(1), impact(2), impact(3, angle=-0.6)))


def test_an_error_is_a_speed_of_the_same_energy_and_leaving_the_plane_counts() -> None:
    real = np.array([0.3, 0.8, -9.0])
    state = np.zeros(13)
    state[[7, 9, 11]] = 0.3, 0.8, 9.0
    assert off(state, real) == 0
    state[7] += 0.1
    assert off(state, real) == pytest.approx(0.1)
    for column in (10, 11, 12):
        turned = state.copy()
        turned[7], turned[column] = 0.3, turned[column] + 5.0
        assert off(turned, real) == pytest.approx(5.0 * np.sqrt(MOMENT))
    state[8] = 0.1
    assert off(state, real) == pytest.approx(0.1 * np.sqrt(2))


def test_consecutive_seeds_go_through_the_impacts_of_a_half_once() -> None:
    task = Impacting(MADE_UP)
    assert task.repetitions == 2
    assert {task.sample(seed) for seed in (6, 7)} == {
        ("planar_impacts", 100),
        ("planar_impacts", 300),
    }
    assert Impacting(MADE_UP, half="chosen_on").real(5).toss == 2
    assert task.smoke() == Impacting(MADE_UP, most=5)
    assert task.parameters()["task.impacts"] == MADE_UP.digest


def test_the_scene_is_the_flight_before_the_impact() -> None:
    task = Impacting(MADE_UP, friction=0.2, restitution=0.6)
    scene = task.scene(2, Jitter())
    box, table = scene.bodies
    top, plate = 0.1, Box("table", (1.0, 1.0, 0.1), Pose.at(0, 0, 0.05), 0.0, 0.2, GREY)
    assert table == replace(plate, restitution=0.6)
    assert (box.friction, box.restitution, scene.name) == (0.2, 0.6, "impacting")
    assert (scene.ground_friction, scene.ground_restitution) == (0.2, 0.6)
    corners = np.array([[x, 0.0, z] for x in (-0.03, 0.03) for z in (-0.03, 0.03)])
    low = (corners @ box.pose.rotation().T)[:, 2].min() + box.pose.position[2]
    assert 0.005 < low - top < 0.02
    assert box.pose.rotation() @ [1.0, 0.0, 0.0] == pytest.approx(  # x turns towards z
        [np.cos(task.real(2).flying(0.01)[0][2]), 0.0, np.sin(task.real(2).flying(0.01)[0][2])]
    )
    assert box.linear_velocity == pytest.approx((-0.5, 0.0, -1.0 + 9.81 * 0.01), abs=0.01)
    assert box.angular_velocity == pytest.approx((0.0, -4.0, 0.0))
    assert box.inertia() / box.mass == pytest.approx(MOMENT)


def test_a_square_that_stops_dead_is_off_by_all_of_its_speed() -> None:
    task = Impacting(MADE_UP)
    outcome, _ = perform(task, seed=2)
    lost = np.linalg.norm(task.real(2).left(AFTER) * SCALE)
    share = lost / np.linalg.norm(task.real(2).after * SCALE)
    assert outcome.metrics == pytest.approx({"velocity_error": lost, "relative_error": 100 * share})


def strike(case: Case, task: Impacting) -> list[Record]:
    return tossed(case, task, range(1, task.repetitions + 1))


@pytest.mark.parametrize(("name", "off_by"), [("mujoco", 12.0), ("pybullet", 4.0)])
def test_without_friction_the_impact_is_the_closed_form(
    case: Case, name: str, off_by: float
) -> None:
    real = replace(case_of(case, name), profile="real")
    for record in strike(real, Impacting(MADE_UP, friction=0.0, restitution=0.5)):
        assert record.metrics["relative_error"] < off_by
        assert record.details["aside"] < 1e-6
        number = record.details["impact"]
        real_one = next(item for item in MADE_UP.items if item.number == number)
        assert record.details["real_after"] == pytest.approx(real_one.left(AFTER), abs=0.01)
        error = (np.array(record.details["after"]) - record.details["real_after"]) * SCALE
        off_by_speed = np.linalg.norm(error)
        assert off_by_speed == pytest.approx(record.metrics["velocity_error"])
        share = off_by_speed / np.linalg.norm(real_one.after * SCALE)
        assert record.metrics["relative_error"] == pytest.approx(100 * share)


def test_restitution_is_seen_in_real_impacts(case: Case) -> None:
    impacts, real = measured("planar_impacts"), replace(case_of(case, "pybullet"), profile="real")
    bounces, sticks = (
        np.mean([record.metrics["velocity_error"] for record in strike(real, task)])
        for task in (Impacting(impacts, most=10), Impacting(impacts, most=10, restitution=0.0))
    )
    assert bounces < sticks - 0.1
