"""What a folder says of its numbers: round trip, and what is no description."""

from __future__ import annotations

import json
import math
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.records.description import TaskDescription, TaskDescriptionError, Threshold
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


def test_a_newer_plugin_may_say_more_of_a_metric() -> None:
    data = {"task": "t", "metrics": [{**METRIC, "colour": "red"}], "colour": "red"}
    assert TaskDescription.from_dict(data) == TaskDescription("t", (Metric("x", "X"),))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ([], "a JSON object is wanted, not list"),
        ({}, "'metrics' must be list, not NoneType"),
        ({"metrics": []}, "'task' must be str, not NoneType"),
        ({"task": "x" * 5000, "metrics": []}, "'task' has 5000 characters, at most 2000 are read"),
        ({"schema": 2, "task": "t"}, "schema 2 was written by a newer pytest-simbench"),
        ({"schema": "x", "task": "t"}, "schema 'x' was written"),
        ({"task": "t", "metrics": {"x": 1}}, "'metrics' must be list, not dict"),
        ({"task": "t", "metrics": [3]}, "'metrics.1' must be dict, not int"),
        ({"task": "t", "metrics": [METRIC, METRIC]}, "two of the metrics have one name"),
        ({"task": "t", "metrics": [], "references": 3}, "'references' must be numbers by name"),
        ({"task": "t", "metrics": [], "references": {"x": None}}, "'references' must be numbers"),
        ({"task": "t", "metrics": [], "references": {"x": "1"}}, "'references.x' must be a number"),
        ({"task": "t", "metrics": [], "references": {"x": 1e999}}, "'references.x' must be a fin"),
        *(
            ({"task": "t", "metrics": [{**METRIC, **change}]}, message)
            for change, message in (
                ({"name": 3}, "'metrics.1.name' must be str, not int"),
                ({"name": ""}, "'metrics.1.name' is empty"),
                ({"title": None}, "'metrics.1.title' must be str, not NoneType"),
                ({"unit": []}, "'metrics.1.unit' must be str, not list"),
                ({"doc": "x" * 5000}, "'metrics.1.doc' has 5000 characters"),
                ({"better": "up"}, "'metrics.1.better' is 'up', none of higher, lower, None"),
                ({"better": []}, "'metrics.1.better' is []"),
                ({"kind": "guess"}, "'metrics.1.kind' is 'guess', none of share, yes_no, value"),
                ({"study": "no"}, "'metrics.1.study' is 'no'"),
                ({"of": 1.5}, "'metrics.1.of' is 1.5"),
                ({"of": 0}, "'metrics.1.of' must be at least 1, not 0"),
                ({"kind": "share"}, "metric 'x' is a share: say of how many things"),
                ({"resolution": -1}, "'metrics.1.resolution' must be at least 0, not -1"),
                ({"resolution": "1"}, "'metrics.1.resolution' must be a number, not '1'"),
                ({"resolution": 10**400}, "'metrics.resolution' is larger than any number"),
                ({"least": "0"}, "'metrics.1.least' must be a number, not '0'"),
            )
        ),
    ],
    ids=lambda value: value[:60] if isinstance(value, str) else "",
)
def test_something_else_is_one_sentence(data: Any, message: str) -> None:
    with pytest.raises(TaskDescriptionError) as caught:
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
        except TaskDescriptionError:
            continue
        again = json.loads(json.dumps(found.to_dict(), allow_nan=False))
        assert kind.from_dict(again) == found


def test_a_threshold_survives_its_line() -> None:
    asked = Threshold("t::x", "placed", 0.9)
    assert Threshold.from_dict(json.loads(json.dumps(asked.to_dict()))) == asked
    for wrong in ({}, {"test": "t", "metric": "m"}, {"test": "t", "metric": 3, "value": 1},
                  {"test": "t", "metric": "m", "value": "1"}):  # fmt: skip
        with pytest.raises(TaskDescriptionError, match="here: "):
            Threshold.from_dict(wrong, "here")
