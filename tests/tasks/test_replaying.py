"""A log that drives follow: what is measured, and that a run follows itself."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.scene_file import read_scene_file
from pytest_simbench.recordings.logs import read_log
from pytest_simbench.scene import Box, Pose, SceneError, Start, Trajectory
from pytest_simbench.tasks import Log, Replaying
from pytest_simbench.tasks.replaying import turn
from tests.conftest import case_of, performed
from tests.tasks.scripted import Mishap, move, perform
from tests.tasks.scripted_scene import SCENE, Moved
from tests.tasks.test_holding import ARM

NOTHING = Start((), ())
BESIDE = replace(SCENE, bodies=(Box("box", (0.1,) * 3, Pose.at(1.0, 0.0, 0.05), 1.0),))


def log_of(joints: list[str], columns: int = 2) -> Log:
    """Both joints go from 0 to 1 in a second."""
    rows = np.linspace([0.0] * columns, [1.0] * columns, 11)
    told = Trajectory(0.1, rows, 0 * rows, 0 * rows)
    return Log(told, joints, Start((), (), (0.0, 0.0)), NOTHING, "digest")


def test_the_error_is_held_against_the_log_at_each_sample() -> None:
    """Joints that stand at 0 while the log goes to 1: the root mean square of a ramp is 1 / √3."""
    task, shove = Replaying(BESIDE, log_of(["hinge", "slider"])), move("box", y=0.03)
    outcome, _ = perform(task, Mishap("follow", 0.5, shove), process=Moved(end=(0.0, 0.0)))
    metrics = outcome.metrics
    assert metrics == pytest.approx({
        "farthest": 30.0,
        "error_hinges": math.degrees(1 / math.sqrt(3)), "worst_hinges": math.degrees(1.0),
        "error_sliders": 1000 / math.sqrt(3), "worst_sliders": 1000.0,
    }, rel=0.01)  # fmt: skip
    assert set(metrics) == {metric.name for metric in task.metrics}
    places = {"box": [1.0, 0.03, 0.05, 1.0, 0.0, 0.0, 0.0]}
    assert outcome.details == {"joints": {"hinge": 0.0, "slider": 0.0}, "places": places}


def test_the_error_is_held_against_what_was_measured_where_commands_are_known() -> None:
    seen = {"time": np.array([0.0, 1.0]), "hinge": np.array([0.0, 0.5])}
    end = Start(("box",), (Pose.at(1.0, 0.04, 0.05, yaw=0.2),))
    task = Replaying(BESIDE, replace(log_of(["hinge"]), told=["hinge"], seen=seen, end=end))
    metrics = perform(task, process=Moved(end=(0.0, 0.0)))[0].metrics
    told = {"error_hinges": math.degrees(0.5 / math.sqrt(3)), "worst_hinges": math.degrees(0.5)}
    assert metrics == pytest.approx({**told, "off": 40, "turned": math.degrees(0.2)}, rel=0.01)


def test_joints_that_the_log_does_not_name_are_not_measured() -> None:
    task = Replaying(SCENE, log_of(["slider"]))
    assert [metric.name for metric in task.metrics] == ["error_sliders", "worst_sliders"]
    told = {"task.log": "digest", "task.log_joints": ["slider"], "task.seconds": 1.0}
    told |= {"task.scene_digest": task.parameters()["task.scene_digest"], "task.starts": 1}
    assert task.parameters() == {**told, "task.scene": "two joints"}


def test_a_log_of_another_scene_is_refused() -> None:
    for log in (log_of(["knee"]), log_of(["hinge"], columns=3)):
        with pytest.raises(SceneError, match="read the log for this scene"):
            Replaying(SCENE, log)


def test_turns_are_angles_whatever_the_quaternions_signs() -> None:
    a, b = Pose.at(0, 0, 0, yaw=0.2), Pose.at(1, 0, 0, yaw=0.5)
    flipped = Pose(b.position, tuple(-q for q in b.quaternion))
    assert turn(a, b) == turn(b, a) == turn(a, flipped) == pytest.approx(math.degrees(0.3))
    assert turn(a, a) == 0.0


@pytest.mark.engine
@pytest.mark.parametrize("profile", ["tuned", "file"])
def test_an_arm_follows_a_slow_log_and_a_ball_that_rests_stays(
    tmp_path: Path, case: Case, profile: str
) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    scene, time = read_scene_file(path).scene, np.linspace(0, 2, 101)
    ball = np.tile([1.0, 0, 0.05, 1, 0, 0, 0], (101, 1))
    slow = 0.1 * (1 - np.cos(np.pi * time / 2))
    columns = {"rail": 0.1 + slow, "elbow": -slow, "elbow/velocity": -np.gradient(slow, time)}
    np.savez(tmp_path / "log.npz", time=time, **columns, **{"ball/pose": ball})
    case = replace(case_of(case, "mujoco"), profile=profile)
    task = Replaying(scene, read_log(tmp_path / "log.npz", scene))
    metrics = performed(case, task).metrics
    assert 1.2 < metrics["error_hinges"] < 1.5  # the sag of its spring: 1.4 degrees
    assert 0.5 < metrics["worst_sliders"] < 40  # a drive without a velocity lags by d v / k
    assert metrics["off"] < 1.0
    assert metrics["turned"] < 1.0
    ball[-1, :2] += 0.3, 0.4
    np.savez(tmp_path / "log.npz", time=time, **columns, **{"ball/pose": ball})
    task = Replaying(scene, read_log(tmp_path / "log.npz", scene))
    assert performed(case, task).metrics["off"] == pytest.approx(500.0, abs=1.0)
