"""What a TOML file changes in a URDF: joints without end, joints that stand still, the tool."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pytest_simbench.description.robot_files import folder
from pytest_simbench.description.urdf import pose_of_rpy
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.motion.adapting import bound_joints, with_tool
from pytest_simbench.motion.errors import RobotError
from pytest_simbench.motion.files import read_robot
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.registry import ARMS
from pytest_simbench.scene import Pose
from pytest_simbench.simulator import PreparedRobot
from pytest_simbench.tasks import Pushing
from tests.conftest import measured
from tests.motion.small_arm import TOML, URDF, small_arm, still

MICO = Path(__file__).parents[2] / "docs" / "extending" / "mico2.toml"


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=8)
@given(left=st.floats(0, 0.05), right=st.floats(0, 0.05), seed=st.integers(0, 99))
def test_locked_joints_stand_where_the_moving_ones_would(
    tmp_path: Path, left: float, right: float, seed: int
) -> None:
    """Placements of the fingers, from the arm with moving fingers and from that with fixed ones."""
    moving = RobotModel(read_robot(small_arm(tmp_path)))
    robot = read_robot(small_arm(tmp_path, still(left, right)))
    assert robot.joint_names == ("turn", "lift", "bend")
    arm = np.random.default_rng(seed).uniform(-2, 2, 3)
    pin.forwardKinematics(moving.pin, moving.data, np.array([*arm, left, right]))
    fixed = RobotModel(robot)
    pin.forwardKinematics(fixed.pin, fixed.data, arm)
    for finger in ("left", "right"):
        found, expected = (
            pin.updateFramePlacement(model.pin, model.data, model.pin.getFrameId(finger))
            for model in (fixed, moving)
        )
        assert np.allclose(found.homogeneous, expected.homogeneous, atol=1e-9)


def test_a_link_that_only_marks_a_frame_has_no_mass(tmp_path: Path) -> None:
    """As onshape-to-robot writes it: a billionth of a kilogram, and no inertia. A body of that kind
    is refused all the same."""
    nothing = """<inertial><mass value="1e-9"/>
      <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>"""
    urdf = URDF.replace('<link name="grip"/>', f'<link name="grip">{nothing}</link>')
    told, plain = (RobotModel(read_robot(small_arm(tmp_path, TOML, text))) for text in (urdf, URDF))
    assert told.pin.inertias[told.arm].mass == plain.pin.inertias[plain.arm].mass
    shape = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
    with pytest.raises(RobotError, match="'grip' has the principal moments 0, 0, 0"):
        read_robot(small_arm(tmp_path, TOML, urdf.replace(nothing, nothing + shape)))
    with pytest.raises(RobotError, match="'grip' has <mass value=''>; give a number"):
        read_robot(small_arm(tmp_path, TOML, urdf.replace(' value="1e-9"', "")))


def test_a_locked_joint_may_lack_what_the_urdf_has_a_default_for(tmp_path: Path) -> None:
    """Limits and axis; what is there must be numbers."""
    joint = URDF[URDF.index('<joint name="left_finger"') : URDF.index('<link name="right"')]
    bare = joint.replace(joint[joint.index("<axis") : joint.index("</joint>")], "")
    model = RobotModel(read_robot(small_arm(tmp_path, still(0.3, 0.0), URDF.replace(joint, bare))))
    places = [model.pin.frames[model.pin.getFrameId(name)].placement for name in ("left", "right")]
    assert (places[0].translation - places[1].translation).tolist() == pytest.approx([0.3, 0, 0])
    for old, told in (
        ('lower="0.0" ', r"'left_finger' has the limits \('', '0.05'\); give 2 numbers"),
        ('axis xyz="0', "'left_finger' has <axis xyz='x 1 0'>; give 3 numbers"),
    ):
        urdf = URDF.replace(joint, joint.replace(old, 'axis xyz="x' if "axis" in old else ""))
        with pytest.raises(RobotError, match=told):
            read_robot(small_arm(tmp_path, still(0.0, 0.0), urdf))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=8)
@given(angle=st.floats(-2.5, 2.5), seed=st.integers(0, 99))
def test_a_locked_turning_joint_stands_at_its_angle(
    tmp_path: Path, angle: float, seed: int
) -> None:
    """About an axis that is none of the joint's three, of a joint that is turned itself."""
    urdf = URDF.replace(
        '<origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>',
        '<origin xyz="0 0 0.3" rpy="0.2 -0.3 0.4"/><axis xyz="0.6 0 0.8"/>', 1
    )  # fmt: skip
    assert urdf != URDF
    toml = TOML.replace(', "bend"]', "]").replace("0.4, 1.2]", "0.4]")
    toml = toml[: toml.index("[hand]")].replace("[200.0, 200.0, 150.0]", "200.0")
    toml = toml.replace("[arm]", "[arm]\nlevers = 1.0")  # the tool lies in the last joint's axis
    toml += '[hand]\ntool_frame = "upper"\n[locked]\nleft_finger = 0\nright_finger = 0\n'
    moving = RobotModel(read_robot(small_arm(tmp_path, urdf=urdf)))
    fixed = RobotModel(read_robot(small_arm(tmp_path, f"{toml}bend = {angle}\n", urdf)))
    arm = np.random.default_rng(seed).uniform(-2, 2, 2)
    pin.forwardKinematics(moving.pin, moving.data, np.array([*arm, angle, 0, 0]))
    pin.forwardKinematics(fixed.pin, fixed.data, arm)
    found, expected = (
        pin.updateFramePlacement(model.pin, model.data, model.pin.getFrameId("lower"))
        for model in (fixed, moving)
    )
    assert np.allclose(found.homogeneous, expected.homogeneous, atol=1e-9)


@pytest.mark.parametrize(
    ("limit", "lower", "upper"),
    [("", -2 * np.pi, 2 * np.pi), ('lower="-9" upper="8"', -9.0, 8.0)],
)
def test_a_joint_without_end_gets_limits(
    tmp_path: Path, limit: str, lower: float, upper: float
) -> None:
    urdf = URDF.replace(
        '<joint name="turn" type="revolute">', '<joint name="turn" type="continuous">'
    ).replace('lower="-2.5" upper="2.5"', limit, 1)
    model = RobotModel(read_robot(small_arm(tmp_path, urdf=urdf)))
    assert model.lower[0] == pytest.approx(lower)
    assert model.upper[0] == pytest.approx(upper)


def test_limits_are_made_where_there_are_none() -> None:
    urdf = ET.fromstring('<robot><joint type="continuous"/></robot>')
    assert (bound_joints(urdf), bound_joints(urdf)) == (True, False)
    assert urdf[0][0].attrib == {"lower": repr(-2 * np.pi), "upper": repr(2 * np.pi)}


def test_the_tool_centre_point_may_lie_beside_a_link(tmp_path: Path) -> None:
    xyz, rpy = (0.01, 0.02, 0.03), (0.1, 0.2, 0.3)
    plain = RobotModel(read_robot(small_arm(tmp_path)))
    toml = TOML + f"xyz = {list(xyz)}\nrpy = {list(rpy)}\n"
    moved = read_robot(small_arm(tmp_path, toml))
    for arm in np.random.default_rng(1).uniform(-2, 2, (5, 3)):
        expected = plain.tool_pose(arm) * pose_of_rpy(xyz, rpy)
        found = RobotModel(moved).tool_pose(arm)
        assert found.position == pytest.approx(expected.position, abs=1e-9)
        turned = (expected.inverse() * found).quaternion
        assert abs(turned[0]) == pytest.approx(1.0, abs=1e-12)
    assert PreparedRobot(moved).links.keys() == PreparedRobot(plain.robot).links.keys()


def test_what_is_read_lies_in_the_folder_of_this_machine_with_its_meshes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A hand mounted on an arm, hulls, and a tool beside a link, where nothing was kept before."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder.cache_clear()
    try:
        for name in ("ur5", "so101"):
            robot = read_robot(ARMS / f"{name}.toml")
            for each in (robot, with_tool(robot, Pose(), "tip", "to_tip")):
                links = PreparedRobot(each).links.values()
                meshes = [shape.mesh for link in links for shape in link.shapes if shape.mesh]
                assert len(meshes) >= 8
                assert {Path(file).parent for file in (*meshes, each.urdf)} == {folder()}
                assert folder().is_relative_to(tmp_path)
    finally:
        folder.cache_clear()


def test_an_arm_from_outside_pushes_from_a_file_alone(case: Case, tmp_path: Path) -> None:
    """The Mico2 of the measured pushes: joints without end, three fingers, its tool at no link."""
    folder = measured("arm_pushes").urdf.parent
    text = MICO.read_text(encoding="utf-8")
    text = text.replace('urdf = "', f'urdf = "{folder}/').replace('= "."', f'= "{folder}"')
    file = tmp_path / "mico2.toml"
    file.write_text(text, encoding="utf-8")
    robot = read_robot(file)
    assert len(robot.joint_names) == 6
    assert Pose.at(*robot.base.position) == Pose.at(0.1, 0.0, 0.055)
    task = Pushing(robot=robot, length=0.05)
    assert task.problem() is None
    record, error = Repetition(Experiment(case, task), 1).run()
    assert error is None
    assert "failed_push" not in record.details
    assert record.metrics["position_error"] < 0.01
