"""The tasks on the real engines: small versions that must succeed, and picks that cannot."""

from __future__ import annotations

import shutil
from contextlib import closing
from dataclasses import replace

import pytest

from pytest_simbench.client.display import Displays
from pytest_simbench.client.errors import Unavailable
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.records.configuration import agree, differences
from pytest_simbench.records.notes import Wait
from pytest_simbench.records.record import Record
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks import Stacking, Throwing
from tests.conftest import ADAPTERS, able_to, case_of, performed

THROW = Throwing(settle=1.0)

_thrown: dict[str, tuple[Record, Exception | None]] = {}


@pytest.fixture(params=ADAPTERS)
def any_case(request: pytest.FixtureRequest, case: Case) -> Case:
    return case_of(case, request.param)


def thrown(case: Case) -> tuple[Record, Exception | None]:
    """The first throw of this engine: made once for all tests, slow engines take minutes."""
    if case.simulator not in _thrown:
        _thrown[case.simulator] = Repetition(Experiment(case, THROW), 1).run()
    return _thrown[case.simulator]


def test_two_cubes_are_stacked(any_case: Case) -> None:
    record = performed(any_case, Stacking().smoke())
    assert record.metrics["at_end_strict"] == 1.0
    assert record.metrics["untouched_moved"] == 0.0
    assert record.seconds["total"] >= sum(
        record.seconds[name] for name in ("launch", "load", "plan", "step")
    )


def test_the_throw_hits(any_case: Case) -> None:
    record, error = thrown(any_case)
    assert error is None
    assert record.metrics["hit"] == 1.0
    assert record.metrics["lost_in_transit"] == 0.0
    # within 3 cm; Genesis' contacts are softer (docs/engines/genesis.md)
    assert record.metrics["landing_error"] < (0.05 if any_case.simulator == "genesis" else 0.03)


def test_a_shorter_wait_changes_no_count_and_is_never_pooled_with_a_full_one(case: Case) -> None:
    short, full = (
        Repetition(Experiment(case, Throwing(settle=6.0, full_wait=full)), 1).run()[0]
        for full in (False, True)
    )
    for name in ("moved", "hit", "moved_otherwise"):
        assert short.metrics[name] == full.metrics[name] is not None
    wait = Record.from_json(short.to_json()).notes.wait
    assert (wait.seconds, wait.of, wait.reach < wait.slack) == (pytest.approx(2.0), 6.0, True)
    assert full.notes.wait == Wait(pytest.approx(6.0), 6.0)
    assert short.stepping["simulated"] == full.stepping["simulated"]
    assert not agree(short, full)
    assert "settings.task.full_wait was false, is true" in differences({"a": ([short], [full])})[0]


def test_the_same_seed_gives_the_same_outcome(any_case: Case) -> None:
    first, second = thrown(any_case)[0], Repetition(Experiment(any_case, THROW), 1).run()[0]
    assert first.metrics == second.metrics
    assert first.details["projectile_end"] == second.details["projectile_end"]


DRAWN = [
    name
    for name in able_to(Capability.WINDOW)
    if name in able_to(Capability.DETERMINISTIC) and not adapter(name).info.costly_start
]
"""Of a slow engine the kit asks the same with a shorter motion (`window_changes_nothing`)."""


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb: apt-get install xvfb")
@pytest.mark.parametrize("name", DRAWN)
def test_with_a_window_the_outcome_is_the_same(case: Case, name: str) -> None:
    headless = case_of(case, name)
    displays = Displays()
    with closing(displays):
        # a busy machine draws in software for many seconds before the first step
        gui = replace(headless, mode="gui", display=displays, stall_timeout=120.0)
        with_window, error = Repetition(Experiment(gui, THROW), 1).run()
    if isinstance(error, Unavailable):  # a driver that this machine lacks: a skip with its reason
        raise error
    assert error is None
    without, _ = thrown(headless)
    assert with_window.metrics == without.metrics
    assert with_window.details["projectile_end"] == without.details["projectile_end"]
