"""The table of what must be equal, and that pooling, resuming, merging and comparing go by it."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, get_args

import pytest

from pytest_simbench.records.configuration import (
    MEANING,
    PARTS,
    Use,
    agree,
    differences,
    equal_to,
    other_meanings,
)
from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record

from .build import record

ANOTHER: dict[str, Any] = {
    "test": "test_other[engine-headless]",
    "task": "throwing",
    "simulator": "other",
    "mode": "gui",
    "repetition": 7,
    "seed": 77,
    "profile": "default",
    "settings": {"timestep": 0.004, "task.towers": 4},
    "protocol": "paper",
    "jitter": 50.0,
    "scene": "another",
    "task_code": "another",
    "robot": {"name": "ur5", "digest": "12ab"},
    "limits": {"timeout": 5.0},
    "versions": {"engine": "2.0"},
    "deviations": ("no armature",),
    "host": {"cpu": "other"},
    "contended": True,
    "reused_worker": True,
}
"""A value of each field that some use wants equal."""


def whole(**changes: Any) -> Record:
    return record(scene="one", task_code="one", limits={"timeout": 4.0}, **changes)


def test_every_field_of_a_record_has_its_line_and_reason() -> None:
    assert sorted(part.name for part in PARTS) == sorted(f.name for f in fields(Record))
    assert all(part.reason for part in PARTS)
    assert {name for part in PARTS if part.equal_to for name in (part.name,)} == set(ANOTHER)


@pytest.mark.parametrize("use", get_args(Use))
@pytest.mark.parametrize("name", ANOTHER)
def test_records_agree_as_the_table_says(use: Use, name: str) -> None:
    other = replace(whole(), **{name: ANOTHER[name]})
    assert agree(whole(), other, use) is (name not in equal_to(use))
    assert agree(other, whole(), use) is (name not in equal_to(use))


def test_a_configuration_is_equal_for_pooling_resuming_and_merging() -> None:
    configuration = {"profile", "settings", "protocol", "jitter", "scene", "robot", "limits"}
    configuration |= {"versions", "task_code"}
    assert set(equal_to("pool")) == set(equal_to("resume")) == configuration
    assert set(equal_to("merge")) == {*configuration, "deviations"}
    circumstances = {"deviations", "host", "contended", "reused_worker"}
    assert set(equal_to("compare")) == {*configuration, *circumstances}


def test_simulators_are_ranked_where_the_same_was_asked_of_them() -> None:
    ranked = {"mode", "profile", "settings", "protocol", "jitter", "scene", "robot", "task_code"}
    assert set(equal_to("rank")) == ranked
    other = whole(simulator="b", versions={"b": "1"}, settings={"substeps": 4, "task.towers": 3})
    ours = whole(settings={"timestep": 0.004, "task.towers": 3})
    assert agree(ours, other, "rank")
    assert not agree(ours, replace(other, settings={"task.towers": 4}), "rank")


def test_every_field_of_a_metric_has_its_line_and_reason() -> None:
    assert sorted(part.name for part in MEANING) == sorted(f.name for f in fields(Metric))
    assert all(part.reason for part in MEANING)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"unit": "mm"}, 'unit of the metric x of t was "m", is "mm"'),
        ({"kind": "yes_no"}, 'kind of the metric x of t was "value", is "yes_no"'),
        ({"better": None}, 'better of the metric x of t was "higher", is null'),
        ({"title": "y"}, None),
        ({"doc": "y"}, None),
    ],
)
def test_other_meanings_are_named(change: dict[str, Any], named: str | None) -> None:
    metric = Metric("x", "x", "m")
    before = {"t": TaskDescription("t", (metric, Metric("gone", "gone")))}
    now = {
        "t": TaskDescription("t", (replace(metric, **change),)),
        "new": TaskDescription("new", ()),
    }
    for use in ("resume", "merge", "compare"):
        assert other_meanings(before, now, use) == ([named] if named else [])  # type: ignore[arg-type]


WHOLE = {"timestep": 0.002, "task.towers": 3}
START = {"task.towers": 3}


@pytest.mark.parametrize(
    ("changes", "agrees"),
    [
        # Results and circumstances are no configuration.
        ({"repetition": 9, "metrics": {"placed": 0.1}, "contended": True, "attempt": 2}, True),
        ({"scene": "", "limits": {}}, True),  # an older record has neither
        # Of a record that ended what it lacks is not there.
        ({"settings": {**WHOLE, "cone": "elliptic"}}, False),
        ({"versions": {}}, False),
        # What a failed start did not learn contradicts nothing.
        ({"status": "failed", "settings": START, "versions": {}, "deviations": ()}, True),
        ({"status": "failed", "settings": {}}, True),
        ({"status": "failed", "settings": {"task.towers": 4}}, False),
        ({"status": "failed", "settings": START, "versions": {"engine": "9"}}, False),
        # One that knows more than the task's settings knows all of them.
        ({"status": "failed"}, True),
        ({"status": "failed", "settings": {**WHOLE, "timestep": 0.1}}, False),
        ({"status": "failed", "settings": {"timestep": 0.002}}, False),
    ],
)
def test_who_is_of_one_configuration(changes: dict[str, Any], agrees: bool) -> None:
    ours = whole(settings=WHOLE)
    other = replace(ours, **changes)
    assert agree(ours, other) is agree(other, ours) is agrees


def test_another_robot_is_named() -> None:
    """The task's own robot leaves no trace; one of another description is told by its digest."""
    assert "robot" not in whole().to_dict()
    ur5 = {"name": "ur5", "digest": "12ab"}
    assert Record.from_dict(whole(robot=ur5).to_dict()).robot == ur5
    runs = {"t": ([whole()], [whole(robot=ur5)])}
    assert differences(runs) == [
        'robot.name was absent, is "ur5" (t)',
        'robot.digest was absent, is "12ab" (t)',
    ]
    assert differences({"t": runs["t"][::-1]})[0] == 'robot.name was "ur5", is absent (t)'
    assert differences(runs, fields=["robot"]) == differences(runs)
    assert differences(runs, fields=["settings"]) == []
    runs = {"t": ([whole(robot={**ur5, "digest": "34cd"})], [whole(robot=ur5)])}
    assert differences(runs) == ['robot.digest was "34cd", is "12ab" (t)']


def test_equal_runs_differ_in_nothing() -> None:
    assert differences({"t": ([record(0), record(1)], [record(5)])}) == []


def test_what_a_repetition_that_was_cut_short_did_not_learn_is_no_difference() -> None:
    told = record(0, deviations=("no armature",))
    cut = replace(told, status="interrupted", deviations=())
    assert differences({"t": ([told], [told, cut])}) == []
    assert differences({"t": ([told], [replace(cut, status="ok")])})


def test_settings_versions_machines_and_profile_are_named() -> None:
    now = record(
        0,
        profile="default",
        settings={"timestep": 0.004, "solver": {"iterations": 50}},
        versions={"engine": "1.1"},
        host={"cpu": "other", "cores": 2},
    )
    assert differences({"stack": ([record(0)], [now])}) == [
        'profile was "tuned", is "default" (stack)',
        "settings.timestep was 0.002, is 0.004 (stack)",
        'versions.engine was "1.0", is "1.1" (stack)',
        'host.cpu was "some", is "other" (stack)',
        "settings.solver.iterations was absent, is 50 (stack)",
    ]


def test_a_difference_of_every_test_is_said_once() -> None:
    old, new = [record(0)], [record(0, contended=True)]
    found = differences({"a": (old, new), "b": (old, new), "c": (old, new)})
    assert found == ["contended was false, is true (every test)"]
    assert differences({"a": (old, new), "b": (old, old)})[0].endswith("(a)")


def test_a_run_that_is_not_the_same_throughout_shows_all_its_values() -> None:
    mixed = [record(0), record(1, jitter=1.0)]
    assert differences({"t": (mixed, [record(0)])}) == ["jitter was 0.0 or 1.0, is 0.0 (t)"]
