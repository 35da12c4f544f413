"""A scene beside a log of it: residuals at the log's times, of joints and of bodies."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pytest_simbench.client.motion import Motion
from pytest_simbench.scene import Box, Compound, Pose, Scene, Start, Trajectory
from pytest_simbench.tasks import Fitting, Log
from pytest_simbench.tasks import fitting as module
from tests.tasks.scripted import perform
from tests.tasks.scripted_scene import SCENE, Moved

TIME = np.array([0.0, 0.35, 1.0])
ROWS = np.zeros((2, 2))


def test_joints_are_held_against_the_log_at_its_own_times() -> None:
    seen = {"time": TIME, "slider": np.array([0.05, 0.1, 0.2])}
    log = Log(Trajectory(1.0, ROWS, ROWS, ROWS), ["slider"], Start((), ()), Start((), ()), "", seen)
    task = Fitting(SCENE, log, {"spring:slider": 3.0})
    outcome, _ = perform(task, process=Moved(end=(0.0, 0.05), speed=(0.0, 0.1)))
    found = np.array(outcome.details["residuals"]["slider"])
    assert found[:, 0] == pytest.approx([0.0, -0.05 - 0.065, -0.15])
    assert outcome.metrics == {"off": pytest.approx(1000 * math.sqrt((0.115**2 + 0.15**2) / 3))}
    assert [metric.name for metric in task.metrics] == ["off"]
    assert task.parameters()["task.spring:slider"] == 3.0


def test_of_bodies_the_centres_of_mass_are_held_whatever_frame_their_file_gives_them() -> None:
    """A table turns about its centre, the log has it 3 mm away; its frame lies 0.1 m beside it."""
    top = Box("top", (0.1, 0.1, 0.1), Pose())
    frame = Pose.at(0.1, 0, 0)
    table = Compound("table", (top,), Pose(), 1.0, moments=(0.01,) * 3, file_frame=frame)
    scene = Scene("table", (table,))
    rows = np.zeros((3, 1, 13))
    rows[:, 0, :7] = [Pose.at(1, 0, 0.3, yaw=0.4 * t).as_array() for t in (0.0, 0.5, 1.0)]
    logged = [Pose.at(1, 0.003 * t, 0.3, yaw=0.4 * t) * frame for t in (0.0, 1.0)]
    seen = {"time": np.array([0.0, 1.0]), "table/pose": np.array([p.as_array() for p in logged])}
    start = Start(("table",), (logged[0],))
    told = Trajectory(1.0, *(np.zeros((2, 0)),) * 3)
    task = Fitting(scene, Log(told, [], start, start, "", seen))
    found = task.residuals(Motion(np.array([2.0, 2.5, 3.0]), np.zeros((3, 2, 0)), rows), 2.0)
    wanted = np.array([[0.0, 0.0, 0.0], [0.0, -0.003, 0.0]])
    assert found == {"table/place": pytest.approx(wanted, abs=1e-12)}
    assert [metric.name for metric in task.metrics] == ["off"]


def test_of_a_long_log_not_every_row_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST", 2)
    seen = {"time": TIME, "slider": np.zeros(3)}
    log = Log(Trajectory(1.0, ROWS, ROWS, ROWS), ["slider"], Start((), ()), Start((), ()), "", seen)
    motion = Motion(np.array([0.0, 1.0]), np.zeros((2, 2, 2)), np.zeros((2, 0, 13)))
    assert len(Fitting(SCENE, log).residuals(motion)["slider"]) == 2
