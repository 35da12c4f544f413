"""Shards make the run that one machine would have made, or are refused."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.merging import MergeError, merge, merge_tasks
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record

from .build import record


def straight(count: int, first: int = 2022) -> list[Record]:
    return [record(k, seed=first + k - 1, metrics={"placed": 1 / k}) for k in range(1, count + 1)]


def shard(whole: list[Record], start: int, end: int) -> list[Record]:
    """What a machine records that starts at the seed of repetition `start`."""
    return [replace(r, repetition=k) for k, r in enumerate(whole[start:end], start=1)]


@given(cuts=st.lists(st.integers(0, 30), max_size=4), seed=st.integers())
def test_shards_in_any_order_make_the_straight_run(cuts: list[int], seed: int) -> None:
    whole = straight(30)
    ends = [0, *sorted(cuts), 30]
    parts = [(f"run {i}", shard(whole, a, b)) for i, (a, b) in enumerate(pairwise(ends))]
    Random(seed).shuffle(parts)
    assert [item.record for item in merge({name: part for name, part in parts if part})] == whole


@pytest.mark.parametrize("status", [None, "interrupted"])
def test_a_part_without_a_repetition_is_refused(status: str | None) -> None:
    part = [replace(r, status=status) for r in straight(1) if status]
    with pytest.raises(MergeError, match="^b holds no repetition that ended"):
        merge({"a": straight(3), "b": part})


def test_each_record_tells_where_its_files_are() -> None:
    whole = [replace(r, details={"log": f"logs/{r.seed}.log"}) for r in straight(3)]
    found = merge({"a": shard(whole, 0, 2), "b": shard(whole, 2, 3)})
    assert [(item.run, item.record.details["log"]) for item in found] == [
        ("a", "logs/2022.log"),
        ("a", "logs/2023.log"),
        ("b", "logs/2024.log"),
    ]


def test_a_test_that_repeats_two_tasks_is_merged_task_by_task() -> None:
    def parts(first: int) -> list[Record]:
        runs = straight(2, first)
        return [
            *(replace(r, settings={"task.towers": 3}) for r in runs),
            *(replace(r, settings={"task.towers": 4}) for r in runs),
        ]

    found = merge({"b": parts(2024), "a": parts(2022)})
    numbers = [(i.record.settings["task.towers"], i.record.repetition) for i in found]
    assert numbers == [(t, k) for t in (3, 4) for k in (1, 2, 3, 4)]


def test_a_run_of_two_configurations_is_refused() -> None:
    mixed = [*straight(2), *(replace(r, settings={"timestep": 0.01}) for r in straight(2, 2024))]
    with pytest.raises(MergeError, match=r"a holds several configurations: settings.timestep was"):
        merge({"a": mixed})


def test_the_last_attempt_is_the_only_one_of_the_whole() -> None:
    again = [replace(r, attempt=2) for r in straight(2)]
    assert [item.record.attempt for item in merge({"a": again})] == [1, 1]


def test_what_was_interrupted_is_left_out_and_may_be_in_the_other_part() -> None:
    whole = straight(4)
    cut = [*whole[:2], replace(whole[2], status="interrupted")]
    assert [i.record for i in merge({"a": cut, "b": shard(whole, 2, 4)})] == whole


def elsewhere(found: Record, file: str) -> Record:
    return replace(found, test=f"{file}::test_s[e]", function=f"{file}::test_s")


def test_the_path_of_the_test_file_does_not_matter() -> None:
    a = [elsewhere(r, "suites/test_s.py") for r in straight(2)]
    b = [elsewhere(r, "../x/test_s.py") for r in straight(2, first=2024)]
    assert {item.record.test for item in merge({"a": a, "b": b})} == {"suites/test_s.py::test_s[e]"}
    both = [*a, *(elsewhere(r, "other.py") for r in straight(2))]
    assert len({item.record.test for item in merge({"a": both})}) == 2


@pytest.mark.parametrize(
    ("first", "message"),
    [
        (2022, r"overlap: both have 3 seeds \(2022 to 2024\) of test_stacking"),
        (2024, "overlap: both have seed 2024 of test_stacking"),
        (2020, "overlap: both have seed 2022 of test_stacking"),
    ],
)
def test_overlaps_are_refused(first: int, message: str) -> None:
    with pytest.raises(MergeError, match=message):
        merge({"a": straight(3), "b": straight(3, first)})


@pytest.mark.parametrize(
    "name", ["settings", "versions", "profile", "protocol", "jitter", "scene", "limits"]
)
def test_differences_are_refused_and_named(name: str) -> None:
    value = {
        "settings": {"timestep": 1.0},
        "versions": {"engine": "3"},
        "limits": {"timeout": 5.0},
        "jitter": 0.5,
    }.get(name, "x")
    ours = [replace(r, scene="s", limits={"timeout": 4.0}) for r in straight(3)]
    other = [replace(r, **{name: value}) for r in straight(3, 3000)]
    with pytest.raises(MergeError, match=f"a and b are not parts of one run: {name}.* was "):
        merge({"a": ours, "b": other})


@pytest.mark.parametrize(
    "change",
    [
        {"host": {"cpu": "another"}},
        {"status": "failed", "settings": {}, "versions": {}, "metrics": {}},  # it died too early
    ],
)
def test_what_may_differ(change: dict[str, Any]) -> None:
    other = [replace(r, **change) for r in straight(2, 2025)]
    assert len(merge({"a": straight(3), "b": other})) == 5


def test_a_seed_twice_in_one_run_is_refused() -> None:
    with pytest.raises(MergeError, match="a has 1 of its seeds of test_stacking.* twice"):
        merge({"a": [*straight(2), straight(1)[0]]})


def test_what_the_numbers_mean_is_merged_and_the_last_wording_holds() -> None:
    placed = Metric("placed", "placed", kind="share", of=15)
    first = {"stacking": TaskDescription("stacking", (placed,))}
    reworded = TaskDescription("stacking", (replace(placed, title="in place", of=6),))
    second = {"stacking": reworded, "pouring": TaskDescription("pouring", ())}
    assert merge_tasks({"a": first, "b": second, "c": {}}) == second
    assert merge_tasks({"b": second, "a": first}) == {**second, **first}


@pytest.mark.parametrize("change", [{"unit": "mm"}, {"better": "lower"}, {"kind": "yes_no"}])
def test_numbers_of_another_meaning_are_refused(change: dict[str, Any]) -> None:
    gap = Metric("gap", "gap", "m")
    runs = {
        "a": {"stacking": TaskDescription("stacking", (gap,))},
        "b": {"stacking": TaskDescription("stacking", (replace(gap, **change),))},
    }
    (name,) = change
    with pytest.raises(MergeError, match=rf"a and b are not.*: {name} of the metric gap of stack"):
        merge_tasks(runs)


def test_what_a_run_without_a_good_repetition_knows_counts() -> None:
    """Its failures' settings, which must be the others' all the same."""
    whole = straight(4)
    bad = [replace(r, status="failed") for r in whole[2:]]
    assert len(merge({"a": whole[:2], "b": bad})) == 4
    assert len(merge({"b": bad, "a": whole[:2]})) == 4
    other = [replace(r, settings={"timestep": 0.5}) for r in bad]
    for runs in ({"a": whole[:2], "b": other}, {"b": other, "a": whole[:2]}):
        with pytest.raises(MergeError, match="a and b|b and a") as caught:
            merge(runs)
        assert "settings.timestep" in str(caught.value)


def test_the_whole_has_the_test_id_of_the_first_run() -> None:
    first, second = straight(1), [replace(r, seed=2023) for r in straight(1)]
    here = [replace(r, test=f"a/t.py::{r.test}", function=f"a/t.py::{r.function}") for r in first]
    assert {item.record.test for item in merge({"a": here, "b": second})} == {here[0].test}
    assert {item.record.test for item in merge({"b": second, "a": here})} == {second[0].test}
