"""A real arm's push on an engine: the hand goes where it went, and the cube about where it went."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pytest_simbench.data import DataError
from pytest_simbench.experiment.case import Case
from pytest_simbench.motion.kinematics import track
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.tasks import ArmPushing
from pytest_simbench.tasks.arm_pushing import CUBE, TICK, compared, described, each_tick
from tests.conftest import measured, performed
from tests.tasks.scripted import Mishap, move, perform

URDF = """<robot name="arm">
  <joint name="m1n6s300_joint_1" type="continuous"><limit lower="-6" upper="6"/></joint>
  <joint name="m1n6s300_joint_finger_1" type="revolute">
    <origin rpy="0.1 0.2 0.3" xyz="0 0 1"/><axis xyz="0 0 1"/>
  </joint>
  <joint name="m1n6s300_joint_finger_tip_1" type="fixed"><origin rpy="0 0 0" xyz="0 0 1"/></joint>
</robot>"""


def test_the_arm_is_described_as_engines_take_it(tmp_path: Path) -> None:
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(URDF)
    joints = list(ET.fromstring(described(urdf, 0.5)))
    assert [joint.get("type") for joint in joints] == ["revolute", "fixed", "fixed"]
    before, after = (
        Rotation.from_euler("xyz", [float(part) for part in text.split()])
        for text in ("0.1 0.2 0.3", joints[1].find("origin").get("rpy"))
    )
    assert (before.inv() * after).as_rotvec() == pytest.approx([0.0, 0.0, 0.5])


def test_what_is_no_urdf_is_told(tmp_path: Path) -> None:
    urdf = tmp_path / "arm.urdf"
    urdf.write_text("<robot>")
    with pytest.raises(DataError, match="no robot description"):
        described(urdf, 0.5)


def test_a_tool_is_tracked_to_a_micrometre_and_held_joints_stay() -> None:
    model = RobotModel(panda())
    start = model.home
    targets = [model.tool_pose(start).translated(x=0.002 * k, z=-0.001 * k) for k in range(20)]
    path = track(model, targets, start)
    for arm, target in zip(path, targets, strict=True):
        reached = model.tool_pose(arm)
        assert reached.position == pytest.approx(target.position, abs=1e-6)
        assert abs(np.dot(reached.quaternion, target.quaternion)) > 1 - 1e-8
    assert np.abs(np.diff(path, axis=0)).max() < 0.02


def test_the_hand_is_told_where_the_real_one_went_and_how_fast() -> None:
    task = ArmPushing(measured("arm_pushes"))
    outcome, process = perform(task, Mishap("push", 2.0, move(CUBE, x=0.05)))
    assert outcome.metrics["displacement"] == pytest.approx(0.05)
    assert outcome.details["hand_error"] == pytest.approx(0.0, abs=1e-9)
    told = process.asked[0].arguments
    ways, speeds = np.diff(told["position"], axis=0), told["velocity"]
    assert ways == pytest.approx(TICK * (speeds[1:] + speeds[:-1]) / 2, abs=1e-4)
    assert np.abs(told["effort"]).max() > 1.0  # it carries itself
    assert task.parameters()["task.calibrated_on"] == "CubeExp 1, 5, 9, 13, 17, 33"


def test_the_cube_goes_where_the_real_one_went(case: Case) -> None:
    task = ArmPushing(measured("arm_pushes"))
    record = performed(case, task)
    assert record.details["hand_error"] < 1e-3  # rad
    assert record.metrics["displacement_error"] < 0.01
    assert record.metrics["turn_error"] < 5.0
    assert record.notes.sample == ("arm_pushes", task.real(record.seed).number)
    assert record.settings["task.half"] == "held_out"
    assert record.settings["task.calibrated_on"] == "CubeExp 1, 5, 9, 13, 17, 33"
    assert task.references["displacement"] == pytest.approx(0.095, abs=0.003)


def test_each_metric_is_of_its_axis_and_turns_are_within_half_a_turn() -> None:
    """Along x by 100 mm and by 80 mm in half of the time, aside by 50 mm; from 170 degrees on
    turned by 30, and by -10; then by 175 and by -175, which are 10 degrees apart."""

    def way(x: float, y: float, turn: float, rows: int = 101) -> FloatArray:
        shares = np.minimum(np.linspace(0.0, 100.0 / 101 * rows, rows) / 50.0, 1.0)
        poses = (
            Pose.at(0.4 + s * x, 0.2 + s * y, 0.02, yaw=np.radians(170 + s * turn)) for s in shares
        )
        return np.array([pose.as_array() for pose in poses])

    metrics, details = compared(way(0.08, 0.05, -10.0), way(0.1, 0.0, 30.0))
    assert metrics["displacement"] == pytest.approx(0.08)
    assert metrics["displacement_error"] == pytest.approx(0.02)
    assert metrics["turn_error"] == pytest.approx(40.0)
    delay = details.pop("delay")  # 0.05 m on a way of 0.08 and of 0.1 m, in half a second
    assert delay == pytest.approx(0.5 * (0.05 / 0.08 - 0.05 / 0.1), abs=0.01)
    assert details == pytest.approx({"turn": -10.0, "real_turn": 30.0, "real_displacement": 0.1})
    share = (50 / 2 + 51) / 101  # on the way, and at its end
    assert metrics["way_error"] == pytest.approx(share * np.hypot(0.02, 0.05), rel=0.01)
    turned = compared(way(0.1, 0.0, 175.0), way(0.1, 0.0, -175.0, rows=90))[0]
    assert turned["turn_error"] == pytest.approx(10.0)
    until_the_end = compared(way(0.08, 0.0, 0.0, rows=51), way(0.1, 0.0, 0.0, rows=51))
    assert until_the_end[1]["real_displacement"] == pytest.approx(0.1)


@pytest.mark.parametrize("step", [1 / 240, 0.008, 0.016])
def test_a_motion_is_compared_at_the_times_of_the_recording(step: float) -> None:
    time = np.arange(0.0, 1.0 + step / 2, step)
    states = np.array([Pose.at(t, 0.0, 0.0, yaw=3.0 * t).as_array() for t in time])
    rows = each_tick(time, states)
    for k in (0, 1, 37, 99):
        wanted = Pose.at(k * TICK, 0.0, 0.0, yaw=3.0 * k * TICK)
        assert abs(np.dot(rows[k, 3:], wanted.quaternion)) == pytest.approx(1.0)
        assert rows[k, :3] == pytest.approx(wanted.position, abs=step / 2)
    assert len(rows) == 1 + round(time[-1] / TICK)
