"""Protocols and the record of a repetition."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_simbench.session.case import Case
from pytest_simbench.session.protocol import PROTOCOLS
from pytest_simbench.session.repetition import Repetition
from pytest_simbench.tasks import Stacking
from tests.tiny import Falling


def test_paper_runs_in_real_time_and_records_before(case: Case) -> None:
    paper = replace(PROTOCOLS["paper"], before=1.0)
    record, error = Repetition(replace(case, protocol=paper), Falling(duration=1.5), 1).run()
    assert error is None
    began, ended = record.timeline["start"], record.timeline["end"]
    assert began > 1.0
    assert 1.45 < ended - began < 3.0
    assert record.resources["phases"]["before"]["samples"] >= 7
    assert record.stepping["wall"] < 0.5  # waiting for the clock is not the simulator's time


def test_phases_follow_each_other(case: Case) -> None:
    phases: list[str] = []
    Repetition(case, Falling(), 1, on_phase=phases.append).run()
    assert [name for k, name in enumerate(phases) if phases[k - 1 : k] != [name]] == [
        *("launch", "load", "launch", "task", "fall", "task"),
    ]


def test_fast_does_not_wait(case: Case) -> None:
    record, _ = Repetition(case, Falling(duration=100.0), 1).run()
    assert record.timeline["end"] - record.timeline["start"] < 50.0


def test_smoke_shrinks_the_task(case: Case) -> None:
    repetition = Repetition(replace(case, protocol=PROTOCOLS["smoke"]), Stacking(), 1)
    assert repetition.task == Stacking(towers=1, levels=2, settle=2.0)


def test_a_record_says_what_it_was(case: Case) -> None:
    case = replace(case, changes={"timestep": "0.002"}, seed=7, jitter=0.5)
    record, _ = Repetition(case, Falling(), 3).run()
    assert (record.seed, record.repetition, record.jitter) == (9, 3, 0.5)
    assert record.settings["timestep"] == 0.002
    assert record.settings["task.duration"] == 0.6
    assert {"mujoco", "python", "pytest-simbench"} <= set(record.versions)
    assert record.stepping["simulated"] == pytest.approx(0.6)
    assert record.resources["rss_mb"]["peak"] > 20
    assert set(record.seconds) == {*("launch", "compile", "load", "plan", "step", "other", "total")}
    assert record.details["log"].startswith("logs/")


def test_zero_jitter_repeats_the_nominal_scene(case: Case) -> None:
    ends = [Repetition(replace(case, jitter=0.0), Falling(), n).run()[0] for n in (1, 2)]
    assert ends[0].metrics == ends[1].metrics
