"""What a folder says of its numbers: round trip, and what is no description."""

from __future__ import annotations

import json
import math
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.records.checked import CheckError
from pytest_simbench.records.description import TaskDescription, Threshold
from pytest_simbench.records.metrics import Metric
from pytest_simbench.tasks import LeaningTowers, Stacking, Throwing

METRIC = {"name": "x", "title": "X"}


@pytest.mark.parametrize("task", [Stacking(), Throwing(), LeaningTowers()], ids=lambda t: t.name)
def test_what_a_task_says_survives_its_line(task: Any) -> None:
    said = TaskDescription.of(task)
    assert said.metrics == tuple(task.metrics)
    assert said.references == dict(task.references)
    assert TaskDescription.from_dict(json.loads(json.dumps(said.to_dict()))) == said


def test_numpy_values_are_plain_and_what_is_no_number_is_no_reference() -> None:
    class Baking:
        name = "baking"
        metrics = (Metric("x", "x", of=np.int64(3), resolution=np.float32(0.5), least=-3),)  # type: ignore
        references: ClassVar = {"x": np.float32(0.25), "y": math.nan, "z": math.inf}

    said = json.loads(json.dumps(TaskDescription.of(Baking()).to_dict()))  # type: ignore[arg-type]
    metric = Metric("x", "x", of=3, resolution=0.5, least=-3)
    assert TaskDescription.from_dict(said) == TaskDescription("baking", (metric,), {"x": 0.25})


@pytest.mark.parametrize("name", ["crashed", "ram"])
def test_a_task_has_no_metric_of_the_name_that_every_task_has(name: str) -> None:
    class Driving:
        references: ClassVar = {}
        metrics = (Metric(name, name),)

    Driving.name = "driving"  # type: ignore[attr-defined]
    with pytest.raises(ValueError, match=f"driving: every task has a metric '{name}'; rename"):
        TaskDescription.of(Driving())  # type: ignore[arg-type]


def test_a_newer_plugin_may_say_more_of_a_metric() -> None:
    data = {"task": "t", "metrics": [{**METRIC, "colour": "red"}], "colour": "red"}
    assert TaskDescription.from_dict(data) == TaskDescription("t", (Metric("x", "X"),))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ([], "a JSON object is wanted, not list"),
        ({}, "there is no 'task'"),
        ({"metrics": []}, "there is no 'task'"),
        ({"task": "x" * 5000, "metrics": []}, "'task': expected 'str' of length <= 2000"),
        ({"schema": 2, "task": "t"}, "schema 2 was written by a newer pytest-simbench"),
        ({"schema": "x", "task": "t"}, "schema 'x' was written"),
        ({"task": "t", "metrics": {"x": 1}}, "'metrics': expected 'list', got 'dict'"),
        ({"task": "t", "metrics": [3]}, "'metrics[0]': expected 'dict', got 'int'"),
        ({"task": "t", "metrics": [METRIC, METRIC]}, "two of the metrics have one name"),
        ({"task": "t", "metrics": [], "references": 3}, "'references': expected 'dict', got 'int'"),
        (
            {"task": "t", "metrics": [], "references": {"x": None}},
            "'references[...]': expected 'float'",
        ),
        (
            {"task": "t", "metrics": [], "references": {"x": "1"}},
            "'references[...]': expected 'float'",
        ),
        ({"task": "t", "metrics": [], "references": {"x": 1e999}}, "'references.x' must be a fin"),
        *(
            ({"task": "t", "metrics": [{**METRIC, **change}]}, message)
            for change, message in (
                ({"name": 3}, "'metrics[0].name': expected 'str', got 'int'"),
                ({"name": ""}, "'metrics[0].name': expected 'str' of length >= 1"),
                ({"title": None}, "'metrics[0].title': expected 'str', got 'None'"),
                ({"unit": []}, "'metrics[0].unit': expected 'str', got 'list'"),
                ({"doc": "x" * 5000}, "'metrics[0].doc': expected 'str' of length <= 2000"),
                ({"better": "up"}, "'metrics[0].better': invalid enum value 'up'"),
                ({"better": []}, "'metrics[0].better': expected 'str | None', got 'list'"),
                ({"kind": "guess"}, "'metrics[0].kind': invalid enum value 'guess'"),
                ({"study": "no"}, "'metrics[0].study': expected 'bool', got 'str'"),
                ({"of": 1.5}, "'metrics[0].of': expected 'int | None', got 'float'"),
                ({"of": 0}, "'metrics[0].of': expected 'int' >= 1"),
                (
                    {"kind": "share"},
                    "'metrics[0]': metric 'x' is a share: say of how many",
                ),
                ({"resolution": -1}, "'metrics[0].resolution': expected 'float' >= 0.0"),
                (
                    {"resolution": "1"},
                    "'metrics[0].resolution': expected 'float | None'",
                ),
                ({"resolution": 10**400}, "'metrics.resolution' is larger than any number"),
                ({"least": "0"}, "'metrics[0].least': expected 'float | None', got 'str'"),
            )
        ),
    ],
    ids=lambda value: value[:60] if isinstance(value, str) else "",
)
def test_something_else_is_one_sentence(data: Any, message: str) -> None:
    with pytest.raises(CheckError) as caught:
        TaskDescription.from_dict(data, "here")
    assert str(caught.value).startswith(f"here: {message}")
    assert len(str(caught.value)) < 300


def test_a_file_of_a_newer_version_is_known_by_what_this_one_writes() -> None:
    metric = Metric("placed", "placed", kind="share", of=15)
    for written in (TaskDescription("t", (metric,)), Threshold("a", "placed", 0.5)):
        assert written.to_dict()["schema"] == 1


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=6,
)
fields = [*Metric.__dataclass_fields__, "schema", "task", "metrics", "references", "test", "value"]


@given(
    st.dictionaries(st.sampled_from(fields), anything | st.lists(
        st.dictionaries(st.sampled_from(fields), anything), max_size=2))
)  # fmt: skip
def test_whatever_it_is_it_is_a_description_or_refused(data: dict[str, Any]) -> None:
    for kind in (TaskDescription, Threshold):
        try:
            found = kind.from_dict(data)
        except CheckError:
            continue
        again = json.loads(json.dumps(found.to_dict(), allow_nan=False))
        assert kind.from_dict(again) == found


def test_a_threshold_survives_its_line() -> None:
    asked = Threshold("t::x", "placed", 0.9)
    assert Threshold.from_dict(json.loads(json.dumps(asked.to_dict()))) == asked
    for wrong in ({}, {"test": "t", "metric": "m"}, {"test": "t", "metric": 3, "value": 1},
                  {"test": "t", "metric": "m", "value": "1"}):  # fmt: skip
        with pytest.raises(CheckError, match="here: "):
            Threshold.from_dict(wrong, "here")
