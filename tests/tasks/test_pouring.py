"""Pouring: all balls begin in the cup, and each that is elsewhere than it may be counts."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_simbench.experiment.case import Case
from pytest_simbench.scene import Pose
from pytest_simbench.tasks import Jitter, Pouring
from pytest_simbench.tasks.pouring import RADIUS, SPACING, TRAY
from tests.conftest import performed
from tests.tasks.scripted import Mishap, perform, put


@pytest.mark.parametrize("balls", [1, 6, 10, 30, 100])
def test_all_begin_in_the_cup_apart_from_each_other(balls: int) -> None:
    task = Pouring(balls)
    scene = task.scene(7, Jitter())
    centres = np.array([body.pose.position for body in scene.free_bodies if body.mass])
    assert len(centres) == balls
    assert task.within(task.cup().pose, centres).all()
    gaps = np.linalg.norm(centres[:, None] - centres[None], axis=2) + np.eye(balls)
    assert gaps.min() >= 2 * RADIUS or balls == 1
    wall = task.side * SPACING / 2 + 0.001
    assert np.abs(centres[:, :2]).max() + RADIUS < wall


def test_what_leaks_and_what_misses_the_tray_is_counted() -> None:
    task = Pouring(4)
    tray = {f"ball_0{k}": Pose.at(0.05 * k, 0.0, RADIUS) for k in (1, 2, 3, 4)}
    under, beside = Pose.at(0.0, 0.0, 0.2), Pose.at(TRAY / 2 + 0.05, 0.0, RADIUS)
    outcome, process = perform(
        task,
        Mishap("lean", 0.1, put("ball_01", under)),
        *(Mishap("pour", 0.1, put(name, pose)) for name, pose in tray.items()),
        Mishap("settle", 0.1, put("ball_02", beside)),
        Mishap("settle", 0.1, put("ball_03", Pose.at(0, 0, 0.2))),
    )
    assert outcome.metrics == {"in_tray": 0.5, "leaked": 0.25}
    assert (process.counts, [*process.marks]) == ([(2, 4)], ["start", "end"])


def test_on_an_engine(case: Case) -> None:
    record = performed(case, Pouring().smoke())
    assert record.metrics == {"in_tray": 1.0, "leaked": 0.0}
