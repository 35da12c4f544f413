"""A real arm's push on an engine: the hand goes where it went, and the cube about where it went."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_simbench.data import DataMissing, read
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.robot.model import RobotModel
from pytest_simbench.robot.panda import panda
from pytest_simbench.robot.tracking import track
from pytest_simbench.tasks import ArmPushing


def test_a_tool_is_tracked_to_a_micrometre_and_held_joints_stay() -> None:
    model = RobotModel(panda())
    start = model.robot.column("initial_position")[: model.arm]
    targets = [model.tool_pose(start).translated(x=0.002 * k, z=-0.001 * k) for k in range(20)]
    path = track(model, targets, start)
    for arm, target in zip(path, targets, strict=True):
        reached = model.tool_pose(arm)
        assert reached.position == pytest.approx(target.position, abs=1e-6)
        assert abs(np.dot(reached.quaternion, target.quaternion)) > 1 - 1e-8
    assert np.abs(np.diff(path, axis=0)).max() < 0.02


def test_the_cube_goes_where_the_real_one_went(case: Case) -> None:
    try:
        task = ArmPushing(read("arm_pushes"))
    except DataMissing as error:
        pytest.skip(str(error))
    record, error = Repetition(Experiment(case, task), 1).run()
    assert error is None
    assert record.details["hand_error"] < 1e-3  # rad
    assert record.metrics["displacement_error"] < 0.01
    assert record.metrics["turn_error"] < 5.0
    assert record.details["data"] == ["arm_pushes", task.run(record.seed).number]
    assert record.settings["task.half"] == "held_out"
    assert record.settings["task.calibrated_on"] == "CubeExp 1, 5, 9, 13, 17, 33"
    assert task.references["displacement"] == pytest.approx(0.095, abs=0.003)
