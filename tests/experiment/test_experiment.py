"""A task in a case: what all repetitions of a test have in common."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest

from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.protocol import PROTOCOLS
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.simulator.errors import SimulatorError
from pytest_simbench.tasks.base import Jitter
from tests.tiny import Falling


@dataclass(frozen=True)
class Halved(Falling):
    """A task of which the smallest version of the smallest version is a smaller one."""

    def smoke(self) -> Halved:
        return replace(self, duration=self.duration / 2)


def test_the_version_is_chosen_once_whatever_becomes_of_the_case(case: Case) -> None:
    experiment = Experiment(replace(case, protocol=PROTOCOLS["smoke"]), Halved(duration=0.4))
    again = experiment.in_case(attempt=2).in_case(contended=True)
    assert again.task == experiment.task == Halved(duration=0.2)
    record, _ = Repetition(again, 1).run()
    assert record.settings["task.duration"] == 0.2
    assert record.stepping["simulated"] == pytest.approx(0.2)


def test_seeds_count_on_from_the_case_s(case: Case) -> None:
    experiment = Experiment(replace(case, seed=40), Falling())
    assert [experiment.seed(number) for number in (1, 3)] == [40, 42]
    assert experiment.seed() == 40


@pytest.mark.parametrize("scale", [0.0, 0.5, 1.0, 2.0])
def test_the_start_is_disturbed_by_the_case_s_jitter(case: Case, scale: float) -> None:
    experiment = Experiment(replace(case, jitter=scale), Falling())
    one = Jitter()
    expected = Jitter(scale * one.distance, scale * one.angle)
    assert experiment.scene(7) == Falling().scene(7, expected)


def test_the_task_has_its_own_time_out_unless_the_case_gives_one(case: Case) -> None:
    assert Experiment(case, Falling()).timeout == Falling.study_timeout
    experiment = Experiment(replace(case, timeout=5.0, memory_limit=900.0), Falling())
    assert experiment.limits == {"timeout": 5.0, "stall_timeout": 20.0, "memory_limit": 900.0}


def test_a_case_of_a_registered_simulator(case: Case) -> None:
    told = {"test": case.test, "mode": "headless", "profile": "tuned", "folder": case.folder}
    found = Case.of("mujoco", stall_timeout=case.stall_timeout, **told)
    assert replace(found, compile_timeout=0.0) == case
    assert Case.of("mujoco", python="/a/python", **told).python == "/a/python"
    with pytest.raises(SimulatorError, match="mujoco"):
        Case.of("mojuco", **told)
