"""Opening: a perfect hand has no error, and what goes wrong shows where it should."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pytest_simbench.experiment.case import Case
from pytest_simbench.scene import FloatArray
from pytest_simbench.tasks import Jitter, Opening
from pytest_simbench.tasks.base import Outcome
from pytest_simbench.tasks.opening import BAR, DRAWER
from tests.conftest import case_of, performed
from tests.tasks.scripted import ScriptedProcess, perform

TASK = Opening()


class PerfectHand(ScriptedProcess):
    """Its drawer goes where the closed hand goes, by a share of that, and pulls with its friction
    times a factor; a push of more than the friction moves it by Coulomb's law."""

    def __init__(self, share: float = 1.0, factor: float = 1.0, drift: float = 0.0) -> None:
        super().__init__()
        self.share, self.factor, self.drift = share, factor, drift
        self.out, self.pull = 0.0, 0.0
        self.grasped: tuple[float, FloatArray] | None = None

    def do_follow(self, tick: float, effort: Any, **more: Any) -> dict[str, Any]:
        beyond = float(effort[0, -1]) - TASK.friction
        self.out += max(beyond, 0.0) / TASK.mass * tick**2 / 2
        return super().do_follow(tick=tick, effort=effort, **more)

    def _command(self, position: FloatArray) -> None:
        self.position = self.commanded = position
        hand = np.array(self.tool().position)
        closed = position[7] < BAR[0] / 2
        if not closed and self.grasped is not None:
            self.out += self.drift
        if not closed:
            self.grasped, self.pull = None, 0.0
        elif self.grasped is None:
            self.grasped = self.out, hand
        else:
            out = self.grasped[0] - self.share * float(hand[0] - self.grasped[1][0])
            if out > self.out + 1e-9:
                self.pull = self.factor * TASK.friction
            self.out = out
        self.position = np.array([*position[:-1], self.out])

    def do_contact_forces(self) -> list[tuple[str, str, FloatArray]]:
        pull = np.array([-self.pull, 0.0, 5.0, 0.0, 0.0, 0.0])
        return [("link/panda_leftfinger", f"link/{DRAWER}", -pull)]


def opened(task: Opening = TASK, **how: float) -> Outcome:
    return perform(task, jitter=Jitter(0.0, 0.0), process=PerfectHand(**how))[0]


def test_a_perfect_hand_has_no_error() -> None:
    outcome, process = perform(TASK, jitter=Jitter(0.0, 0.0), process=PerfectHand())
    found, right = outcome.metrics, dict(TASK.references)
    assert (process.counts, [*process.marks]) == ([(1, 1)], ["start", "end"])
    assert set(outcome.details["pulls"]) == {0.0, TASK.friction}
    assert set(found) == {metric.name for metric in TASK.metrics} == {*right, "peak"}
    assert found["work"] == pytest.approx(1.0, abs=0.01)  # the first look sees no pull yet
    right.pop("work")
    assert {name: found[name] for name in right} == pytest.approx(right, abs=1e-3)


def test_each_fault_shows_in_its_own_number() -> None:
    slipped = opened(share=0.9).metrics
    assert slipped["opened"] == 0.0
    assert slipped["slip"] == pytest.approx(15.0, abs=0.1)
    assert slipped["work"] == pytest.approx(1.0, abs=0.01)
    heavy = opened(factor=1.2).metrics
    assert (heavy["opened"], heavy["slip"]) == (1.0, pytest.approx(0.0, abs=1e-3))
    assert heavy["work"] == pytest.approx(1.2, abs=0.01)
    assert heavy["peak"] == pytest.approx(1.2)
    assert opened(drift=0.004).metrics["creep"] == pytest.approx(4.0)


@pytest.mark.parametrize("name", ["mujoco", "drake"])  # Drake told the forces of the next step
def test_on_an_engine(case: Case, name: str) -> None:
    task = Opening(rest=0.5)
    record = performed(case_of(case, name), task)
    found = record.metrics
    assert found["opened"] == 1.0
    assert found["work"] == pytest.approx(1.0, abs=0.01)
    assert found["peak"] == pytest.approx(1.0, abs=0.05)
    assert found["pushed"] == pytest.approx(task.references["pushed"], rel=0.05)
    assert max(found[name] for name in ("slip", "creep", "held_back")) < 1.0
