"""Which records count, which make a row, and how the row is told apart."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import pytest

from pytest_simbench.records.record import Record
from pytest_simbench.records.series import (
    RowKey,
    by_test,
    comparable,
    configurations,
    configured,
    series,
    settled,
    side_by_side,
)

from .build import failed, record


def interrupted(repetition: int = 0) -> Record:
    return record(repetition, status="interrupted")


def test_an_interrupted_twin_is_never_kept() -> None:
    for order in permutations([interrupted(), interrupted(), record()]):
        assert settled(order) == [record()]
    assert settled([interrupted(), failed(0)]) == [failed(0)]
    assert settled([interrupted(), interrupted()]) == [interrupted()]


def test_an_interrupted_start_is_the_twin_of_what_ended() -> None:
    begun = replace(interrupted(), settings={"task.levels": 5}, versions={})
    done = record(settings={"timestep": 0.002, "task.levels": 5})
    assert settled([begun, done]) == [done]
    other = record(settings={"timestep": 0.002, "task.levels": 3})
    assert settled([begun, other]) == [begun, other]


def test_the_last_attempt_counts_once() -> None:
    first, second = (record(metrics={"placed": v}, attempt=k) for v, k in ((0.1, 1), (0.9, 2)))
    assert settled([first, second]) == [second]
    assert settled([second, first]) == [second]
    again = record(metrics={"placed": 0.5})
    assert settled([first, again]) == [again]  # written later
    cut = replace(second, status="interrupted")
    assert settled([first, cut]) == settled([cut, first]) == [first]


def test_seeds_tasks_modes_and_configurations_are_not_twins() -> None:
    found = [
        record(),
        record(seed=7),
        record(1),
        record(task="throwing"),
        record(mode="gui"),
        record(jitter=50.0),
        record(settings={"timestep": 1.0}),
    ]
    assert settled(found) == found


def test_groups_are_configurations_and_a_failed_start_joins_one() -> None:
    fine, coarse = record(1), record(2, settings={"timestep": 0.01})
    dead = replace(failed(3), settings={}, versions={})
    assert configurations([fine, coarse]) == [[fine], [coarse]]
    assert configurations([dead, fine, coarse]) == [[dead, fine], [coarse]]
    assert configurations([dead]) == [[dead]]


def test_a_row_is_one_configuration_and_names_the_difference() -> None:
    tests = {v: f"t.py::test_x[{v}-engine-headless]" for v in (0.001, 0.004)}
    runs = [record(k, test=t, settings={"timestep": v}) for v, t in tests.items() for k in (1, 2)]
    assert [(r.label, len(r.records)) for r in series(runs)] == [
        ("timestep=0.001", 2),
        ("timestep=0.004", 2),
    ]


@pytest.mark.parametrize(
    ("change", "label"),
    [
        ({"settings": {"timestep": 0.5}}, "timestep=0.5"),
        ({"jitter": 50.0}, "jitter=50.0"),
        ({"protocol": "paper"}, "protocol=paper"),
        ({"versions": {"engine": "2.0"}}, "versions.engine=2.0"),
        ({"limits": {"timeout": 9.0}}, "limits.timeout=9.0"),
    ],
)
def test_records_of_one_test_that_were_mixed_are_rows_of_their_own(
    change: dict[str, object], label: str
) -> None:
    ours = [record(k, limits={"timeout": 4.0}) for k in (1, 2)]
    rows = series([*ours, *(replace(r, **change) for r in ours)])
    assert [len(row.records) for row in rows] == [2, 2]
    assert label in [row.label for row in rows]


def test_modes_have_rows_of_their_own_headless_first() -> None:
    rows = series([record(mode="gui"), record(mode="headless")])
    assert [row.key.mode for row in rows] == ["headless", "gui"]


def test_a_parameter_that_changes_no_setting_still_tells_rows_apart() -> None:
    """Else each seed would count twice."""
    runs = [record(1, test=f"t.py::test_x[engine-headless-{p}]") for p in "ab"]
    assert [row.label for row in series(runs)] == ["[a]", "[b]"]


def test_a_row_is_of_a_robot_a_swept_step_and_a_variant() -> None:
    plain = record(1, test="t.py::test_x[engine-headless-ur5-fast]", robot={"name": "ur5"})
    assert RowKey.of(plain) == ("engine", "headless", "tuned", "t.py::test_x", "ur5-fast")
    swept = plain.noting(own_timestep=0.001)  # at 2 ms
    assert RowKey.of(swept).parameters == "ur5-dt=2ms-fast"


def test_one_row_needs_no_label_and_functions_have_theirs() -> None:
    assert [row.label for row in series([record(1), record(2)])] == [""]
    two = [record(1, test=f"t.py::test_{n}[engine-headless]") for n in "ab"]
    assert [row.label for row in series(two)] == ["t.py::test_a", "t.py::test_b"]


def test_tests_are_matched_without_their_file_and_tasks_told_apart() -> None:
    old = [record(1, test="a/t.py::test_x[e]"), record(1, test="a/t.py::test_x[e]", task="throw")]
    new = [record(1, test="t.py::test_x[e]")]
    before, after = by_test([old, new])
    assert list(before) == ["test_x[e] (stacking)", "test_x[e] (throw)"]
    assert list(after) == ["test_x[e] (stacking)"]
    assert [list(side) for side in by_test([new, new])] == [["test_x[e]"]] * 2
    mixed = [*new, replace(new[0], jitter=9.0)]
    assert list(by_test([mixed])[0]) == ["test_x[e] (stacking)", "test_x[e] (stacking 2)"]


def test_tasks_of_a_test_are_matched_by_what_tells_them_apart_and_the_rest_by_order() -> None:
    one, two, three = ([record(1, settings={"task.levels": levels})] for levels in (1, 2, 3))
    before, after = by_test([one + two, three + two + one])
    assert list(before.values()) == [one, two]
    assert {name: after[name] for name in before} == before
    before, after = by_test([two + one, three + two])
    assert [(before[name], after[name]) for name in before] == [(two, two), (one, three)]
    changed = [replace(r, settings={**r.settings, "task.policy": "new"}) for r in two + one]
    before, after = by_test([one + two, changed])  # what they all share tells none apart
    assert [after[name][0].settings["task.levels"] for name in before] == [1, 2]


def test_a_label_lists_three_differences() -> None:
    """And says when there are more."""
    ours = record(1, settings={"a": 1, "b": 1, "c": 1, "d": 1})

    def labels(**settings: int) -> list[str]:
        other = replace(ours, settings={**ours.settings, **settings})
        return [row.label for row in series([ours, other])]

    assert labels(a=2, b=2, c=2) == ["a=1 b=1 c=1", "a=2 b=2 c=2"]
    assert labels(a=2, b=2, c=2, d=2) == ["a=1 b=1 c=1 ...", "a=2 b=2 c=2 ..."]


def test_a_scene_is_told_where_nothing_else_tells_as_much() -> None:
    own = record(1, scene="0", settings={"task.shape": "ball"})
    moved = replace(own, scene="1")
    cube = replace(own, scene="2", settings={"task.shape": "cube"})
    assert [row.label for row in series([own, cube])] == ["task.shape=ball", "task.shape=cube"]
    assert [row.label for row in series([own, moved])] == ["scene=0", "scene=1"]
    assert [row.label for row in series([own, moved, cube])] == [
        "task.shape=ball scene=0", "task.shape=ball scene=1", "task.shape=cube scene=2",
    ]  # fmt: skip


def test_robots_are_told_by_name_alone_and_what_else_differs_beside() -> None:
    own = record(1, scene="0", settings={"timestep": 0.002})
    small = {"robot": {"name": "so101", "digest": "1"}, "scene": "1"}
    other = replace(own, **small)  # type: ignore[arg-type]
    finer = replace(other, settings={"timestep": 0.001})
    assert [row.label for row in series([own, other])] == ["default robot", "robot=so101"]
    assert [row.label for row in series([own, other, finer])] == [
        "default robot timestep=0.002",
        "robot=so101 timestep=0.002",
        "robot=so101 timestep=0.001",
    ]


def test_what_differs_within_a_run_tells_configurations_apart_in_all() -> None:
    one, fine = record(1), record(2, settings={"timestep": 0.001})
    later = [replace(r, versions={"engine": "2.0"}) for r in (one, fine)]
    alone, other = replace(one, versions={"engine": "3.0"}), record(1, simulator="other")
    found = configured([one, *later, fine, alone, other], lambda r: str(r.versions))
    assert found == {
        (*one.who, "timestep=0.002"): [one, later[0], alone],
        (*one.who, "timestep=0.001"): [fine, later[1]],
        other.who: [other],
    }


def test_a_simulator_is_the_baseline_of_others_by_their_tests() -> None:
    ids = [(s, f"test_{n}[{s}-headless]") for s in "abc" for n in "xy"]
    runs = [record(1, test=test, simulator=s) for s, test in ids]
    before, now = side_by_side(runs[:-1], "a", ["b", "c"])
    assert [(r.simulator, r.test) for r in before] == [*ids[2:5], ("c", "test_y[a-headless]")]
    assert list(now) == runs[2:-1]


def test_rows_are_ranked_only_where_the_same_was_asked() -> None:
    ours, other = record(1), record(1, simulator="b", test="test_stacking[b-headless]")

    def ranked(**changes: object) -> bool:
        mine, another = series([ours]) + series([replace(other, **changes)])
        return comparable(mine, another)

    assert ranked()
    assert ranked(settings={"timestep": 9.0})
    rows = [series([replace(ours, settings={"task.levels": k})])[0] for k in (3, 3, 5)]
    assert [comparable(rows[0], row) for row in rows] == [True, True, False]
    (untold,) = series([replace(ours, settings={})])  # what only one tells makes no difference
    assert comparable(rows[0], untold)
    assert comparable(untold, rows[0])
    for name, value in {"jitter": 50.0, "protocol": "paper", "mode": "gui", "profile": "x"}.items():
        assert not ranked(**{name: value})
    real, paper = (series([replace(ours, profile="real", **of)])[0] for of in ({}, {"jitter": 9.0}))
    assert comparable(rows[0], real, profiles=True)
    assert not comparable(rows[0], paper, profiles=True)
    swept = series([ours, replace(ours, settings={"timestep": 9.0})])  # each has a label
    assert all(comparable(row, series([other])[0]) for row in swept)
    runs = [record(1, test=f"test_{n}[{s}]", simulator=s) for s in "ab" for n in "xy"]
    found = {(row.key.simulator, row.label): row for row in series(runs)}
    assert comparable(found["a", "test_x"], found["b", "test_x"])
    assert not comparable(found["a", "test_x"], found["b", "test_y"])
