"""What a release changed: laws, outcomes in both directions, ends of scenes; planted records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from pytest_simbench.measure.limits import Limit
from pytest_simbench.measure.watching import Step, _task, of_laws, of_scene, of_tasks
from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.folder import RunContents
from pytest_simbench.records.record import Record
from tests.measure.test_law_history import asked, row
from tests.measure.test_settling import at, crashed, end
from tests.records.build import failed, record
from tests.tiny import Falling

STEP = Step("engine", "1.9", "1.10")
LIMITS = [Limit("landed", 0.05, True)]


def test_a_law_changes_with_the_release_that_changed_it() -> None:
    records = [*row("glide", 0.5, 0.5, 4.0, 4.0), *row("drop", 8.0, 0.4, 0.4, 0.4),
               *row("spin", 0.2, 0.2, 0.001, 0.001),
               *row("slip", 0.02, 0.02, 0.09, 0.09)]  # fmt: skip
    assert list(of_laws(STEP, records)) == [
        (True, "glide is broken (0.5x -> 4x)"),
        (False, "kept by both, by one at least 2 times as closely: spin (0.2x -> 0.001x)"),
    ]
    assert list(of_laws(Step("engine", "1.10", "2.0"), records)) == []


def test_a_law_that_was_kept_and_does_not_run_any_more_is_a_change() -> None:
    gone = [*asked("tower", "1.9", 0.5), *asked("slip", "1.9", 5.0), *asked("spin", "1.10", 0.5)]
    told = [(True, "was kept, did not run: tower")]
    assert list(of_laws(STEP, [*row("glide", 0.5, 0.5, 0.5, 0.5), *gone])) == told
    assert list(of_laws(STEP, gone[:2])) == told  # no law ran at all


def falls(version: str, *landed: float | None) -> list[Record]:
    """Repetitions of a release; None is one that crashed."""
    name = f"engine=={version}"
    named = {"simulator": name, "test": f"test_falling[{name}-headless]", "task": "falling",
             "function": "test_falling"}  # fmt: skip
    return [
        replace(failed(k), **named)
        if value is None
        else record(k, metrics={"landed": value}, **named)
        for k, value in enumerate(landed, 1)
    ]


def judged(
    old: Sequence[float | None], new: Sequence[float | None], steps: int = 1
) -> list[tuple[bool, str]]:
    tasks = {"falling": TaskDescription.of(Falling())}
    run = RunContents("run", (*falls("1.9", *old), *falls("1.10", *new)), tasks)
    return list(of_tasks(STEP, run, LIMITS, steps))


def test_an_outcome_changes_in_either_direction_and_all_steps_share_the_error() -> None:
    good, bad = [1.0] * 12, [0.5] * 12
    (one,) = judged(good, bad)
    assert one == (True, "falling: landed 100 % -> 50 %, worse by 50 points (limit 5 points, "
                   "p = 0.00049)")  # fmt: skip
    (one,) = judged(bad, good)
    assert one[1].startswith("falling: landed 50 % -> 100 %, better by 50 points")
    assert judged(good, good) == []
    (one,) = judged(good, [0.97] * 12)
    assert one[0] is False  # certain, and within its limit
    few = judged(good, bad, steps=600)
    assert [changed for changed, _ in few] == [False]
    assert "too few for a change of landed to be significant" in few[0][1]


def test_a_task_is_named_without_its_variant() -> None:
    assert _task("suite.py::test_falling[engine-a[0]]") == "falling"


def test_a_release_that_crashes_has_changed() -> None:
    changed, told = zip(*judged([1.0] * 12, [None] * 12), strict=True)
    assert all(changed)
    assert told[1].startswith("falling: crashed 0 % -> 100 %, worse by 100 points")
    assert "none of 12 repetitions finished" in told[2]


@pytest.mark.parametrize(
    ("ends", "moved", "found"),
    [
        ((0.0, 0.4), 2.0, []),
        ((0.0, 30.0), 2.0, [(True, "bowl ends 30 mm elsewhere; no start that was moved does so")]),
        ((0.0, 30.0), 40.0, [(False, "bowl ends 30 mm elsewhere; a start moved by 0.1 mm does so "
                              "within one release")]),
        ((0.0, 30.0), None, [(False, "bowl ends 30 mm elsewhere; no moved start was tried, so it "
                              "may be noise")]),
        ((0.0, None), 2.0, [(True, "as it is written it ends no more")]),
        ((None, 0.0), None, [(True, "as it is written it ends where it did not before")]),
        ((None, None), None, [(False, "as it is written it ends not in both")]),
    ],
)  # fmt: skip
def test_an_end_changes_where_the_scene_s_noise_does_not_explain_it(
    ends: Sequence[float | None], moved: float | None, found: list[tuple[bool, str]]
) -> None:
    records = []
    for name, x in zip(STEP.names, ends, strict=True):
        if x is not None:
            records += [end(name, x)]
            records += [] if moved is None else [end(name, x + moved, moved=1e-4)]
    expected = [(changed, f"a.xml: {text}") for changed, text in found]
    assert list(of_scene(STEP, "a.xml", records)) == expected


def test_an_end_whose_moved_starts_crashed_is_no_change() -> None:
    records = [end(STEP.names[0], 0.0), end(STEP.names[1], 30.0)]
    records += [crashed(name, moved=1e-4) for name in STEP.names]
    told = "a.xml: bowl ends 30 mm elsewhere; no moved start ended in both, so it may be noise"
    assert list(of_scene(STEP, "a.xml", records)) == [(False, told)]


def test_ends_of_different_starts_are_no_change() -> None:
    told = "a.xml: no start ended in both, so nobody knows whether it ends elsewhere"
    records = [at(STEP.names[0], 2, 0.0), at(STEP.names[1], 3, 30.0)]
    assert list(of_scene(STEP, "a.xml", records)) == [(False, told)]
