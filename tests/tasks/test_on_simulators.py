"""The tasks on the real engines: small versions that must succeed, and picks that cannot."""

from __future__ import annotations

import shutil
from contextlib import closing
from dataclasses import dataclass, replace

import pytest

from pytest_simbench.client.display import Displays
from pytest_simbench.client.errors import Unavailable
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.simulator import Capability
from pytest_simbench.tasks import Jitter, Stacking, Throwing
from tests.conftest import ADAPTERS, able_to, case_of


@pytest.fixture(params=ADAPTERS)
def any_case(request: pytest.FixtureRequest, case: Case) -> Case:
    return case_of(case, request.param)


def test_two_cubes_are_stacked(any_case: Case) -> None:
    record, error = Repetition(Experiment(any_case, Stacking().smoke()), 1).run()
    assert error is None
    assert record.metrics["at_end_strict"] == 1.0
    assert record.metrics["untouched_moved"] == 0.0
    assert record.seconds["total"] >= sum(
        record.seconds[name] for name in ("launch", "load", "plan", "step")
    )


def test_the_throw_hits(any_case: Case) -> None:
    record, error = Repetition(Experiment(any_case, Throwing().smoke()), 1).run()
    assert error is None
    assert record.metrics["hit"] == 1.0
    assert record.metrics["lost_in_transit"] == 0.0
    assert record.metrics["landing_error"] is not None
    # within 3 cm; Genesis' contacts are softer (docs/engines/genesis.md)
    assert record.metrics["landing_error"] < (0.05 if any_case.simulator == "genesis" else 0.03)


def test_the_same_seed_gives_the_same_outcome(any_case: Case) -> None:
    first, second = (
        Repetition(Experiment(any_case, Throwing().smoke()), 2).run()[0] for _ in range(2)
    )
    assert first.metrics == second.metrics
    assert first.details["projectile_end"] == second.details["projectile_end"]


@dataclass(frozen=True)
class FarAway(Stacking):
    """Half of the cubes lie where the arm cannot reach them."""

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        scene = super().scene(seed, jitter)
        for k in range(1, 21, 2):
            scene = scene.with_pose(f"cube_{k:02d}", Pose.at(-2.0, 0.2 * k, 0.025))
        return scene


def test_unreachable_cubes_are_counted_and_the_task_goes_on(case: Case) -> None:
    record, error = Repetition(Experiment(case, FarAway(towers=1, levels=3, settle=0.5)), 3).run()
    assert error is None
    failed = record.details["failed_picks"]
    assert record.metrics["failed_picks"] == len(failed) >= 1
    assert all(pick["reason"].startswith("unreachable: tool at (-2.000") for pick in failed)
    assert record.metrics["at_end_strict"] == 1.0


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb: apt-get install xvfb")
@pytest.mark.parametrize("name", able_to(Capability.WINDOW))
def test_with_a_window_the_outcome_is_the_same(case: Case, name: str) -> None:
    headless, throw = case_of(case, name), Throwing(settle=1.0)
    displays = Displays()
    with closing(displays):
        gui = replace(headless, mode="gui", display=displays)
        with_window, error = Repetition(Experiment(gui, throw), 1).run()
    if isinstance(error, Unavailable):  # a driver that this machine lacks: a skip with its reason
        raise error
    assert error is None
    without, _ = Repetition(Experiment(headless, throw), 1).run()
    assert with_window.metrics == without.metrics
    assert with_window.details["projectile_end"] == without.details["projectile_end"]
