"""Links of the reduced robot: where they stand, loops of them, and which of them collide."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from pytest_simbench.description.links import (
    borne,
    check_apart,
    check_robot,
    ends,
    frames,
    joined,
    link_poses,
    links_collide,
    motion_subspace,
    opening,
    reduced,
)
from pytest_simbench.laws.base import Law
from pytest_simbench.laws.domino import DominoWave
from pytest_simbench.laws.loops import FourBarClosure
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.parity.quantities import expected_quantities
from pytest_simbench.scene import Closure, Pose, Robot, Scene, SceneError
from pytest_simbench.simulator import DescriptionError, NotSupportedError, PreparedRobot
from pytest_simbench.simulator.info import check_supported
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.simulator.settings import Settings


def test_a_pair_of_an_unknown_link_is_named_with_those_there_are() -> None:
    scene = Scene("s", robot=ROBOT, apart=(("ground", "link/elbow"),))
    with pytest.raises(SceneError, match="'link/elbow' is kept apart, .* no such link; .*link4"):
        check_apart(scene, PREPARED)
    check_apart(replace(scene, apart=(("ground", "link/panda_link4"),)), PREPARED)


ROBOT = panda(base=Pose.at(0.2, -0.1, 0.3, yaw=0.7))
PREPARED, MODEL = PreparedRobot(ROBOT), RobotModel(ROBOT)


@pytest.mark.parametrize("seed", range(3))
def test_poses_are_pinocchios(seed: int) -> None:
    q = np.random.default_rng(seed).uniform(-1.0, 1.0, len(ROBOT.joints))
    poses = link_poses(PREPARED, q)
    data = MODEL.pin.createData()
    pin.forwardKinematics(MODEL.pin, data, q)
    for joint in PREPARED.joints:
        placement = MODEL.base * data.oMi[MODEL.pin.getJointId(joint.name)]
        np.testing.assert_allclose(poses[joint.child].matrix(), placement.homogeneous, atol=1e-9)


def test_axes_are_pinocchios() -> None:
    q = np.random.default_rng(0).uniform(-1.0, 1.0, len(ROBOT.joints))
    data = MODEL.pin.createData()
    for joint in PREPARED.joints:
        index = MODEL.pin.getJointId(joint.name)
        jacobian = pin.computeJointJacobian(MODEL.pin, data, q, index)
        column = jacobian[:, MODEL.pin.joints[index].idx_v]  # linear before angular
        np.testing.assert_allclose(
            motion_subspace(joint), np.concatenate([column[3:], column[:3]]), atol=1e-12
        )


def test_what_a_link_does_not_feel_of_gravity_bears_it() -> None:
    prepared = PreparedRobot(ROBOT.with_joints("panda_joint3", gravity=0.25))
    weight = prepared.links["panda_link3"].mass * np.array([0.0, 1.0, -10.0])
    for felt, share in (({}, -0.75), ({"felt": 0.0}, 0.25)):
        (told,) = borne(prepared, (0.0, 1.0, -10.0), **felt).items()
        assert told == ("panda_link3", pytest.approx(share * weight))


def four_bar() -> Robot:
    return FourBarClosure().build().robot


def test_points_of_a_link_that_became_part_of_another_are_in_its_frame() -> None:
    robot = four_bar()
    x, y, z = PreparedRobot(robot).links["crank link"].centre  # any point of the crank
    held = Closure("crank link", "mount", (x, y, z))
    place, _ = ends(PreparedRobot(robot), reduced(PreparedRobot(robot))[0])
    prepared = PreparedRobot(replace(robot, closures=()))
    at = ends(prepared, replace(held, second="base"))[0]
    anchored = replace(held, second_point=tuple(np.subtract(at, robot.base.position)))
    (found,) = reduced(PreparedRobot(replace(robot, closures=(anchored,))))
    assert found.second == "base"
    assert found.second_point == pytest.approx(at)
    assert not np.allclose(at, place)
    one = replace(panda(), closures=(Closure("panda_hand", "panda_link7"),))
    with pytest.raises(DescriptionError, match="'panda_hand' at 'panda_link7', and no joint betwe"):
        reduced(PreparedRobot(one))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"second": "rod"}, "holds link 'rod', which is none of .*choose from mount, crank link"),
        ({"first_point": (0.501, 0.0, 0.0)}, "is open by 1 mm at the joints' initial positions"),
    ],
)
def test_a_wrong_closure_is_refused(change: dict[str, object], message: str) -> None:
    robot = four_bar()
    wrong = replace(robot.closures[0], **change)
    with pytest.raises(DescriptionError, match=message):
        reduced(PreparedRobot(replace(robot, closures=(wrong,))))


def test_frames_of_a_closure_are_one_frame_where_the_joints_start() -> None:
    closure = Closure("panda_link2", "panda_link5", (0.1, 0.2, 0.3), (-0.1, 0.3, 0.2))
    first, second = frames(PREPARED, closure)
    assert (first, second.position) == (Pose((0.1, 0.2, 0.3)), (-0.1, 0.3, 0.2))
    poses = link_poses(PREPARED)
    turns = [(poses[f"panda_link{k}"] * at).rotation() for k, at in ((2, first), (5, second))]
    np.testing.assert_allclose(*turns, atol=1e-12)


def test_the_widest_gap_of_all_loops_is_told() -> None:
    """Of both fingers, held where they start, one is moved by 10 mm and one by 20."""
    poses, start = link_poses(PREPARED), ROBOT.column("initial_position")
    loops = tuple(
        Closure("panda_link0", name, (ROBOT.base.inverse() * poses[name]).position)
        for name in ("panda_leftfinger", "panda_rightfinger")
    )
    prepared, moved = PreparedRobot(replace(ROBOT, closures=loops)), start.copy()
    assert opening(prepared, start) < 1e-9
    moved[-2:] += 0.01, -0.02
    assert opening(prepared, moved) == pytest.approx(0.02)
    assert opening(PREPARED, moved) == 0.0


def test_what_is_no_srdf_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.srdf").write_text("<mujoco/>")
    robot = replace(panda(), srdf=str(tmp_path / "a.srdf"))
    with pytest.raises(DescriptionError, match="a.srdf is no SRDF: it holds <mujoco>, not <robot>"):
        check_robot(robot)
    check_robot(replace(robot, srdf=""))


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (FourBarClosure(), "mysim closes no loops of links, and the robot of scene 'four_bar"),
        (DominoWave(), "mysim has links of a robot pass through each other, and those of scene 'd"),
    ],
)
def test_who_lacks_what_a_scene_needs_says_so(law: Law, message: str) -> None:
    able = adapter("mujoco").info
    unable, scene = replace(able, name="mysim", capabilities=frozenset()), law.build()
    with pytest.raises(NotSupportedError, match=message):
        check_supported(unable, scene)
    check_supported(able, scene)
    check_supported(unable, Scene("empty"))


def test_closures_and_collisions_travel_and_other_robots_look_as_before() -> None:
    robot = four_bar()
    assert Robot.from_wire(robot.to_wire()) == robot
    colliding = replace(panda(), self_collide=True)
    assert Robot.from_wire(colliding.to_wire()).self_collide
    assert not Robot.from_wire(panda().to_wire()).self_collide
    assert not {"closures", "self_collide"} & panda().to_wire().keys()


def test_links_that_one_joint_joins_never_collide() -> None:
    robot = PreparedRobot(replace(panda(), self_collide=True))
    assert frozenset(("base", "panda_link1")) in joined(robot)
    assert not links_collide(robot, "panda_link1", "base")
    assert links_collide(robot, "base", "panda_link2")
    assert not links_collide(PreparedRobot(panda()), "base", "panda_link2")


def test_shares_of_links_that_can_be_touched() -> None:
    """Of the Panda's ten links, each but the ends is joined to two others."""
    colliding = replace(panda(), self_collide=True)
    found = expected_quantities(Scene("s", (), colliding), Settings())
    shares = {
        name: found[f"link/{name}/touches"].tolist() for name in PreparedRobot(colliding).links
    }
    assert shares["base"] == [0, 0, pytest.approx(8 / 9)]
    assert shares["panda_link3"] == [1, 0, pytest.approx(7 / 9)]
    assert shares["panda_leftfinger"] == [1, 0, pytest.approx(8 / 9)]
