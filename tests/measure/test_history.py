"""Histories of records, and the bisection: pure functions of what was planted."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_simbench.measure.bisection import between, first_worse, like_the_bad_one, steps
from pytest_simbench.measure.gate import run_gate
from pytest_simbench.measure.history import histories
from pytest_simbench.measure.limits import parse_limits
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.measure.speed import compared
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import side_by_side
from tests.records.build import METRICS, failed, record

PLACED = METRICS[0]


def release(version: str, placed: float, *, ram: float = 160.0, n: int = 8) -> list[Record]:
    """Repetitions of a release with that share of cubes, give or take one of 15."""
    name = f"engine=={version}"
    return [
        record(
            k,
            simulator=name,
            test=f"test_stacking[{name}-headless]",
            versions={"engine": version},
            metrics={"placed": placed - (k % 2) / 15},
            resources={"rss_mb": {"mean": 100.0, "std": 1.0, "peak": ram + k % 3}},
        )
        for k in range(n)
    ]


def test_what_changed_with_which_release() -> None:
    found = [*release("1.10", 0.6, ram=160), *release("1.2", 1.0), *release("1.9", 1.0),
             *release("1.11", 0.6, ram=200), *release("1.8.1", 1.0)]  # fmt: skip
    (history,) = histories(found, {"stacking": METRICS})
    assert history.releases == ("1.2", "1.8.1", "1.9", "1.10", "1.11")
    assert (history.simulator, history.task, history.variant) == (
        "engine", "stacking", "headless tuned",
    )  # fmt: skip
    told = history.sentences()
    assert any(t.startswith("placed fell with 1.10: 96.67 % -> 56.67 %, p = 0.0") for t in told)
    assert any(t.startswith("peak RAM rose with 1.11: 161 MB -> 201 MB") for t in told)
    assert len(told) == 2


def test_each_task_of_a_test_has_a_history_of_its_own() -> None:
    found = [
        replace(r, settings={**r.settings, "task.levels": levels})
        for levels, last in ((3, 0.6), (5, 1.0))
        for version, placed in (("1", 1.0), ("2", 1.0), ("3", last), ("4", last))
        for r in release(version, placed)
    ]
    for place in range(-8, 0):  # of the last release, which never starts
        died = replace(found[place], settings={"task.levels": 5}, status="failed", versions={})
        found[place] = replace(died, error=failed(0).error)
    told = {h.variant: h.sentences()[-1][:21] for h in histories(found, {"stacking": METRICS})}
    assert told == {
        "headless tuned task.levels=3": "placed fell with 3: 9",
        "headless tuned task.levels=5": "4: 8 of 8 repetitions",
    }


def test_what_grows_a_little_with_each_release_is_held_against_the_last_one_told() -> None:
    """By 8 %, and by 0.6 mm for certain; what falls again a little is not told."""
    found = [
        replace(r, metrics={"landing_error": error}).noting(sole=True)
        for version, ram, error in (("1", 1000, 0.01), ("2", 1080, 0.0106), ("3", 1166, 0.0112),
                                    ("4", 1100, 0.0108))
        for r in release(version, 1.0, ram=ram, n=12)
    ]  # fmt: skip
    (history,) = histories(found, {"stacking": METRICS})
    told = history.sentences()
    assert told[0] == "landing error rose with 3: 0.01 m -> 0.0112 m, every repetition is the same"
    assert told[1].startswith("peak RAM rose with 3: 1001 MB -> 1167 MB, p = ")
    assert len(told) == 2


@pytest.mark.parametrize(
    ("more", "tiny", "told"),
    [(10, 0.0, "only small changes of peak RAM are"), (0, 1e-7, "no change is")],
)
def test_what_the_machine_or_rounding_makes_is_not_told(more: int, tiny: float, told: str) -> None:
    """A small change of a cost, and the last digits of a deterministic engine."""
    found = [
        replace(r, metrics={"placed": 0.9 + (r.seed % 5) / 50 + late * tiny})
        for k, late in enumerate((0, 0, 1, 1))
        for r in release(str(k + 1), 1.0, ram=160 + late * more)
    ]
    (history,) = histories(found, {"stacking": METRICS})
    assert history.sentences() == [f"{told} supported by these repetitions"]


def test_a_slower_machine_is_no_slower_release() -> None:
    """Twice the CPU time, for the stepping and for the control alike; and of the stepping alone."""
    for control, told in ((2.0, "no change is supported by these repetitions"), (1.0, "CPU")):
        found = [
            replace(r, stepping={"cpu": (1.0 + r.seed % 7 / 100) * (1 + late), "simulated": 10.0,
                                 "wall": 1.0, "control_cpu": 1e-4 * (control if late else 1.0)})
            for k, late in enumerate((0, 0, 1, 1))
            for r in release(str(k + 1), 1.0)
        ]  # fmt: skip
        (history,) = histories(found, {"stacking": METRICS})
        assert told in history.sentences()[0]


def test_a_release_that_fails_is_named_with_its_message() -> None:
    broken = [
        replace(failed(k), simulator="engine==3", test="test_stacking[engine==3-headless]")
        for k in range(4)
    ]
    found = [*release("1", 1.0), *release("2", 1.0), *broken]
    (history,) = histories(found, {"stacking": METRICS})
    assert history.sentences()[-1] == (
        "3: 4 of 4 repetitions crashed, most often WorkerHung in settle: no answer for 30 s"
    )


def test_a_release_without_a_value_of_a_metric_is_named() -> None:
    gone = [replace(r, metrics={}) for r in release("3", 1.0)]
    (history,) = histories([*release("1", 1.0), *release("2", 1.0), *gone], {"stacking": METRICS})
    assert history.sentences() == ["placed has no value with 3"]


def test_the_one_value_that_all_repetitions_would_have_changes_for_certain() -> None:
    levels = (("1", 1.0), ("2", 1.0), ("3", 0.6), ("4", 0.6))
    found = [
        r.noting(sole=True) for version, placed in levels for r in release(version, placed, n=1)
    ]
    (history,) = histories(found, {"stacking": METRICS})
    assert history.sentences() == [
        "placed fell with 3: 100 % -> 60 %, every repetition is the same"
    ]


def test_two_releases_and_other_names_are_no_history() -> None:
    builds = [replace(r, simulator=f"engine@{k}") for k in range(3) for r in release("1", 1.0)]
    assert histories([*release("1", 1.0), *release("2", 1.0)], {"stacking": METRICS}) == []
    assert histories(builds, {"stacking": METRICS}) == []


@pytest.mark.parametrize("number", range(2, 40))
def test_the_first_worse_one_is_found_in_log2_steps(number: int) -> None:
    for planted in range(1, number):
        asked: list[int] = []

        def is_worse(place: int, planted: int = planted, asked: list[int] = asked) -> bool:
            asked.append(place)
            return place >= planted

        assert first_worse(number, is_worse) == planted
        assert len(asked) <= steps(number)
        assert not {0, number - 1} & set(asked)


def test_a_release_is_like_the_one_that_it_is_nearer_to() -> None:
    good, bad = (ResultSet(release(v, x), METRICS) for v, x in (("1", 1.0), ("9", 0.6)))
    for placed, worse in ((0.95, False), (0.85, False), (0.75, True), (0.3, True)):
        other = ResultSet(release("5", placed), METRICS)
        assert like_the_bad_one(PLACED, good, bad, other) is worse
    halfway, bad = (ResultSet(release(v, x), METRICS) for v, x in (("5", 0.75), ("9", 0.5)))
    assert not like_the_bad_one(PLACED, good, bad, halfway)


def test_releases_between_two() -> None:
    known = ["1.0", "1.1", "1.2", "1.3"]
    assert between(known, "1.1", "1.3") == ["1.1", "1.2", "1.3"]
    assert between(known, "1.2", "1.0") == ["1.2", "1.1", "1.0"]
    with pytest.raises(ValueError, match="list"):
        between(known, "1.2", "9.9")


def test_a_run_as_baseline_and_current() -> None:
    found = [*release("1", 1.0), *release("2", 0.5), *release("3", 0.4)]
    before, now = side_by_side(found, "engine==1", ["engine==2"])
    assert {r.simulator for r in now} == {r.simulator for r in before} == {"engine==2"}
    assert {r.test for r in before} == {"test_stacking[engine==2-headless]"}
    assert {r.metrics["placed"] for r in before} == {r.metrics["placed"] for r in found[:8]}


def test_a_simulators_name_in_a_folder_or_a_parameter_hides_no_comparison() -> None:
    """`--sim-baseline=mujoco` in `mujoco-bench/` compared nothing, and passed."""
    test = "mujoco-bench/test_it.py::test_stacking[mujoco-law-{}-headless]"
    found = [
        record(
            k,
            test=test.format(name),
            function="mujoco-bench/test_it.py::test_stacking",
            variant="mujoco-law",
            simulator=name,
            metrics={"placed": placed},
        )
        for name, placed in (("mujoco", 1.0), ("mujoco==3.3.7", 0.5))
        for k in range(20)
    ]
    sides = side_by_side(found, "mujoco", ["mujoco==3.3.7"])
    assert {r.test for r in sides[0]} == {r.test for r in sides[1]}
    (failure,) = run_gate(
        *sides, parse_limits("placed:5%", METRICS), {"stacking": METRICS}
    ).failures
    assert "placed fell from 100 % to 50 %" in failure
    alone = [r for r in found if r.simulator == "mujoco"]
    nothing = run_gate(*side_by_side(alone, "mujoco", ["mujoco==3.3.7"]), (), {})
    assert "no test of this run is in the baseline" in nothing.failures[0]


def test_a_release_is_worse_by_one_value_that_all_repetitions_would_have() -> None:
    kept = [record(1, metrics={"placed": placed}).noting(sole=True) for placed in (1.0, 0.9)]
    sides = (ResultSet([each], METRICS) for each in kept)
    assert compared(PLACED, *sides)[0].p_value == 0.0


def test_values_that_differ_are_not_one_whatever_the_simulator_claims() -> None:
    before, after = (
        [record(k, metrics={"placed": value}).noting(sole=True) for k, value in enumerate(values)]
        for values in ((1.0, 1.0), (1.0, 0.8))
    )
    assert ResultSet(before, METRICS).sole("placed")
    assert not ResultSet(after, METRICS).sole("placed")
    limits = parse_limits("placed:5%", METRICS)
    failures = run_gate(before, after, limits, {"stacking": METRICS}, typed=False).failures
    assert failures == ()
