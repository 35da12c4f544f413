"""Carrying: the load is the share of the bound that it says, and a perfect hand has no error."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from pytest_simbench.experiment.case import Case
from pytest_simbench.motion.registry import known_robot
from pytest_simbench.scene import STANDARD_GRAVITY
from pytest_simbench.tasks import Carrying, Jitter, Slipping, carrying
from pytest_simbench.tasks.base import Outcome
from pytest_simbench.tasks.carrying import ACCELERATION, FRICTION, Shape
from tests.conftest import performed
from tests.tasks.scripted import Mishap, ScriptedProcess, perform, slip

TASK = Carrying(still=1.0)


def carried(*script: Mishap, task: Carrying = TASK) -> tuple[Outcome, ScriptedProcess]:
    return perform(task, *script, jitter=Jitter(0.0, 0.0))


def test_a_perfect_hand_has_no_error() -> None:
    outcome, _ = carried()
    assert set(outcome.metrics) == set(TASK.references)
    assert (outcome.metrics.pop("held"), outcome.metrics.pop("force_jitter")) == (1.0, None)
    assert outcome.metrics == pytest.approx(dict.fromkeys(outcome.metrics, 0.0), abs=1e-4)


def test_what_slips_and_what_creeps_are_told_apart() -> None:
    slips = Mishap("shake", 0.5, slip(z=-0.003)), Mishap("hold", 0.2, slip(z=-0.002))
    outcome, process = carried(*slips)
    assert outcome.metrics["slip"] == pytest.approx(3.0, abs=1e-3)
    assert outcome.metrics["creep"] == pytest.approx(2.0 * 60, abs=0.1)
    looks = np.array(outcome.details["in_hand"])
    assert np.diff(looks[:, 2]) == pytest.approx([-0.003, -0.002], abs=1e-6)
    assert (process.counts, [*process.marks]) == ([(1, 1)], ["start", "end"])
    fallen, process = carried(Mishap("carry", 0.5, slip(z=-0.05)))
    assert process.counts == [(0, 1)]
    assert fallen.metrics == {"held": 0.0}
    assert fallen.reasons == ("thing is not in the hand",)


def test_nothing_on_the_way_pulls_harder_than_the_shaking() -> None:
    """So the load is the share of 2 mu N that it says: from lifting on, what the tool is told to do
    takes at most g + a of it."""
    _, process = carried()
    most = ACCELERATION - STANDARD_GRAVITY[2]
    assert TASK.mass * most == pytest.approx(TASK.load * 2 * FRICTION * TASK.arm.gripper.squeeze)
    model, after = process.model, False
    pulls = []
    for asked in process.asked:
        if asked.kind == "follow" and after:
            rows, tick = asked.arguments["position"], asked.arguments["tick"]
            way = np.array([model.tool_pose(row[: model.arm]).position for row in rows])
            twice = np.diff(way, 2, axis=0) / tick**2
            pulls.append(float(np.linalg.norm(twice - STANDARD_GRAVITY, axis=1).max()))
        after = after or (asked.kind == "follow" and asked.arguments["position"][-1, -1] == 0.0)
    assert len(pulls) == 4  # lifted, there, back, shaken
    assert max(pulls) == pulls[-1] == pytest.approx(most, rel=0.01)


@pytest.mark.parametrize("shape", get_args(Shape))
def test_all_shapes_are_as_wide_and_reach_the_ground(shape: Shape) -> None:
    (body,) = Carrying(shape).scene(1, Jitter(0.0, 0.0)).free_bodies
    up = (0.0, 0.0, 1.0)
    reach = body.reach_placed(np.array([up, tuple(-np.array(up))]))
    assert reach[1] == pytest.approx(0.0, abs=1e-9)
    for robot in (None, *map(known_robot, ("ur5", "ur10", "xarm7"))):
        assert Carrying(shape, robot=robot).problem() is None


@pytest.mark.parametrize("task", [TASK, Slipping(still=1.0)], ids=lambda task: task.name)
def test_on_an_engine(case: Case, task: Carrying) -> None:
    record = performed(case, task)
    assert record.metrics["held"] == task.references["held"]


def test_who_holds_what_is_too_heavy_is_told_no_more() -> None:
    outcome, _ = carried(task=Slipping(still=1.0))
    assert outcome.metrics == {"held": 1.0}


def test_an_arm_that_cannot_get_there_lets_nothing_slip(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(carrying, "WAY", 5.0)
    for task, metrics in ((Carrying(still=1.0), {"held": 0.0}), (Slipping(still=1.0), {})):
        assert "cannot carry the cube: unreachable: straight line" in (task.problem() or "")
        outcome, _ = carried(task=task)
        assert outcome.metrics == metrics
        assert outcome.reasons[0].startswith("unreachable: straight line")
