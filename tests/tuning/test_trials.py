"""Looks at candidates: what is hopeless, what fails, and what is not repeated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.client.errors import SceneRefused, Where
from pytest_simbench.laws import LAWS
from pytest_simbench.records.record import Failure
from pytest_simbench.scene.policy import LoopError
from pytest_simbench.tuning.target import FAILED, FIRST_CHOSEN, FIRST_JUDGED, Look, TuningError
from pytest_simbench.tuning.trials import Candidate, least_costs

from .made_up import target, trials


def test_cost_and_error_are_those_of_the_records(tmp_path: Path) -> None:
    looks, executor = trials(tmp_path, lambda s, k: 0.5 if k == 1 else 1.0)
    today = looks.today()
    assert looks.error(today) == pytest.approx(0.125)
    assert today.cost() == pytest.approx(0.005)
    assert executor.asked == [("today", k) for k in (1, 2, 3, 4)]
    seeds = [(r.seed, r.settings["timestep"]) for r in looks.runs.folder.own]
    assert seeds[0] == (300_001, 0.002)


def test_of_what_nothing_is_known_the_worst_is_told(tmp_path: Path) -> None:
    looks, _ = trials(tmp_path, lambda s, k: 1.0)
    assert looks.error(Candidate("trial1", {})) == FAILED


def test_of_several_looks_at_a_law_the_least_cost_counts() -> None:
    costs = {Look(LAWS[0], number): cost for number, cost in enumerate((3.0, 1.0, 2.0), 1)}
    assert least_costs(costs) == {Look(LAWS[0]): 1.0}
    assert Candidate("today", {}, costs=costs).cost() == 1.0


def test_others_may_take_four_times_as_long_as_todays_longest(tmp_path: Path) -> None:
    looks, executor = trials(tmp_path, lambda s, k: 1.0)
    end = executor.end
    executor.end = lambda experiment, k: (
        {**end(experiment, k)[0], "seconds": {"total": 9.1 * k}}, None,
    )  # fmt: skip
    looks.today()
    assert looks.timeout == 146.0  # of 9.1, 18.2, 27.3 and 36.4 s


@pytest.mark.parametrize(
    ("name", "half", "seed", "timeout"),
    [("today", "", FIRST_CHOSEN, 7.0), ("converged", "held_out", FIRST_JUDGED, 7.0),
     ("trial1", "", FIRST_CHOSEN, 45.0), ("trial1", "held_out", FIRST_JUDGED, 45.0)],
)  # fmt: skip
def test_how_a_candidate_is_run(
    tmp_path: Path, name: str, half: str, seed: int, timeout: float
) -> None:
    looks, _ = trials(tmp_path, lambda s, k: 1.0)
    looks.case = replace(looks.case, timeout=7.0, changes={"timestep": 0.001, "iterations": 9})
    looks.timeout, variant = 45.0, f"{name}-{half}" if half else name
    assert looks._case(Candidate(name, {"timestep": 0.004}, half)) == replace(
        looks.case, test=f"tune_falling[mujoco-headless-{variant}]", function="tune_falling",
        variant=variant, changes={"timestep": 0.004, "iterations": 9}, seed=seed, timeout=timeout,
    )  # fmt: skip


def test_a_hopeless_candidate_is_stopped(tmp_path: Path) -> None:
    """Dearer than today's, and after a loss it cannot be as right."""
    looks, executor = trials(tmp_path, lambda s, k: 1.0 if s["timestep"] == 0.002 else 0.5)
    today = looks.today()
    worse = looks.choose("trial1", {"timestep": 0.001}, [today])
    assert worse.ended == "hopeless after 1 of 4"
    cheaper = looks.choose("trial2", {"timestep": 0.004}, [today])
    assert (cheaper.ended, looks.error(cheaper)) == ("", 0.5)  # it is on the front
    assert executor.asked.count(("trial2", 4)) == 1


def test_failures_that_today_has_too_end_nothing(tmp_path: Path) -> None:
    looks, _ = trials(tmp_path, lambda s, k: None if k == 2 else 1.0)
    found = looks.choose("trial1", {"timestep": 0.004}, [looks.today()])
    assert (found.ended, looks.error(found)) == ("", 0.25)


def test_a_step_that_divides_no_period_fails_that_candidate_alone(tmp_path: Path) -> None:
    looks, executor = trials(tmp_path, lambda s, k: 1.0)
    today, error = looks.today(), LoopError("no multiple of the time step")
    told = {"status": "failed", "error": Failure("LoopError", str(error), "")}
    executor.end = lambda experiment, number: (told, error)
    assert looks.choose("trial1", {"timestep": 0.003}, [today]).ended == "failed: LoopError"


def test_settings_that_an_adapter_refuses_fail_that_candidate_alone(tmp_path: Path) -> None:
    looks, executor = trials(tmp_path, lambda s, k: 1.0)
    today, error = looks.today(), SceneRefused("no such drive", Where("mujoco", "headless"))
    told = {"status": "failed", "error": Failure("SceneRefused", error.what, "load")}
    executor.end = lambda experiment, number: (told, error)
    found = looks.choose("trial1", {"timestep": 0.003}, [today])
    assert found.ended == "failed: SceneRefused in load"


def test_what_another_one_ended_is_asked_by_itself(tmp_path: Path) -> None:
    looks, executor = trials(tmp_path, lambda s, k: 1.0, jobs=2)
    ended = executor.end

    def end(experiment: Any, number: int) -> tuple[dict[str, Any], None]:
        found, _ = ended(experiment, number)
        first = executor.asked.count(("today", number)) == 1
        return {**found, "status": "interrupted" if number == 1 and first else "ok"}, None

    executor.end = end
    assert [one.number for one in looks.today().records] == [1, 2, 3, 4]
    assert executor.asked.count(("today", 1)) == 2


@pytest.mark.parametrize("jobs", [1, 3, 16])
def test_the_number_of_jobs_changes_nothing(tmp_path: Path, jobs: int) -> None:
    """What is had beyond the look that ends a candidate does not count."""

    def score(settings: Mapping[str, Any], number: int) -> float | None:
        step = settings["timestep"]
        if step == 0.004:
            return None
        return 0.0 if number == 2 and step < 0.002 else 0.5 if number == 3 else 1.0

    looks, executor = trials(tmp_path, score, jobs=jobs)
    today = looks.today()
    dear = looks.choose("trial1", {"timestep": 0.001}, [today])
    bad = looks.choose("trial2", {"timestep": 0.004}, [today])
    assert (dear.ended, looks.error(dear)) == ("hopeless after 2 of 4", 0.5)
    assert (bad.ended, looks.error(bad)) == ("failed: WorkerHung in fall", 1.0)
    assert bad.cost() == float("inf")
    (judged,) = looks.judge(dear, looks=looks.target.judged)
    assert looks.error(judged) == pytest.approx(1.5 / 6)
    assert len(executor.asked) == len({*executor.asked})


def test_what_a_smaller_step_gives_is_right(tmp_path: Path) -> None:
    """Seed by seed; where it fails nothing tells what is right."""

    def score(settings: Mapping[str, Any], number: int) -> float | None:
        return None if settings["timestep"] < 0.0003 and number == 2 else 100 * settings["timestep"]

    of = replace(target(), converged=True)
    looks, executor = trials(tmp_path, score, of)
    today = looks.today()
    assert executor.asked[:4] == [("converged", k) for k in (1, 2, 3, 4)]
    assert looks.error(today) == pytest.approx(0.2 * 7 / 8)
    assert len(today.errors) == 3
    (judged,) = looks.judge(today, looks=of.judged)
    assert looks.error(judged) == pytest.approx(0.2 * 7 / 8)
    assert {("converged-held_out", 6), ("today-held_out", 6)} < {*executor.asked}


@pytest.mark.parametrize(
    ("converged", "score", "why"),
    [
        (False, None, "today's settings cannot be judged: it hangs"),
        (True, None, "8 times as many steps cannot be judged: it hangs"),
        (True, float("nan"), "8 times as many steps cannot be judged: none has a cost"),
    ],
)
def test_what_never_works_cannot_be_judged(
    tmp_path: Path, converged: bool, score: float | None, why: str
) -> None:
    """Where a smaller step has no value each candidate would be right, and the cheapest taken."""
    of, longest = replace(target(), converged=converged), 0.001 if converged else 1.0
    looks, _ = trials(tmp_path, lambda s, k: score if s["timestep"] < longest else 1.0, of)
    with pytest.raises(TuningError, match=why):
        looks.today()
