"""Real tosses: the measure on closed forms, and what engines make of a free flight and a toss."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pytest_simbench.data import Toss, Tosses
from pytest_simbench.data.tosses import EDGE, RATE
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.records.record import Record
from pytest_simbench.records.tuned_on import Seen
from pytest_simbench.scene import STANDARD_GRAVITY, FloatArray, SceneError
from pytest_simbench.tasks import Jitter, Tossing
from pytest_simbench.tasks.tossing import off
from tests.conftest import case_of, measured
from tests.tasks.scripted import perform

SPIN = np.array([3.0, -7.0, 5.0])
"""[rad/s], in the body and, since all of a cube's moments are equal, in the world."""


def flight(rows: int = 30) -> FloatArray:
    """A cube that flies and spins freely, turned at the start: the closed form, (rows, 13)."""
    time = np.arange(rows) / RATE
    turn = Rotation.from_rotvec([0.4, -0.3, 1.1]) * Rotation.from_rotvec(time[:, None] * SPIN)
    state = np.zeros((rows, 13))
    state[:, 0], state[:, 1] = 1.0 * time, -0.5 * time
    state[:, 2] = 0.5 + STANDARD_GRAVITY[2] * time**2 / 2
    state[:, 3:7] = turn.as_quat(scalar_first=True)
    state[:, 7:10] = np.stack([0 * time + 1.0, 0 * time - 0.5, STANDARD_GRAVITY[2] * time], axis=1)
    state[:, 10:13] = SPIN
    return state


FLIGHTS = Tosses((Toss(1, flight()), Toss(2, flight(20)), Toss(3, flight(25))))


def test_a_motion_that_is_the_real_one_is_not_off_and_one_beside_it_by_as_much() -> None:
    toss = Toss(1, flight())
    for shift, turn in ((0.0, 0.0), (0.02, 0.3)):
        states = toss.state.copy()
        states[:, 1] += shift
        turned = Rotation.from_quat(states[:, 3:7], scalar_first=True)
        turned = turned * Rotation.from_rotvec([0.0, turn, 0.0])
        states[:, 3:7] = -turned.as_quat(scalar_first=True)  # the same turn
        distance, angle = off(toss, toss.time, states)
        assert distance == pytest.approx(np.full(30, shift), abs=1e-12)
        assert angle == pytest.approx(np.full(30, turn), abs=1e-7)


def test_what_is_no_choice_of_tosses_is_refused() -> None:
    for wrong, told in (
        ({"half": "both"}, "the half of cube_tosses is 'both'; choose from held_out, chosen_on"),
        ({"most": -1}, "`most` of cube_tosses is -1; it must be a number from 1"),
        ({"most": 2.5}, "`most` of cube_tosses is 2.5; it must be a whole number"),
    ):
        with pytest.raises(SceneError, match=told):
            Tossing(FLIGHTS, **wrong)  # type: ignore[arg-type]


def test_samples_are_taken_between_steps_and_the_last_state_holds() -> None:
    toss = Toss(1, flight())
    fine = np.linspace(0.0, toss.duration - 0.001, 400)
    states = np.zeros((400, 7))
    states[:, 0] = fine
    states[:, 3] = 1.0
    reference = replace(toss, state=np.hstack([np.zeros((30, 3)), [[1, 0, 0, 0]] * 30]))
    distance, _ = off(reference, fine, states)
    assert distance[:-1] == pytest.approx(toss.time[:-1])
    assert distance[-1] == pytest.approx(fine[-1])


def test_consecutive_seeds_go_through_the_tosses_of_a_half_once() -> None:
    task = Tossing(FLIGHTS)
    assert task.repetitions == 2
    assert {task.real(seed).index for seed in range(2022, 2024)} == {1, 3}
    assert task.sample(2022) == ("cube_tosses", task.real(2022).index)
    tuning = Tossing(FLIGHTS, half="chosen_on")
    assert tuning.real(2022).index == 2
    assert tuning.smoke() == replace(tuning, most=5)
    assert Tossing(FLIGHTS, most=1).repetitions == 1


def test_the_scene_starts_as_the_toss_did_and_is_not_disturbed() -> None:
    task = Tossing(FLIGHTS)
    toss = task.real(5)
    (box,) = task.scene(5, Jitter()).bodies
    assert box.pose == toss.start
    assert box.linear_velocity == (1.0, -0.5, 0.0)
    assert box.angular_velocity == pytest.approx(tuple(toss.start.rotation() @ SPIN))
    assert (box.inertia() == 8.1e-4).all()


def test_a_cube_that_stays_is_off_by_the_whole_way_and_turn() -> None:
    toss = Tossing(FLIGHTS).real(5)
    gone = np.linalg.norm(toss.state[:, :3] - toss.state[0, :3], axis=1)
    turned = np.linalg.norm(SPIN) * toss.time
    outcome, _ = perform(Tossing(FLIGHTS), seed=5)
    means = 100 * gone.mean() / EDGE, np.degrees(turned.mean())
    assert [*outcome.metrics.values()] == pytest.approx(means)
    assert outcome.details == {"toss": toss.index, "at_end": pytest.approx([gone[-1], turned[-1]])}


def test_records_name_the_tosses_by_their_digest() -> None:
    parameters = Tossing(FLIGHTS).parameters()
    assert parameters["task.tosses"] == FLIGHTS.digest
    assert parameters["task.half"] == "held_out"
    assert parameters["task.friction"] == 0.18
    other = Tossing(Tosses(FLIGHTS.items[:2])).parameters()
    assert other["task.tosses"] != parameters["task.tosses"]


def tossed(case: Case, task: Tossing, numbers: Sequence[int]) -> list[Record]:
    """Repetitions, one after the other as a run does it."""
    with closing(LocalExecutor()) as executor:
        made = [executor.repetition(Experiment(case, task), number).run() for number in numbers]
    for _, error in made:
        assert error is None
    return [record for record, _ in made]


@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
def test_a_free_flight_is_the_closed_form_and_one_worker_serves_all(case: Case, name: str) -> None:
    """Velocities of the data reach the engine in the axes and order that it takes."""
    records = tossed(case_of(case, name), Tossing(FLIGHTS), (1, 2))
    assert [record.reused_worker for record in records] == [False, True]
    for record in records:
        # semi-implicit Euler is too deep by g t timestep / 2: 4 mm after 0.2 s with 1/240 s
        time = FLIGHTS.items[record.details["toss"] - 1].time
        depth = -STANDARD_GRAVITY[2] * time * record.settings["timestep"] / 2
        assert record.metrics["position_error"] == pytest.approx(100 * depth.mean() / EDGE, abs=0.1)
        assert 0 <= record.metrics["rotation_error"] < 0.5
        assert record.notes.sample == ("cube_tosses", record.details["toss"])


@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
def test_real_tosses_end_near_where_they_ended(case: Case, name: str) -> None:
    tosses = measured("cube_tosses")
    real = replace(case_of(case, name), profile="real")
    records = tossed(real, Tossing(tosses), range(1, 13))
    errors = [record.metrics["position_error"] for record in records]
    assert np.mean(errors) < 25.0  # frozen at the start: 274
    assert len({record.details["toss"] for record in records}) == 12
    assert all(record.details["toss"] % 2 for record in records)
    for record in records:
        assert Seen.motions("cube_tosses", 0, 564, 6) in record.notes.chosen_on


def test_without_friction_the_cube_slides_on(case: Case) -> None:
    """The score is of the physics: a wrong coefficient is seen."""
    tosses = measured("cube_tosses")
    good, bad = (
        np.mean([r.metrics["position_error"] for r in tossed(case, task, range(1, 7))])
        for task in (Tossing(tosses), Tossing(tosses, friction=0.0))
    )
    assert bad > good + EDGE * 100  # percent of the edge
