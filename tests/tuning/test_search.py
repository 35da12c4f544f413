"""The search, with made-up repetitions."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.records.folder import RECORDS
from pytest_simbench.scene.policy import Policy, Rhythm
from pytest_simbench.simulator.registry import adapter, address
from pytest_simbench.tasks import Reaching
from pytest_simbench.tuning.search import Search, front, space_of
from pytest_simbench.tuning.target import FAILED, Look, TuningError
from pytest_simbench.tuning.trials import Candidate

from .made_up import Score, Scored, trials

BASE = adapter("mujoco").profiles["default"]


def score(settings: Any, number: int) -> float:
    """Right up to 4 ms with the elliptic cone, and never with the pyramid."""
    return float(settings["timestep"] <= 0.004 and settings["cone"] == "elliptic")


def search(
    folder: Path, score: Score = score, seed: int = 1, over: str = "timestep cone"
) -> tuple[Search, Scored]:
    looks, executor = trials(folder, score)
    space = space_of(BASE, over.split(), "mujoco")
    return Search(looks, BASE, space, seed, lambda one, best: None), executor


def test_it_finds_the_cheapest_that_is_right(tmp_path: Path) -> None:
    pytest.importorskip("optuna")
    for seed in (1, 2, 3):
        one, _ = search(tmp_path / str(seed), seed=seed)
        best = front(one.run(1e9, 40), one.trials)
        right = [c for c in best if one.trials.error(c) == 0]
        assert right[0].changes["cone"] == "elliptic"
        assert 0.0032 < right[0].changes["timestep"] <= 0.004
        assert [c.cost() for c in best] == sorted(c.cost() for c in best)


def test_it_goes_on_as_if_it_had_not_been_interrupted(tmp_path: Path) -> None:
    pytest.importorskip("optuna")
    whole, _ = search(tmp_path / "whole")
    wanted = [dict(c.changes) for c in whole.run(1e9, 12)]

    def stops(settings: Any, number: int) -> float:
        if len(first.asked) > 17:
            raise KeyboardInterrupt
        return score(settings, number)

    part, first = search(tmp_path / "part", stops)
    with pytest.raises(KeyboardInterrupt):
        part.run(1e9, 12)
    part.trials.runs.folder.close()
    elsewhere = tmp_path / "elsewhere"  # what else the folder may hold is neither read nor written
    elsewhere.mkdir()
    for name in {path.name for path in (tmp_path / "part").iterdir()} - {RECORDS}:
        (elsewhere / name).write_text("torn")
        (tmp_path / "part" / name).unlink(missing_ok=True)
        (tmp_path / "part" / name).symlink_to(elsewhere / name)
    rest, second = search(tmp_path / "part")
    assert [dict(c.changes) for c in rest.run(1e9, 12)] == wanted
    kept = first.asked[:-1]  # the last one was under way
    assert not {*kept} & {*second.asked}
    assert {path.read_text() for path in elsewhere.iterdir()} == {"torn"}


def test_one_setting_may_be_searched_alone(tmp_path: Path) -> None:
    """One of few values ends when all were tried."""
    pytest.importorskip("optuna")
    assert len(search(tmp_path / "a", over="cone")[0].run(1e9)) == 2
    assert len(search(tmp_path / "c", over="noslip_iterations")[0].run(1e9)) == 21
    assert len(search(tmp_path / "b", over="timestep")[0].run(1e9, 12)) > 8


def test_todays_own_step_is_no_candidate_beside_it(tmp_path: Path) -> None:
    """Values have four digits, and 1/240 s has more."""
    pytest.importorskip("optuna")
    base = adapter("pybullet").profiles["default"]
    looks, executor = trials(tmp_path, lambda s, k: 1.0)
    looks.case = replace(looks.case, simulator="pybullet", adapter=address("pybullet") or "")
    one = Search(looks, base, space_of(base, ["timestep"], "pybullet"), 1, lambda one, best: None)
    one.run(1e9, 2)
    assert {variant for variant, _ in executor.asked} == {"today", "trial1"}


@pytest.mark.parametrize("rhythm", [Rhythm(Policy.rate), Rhythm(40.0, 0.01), Rhythm(60.0, 1 / 90)])
def test_steps_for_a_policy_divide_its_period_and_latency(tmp_path: Path, rhythm: Rhythm) -> None:
    """The task's, where it says them; else the policy's."""
    pytest.importorskip("optuna")
    one, _ = search(tmp_path, over="timestep")
    said = {name: value for name, value in vars(rhythm).items() if value != Policy.rate}
    looks = (Look(Reaching(lambda seen: None, **said), 1),)
    one.trials.target = replace(one.trials.target, chosen=looks)
    steps = [found.changes["timestep"] for found in one.run(1e9, 8)[1:]]
    assert all(map(rhythm.steps, steps))


def test_a_setting_that_does_not_act_is_not_asked_for(tmp_path: Path) -> None:
    pytest.importorskip("optuna")
    base = adapter("drake").profiles["default"]
    looks, _ = trials(tmp_path, lambda s, k: 1.0)
    space = space_of(base, None, "drake")
    one = Search(looks, base, space, 1, lambda one, best: None)
    study = one._study(__import__("optuna"))
    for _ in range(6):
        asked = one._suggested(study.ask())
        assert ("relaxation_time" in asked) == (asked["approximation"] == "sap")
        assert ("stiction_tolerance" in asked) == (asked["approximation"] != "sap")


def test_a_range_may_begin_at_zero(tmp_path: Path) -> None:
    optuna = pytest.importorskip("optuna")
    base = adapter("drake").profiles["tuned"]
    (at,) = space_of(base, ["near_rigid_threshold"], "drake")
    one = Search(trials(tmp_path, score)[0], base, [at], 1, lambda one, best: None)
    assert one._one(optuna.trial.FixedTrial({at.name: 0.0}), at) == 0.0 == at.over.low


def test_what_lies_outside_of_its_range_hides_no_other(tmp_path: Path) -> None:
    one, _ = search(tmp_path)
    one.base = replace(BASE, timestep=0.1)
    assert [*one._first()] == [{"cone": "pyramidal"}, {"cone": "elliptic"}]


@pytest.mark.parametrize(("jobs", "took"), [(1, 4), (4, 1)])
def test_too_little_time(tmp_path: Path, jobs: int, took: int) -> None:
    pytest.importorskip("optuna")
    one, executor = search(tmp_path)
    executor.jobs = jobs
    with pytest.raises(TuningError, match=f"2 s are too few .* take {took} s; .* for each sim"):
        one.run(2.0)
    assert len(executor.asked) < 4  # of 1 s each
    assert [c.name for c in one.run(2.0, 1)] == ["today"]  # who says how many has the time


def test_without_optuna(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "optuna", None)
    with pytest.raises(TuningError, match=r"pip install 'pytest-simbench\[tune\]'"):
        search(tmp_path)[0].run(1e9, 1)


def test_what_lacks_an_error_on_a_seed_is_on_no_front(tmp_path: Path) -> None:
    looks, _ = trials(tmp_path, score)

    def one(name: str, cost: float, *errors: float) -> Candidate:
        known = dict(zip(looks.target.chosen, errors, strict=True))
        return Candidate(name, {}, errors=known, costs=dict.fromkeys(known, cost))

    whole, lacks = one("whole", 2.0, 0.5, 0.5, 0.5, 0.5), one("lacks", 1.0, 0.0, 0.0, 0.0, FAILED)
    assert front([lacks, whole], looks) == [whole]
    assert front([lacks], looks) == [lacks]
