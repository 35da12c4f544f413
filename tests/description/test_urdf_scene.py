"""A URDF as a scene: what moves on joints, what is told of the rest, and what is refused."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.description.mesh_check import read_stl
from pytest_simbench.description.robot_files import folder
from pytest_simbench.description.shapes import write_stl
from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.experiment.scene_file import SceneFile, read_scene_file
from pytest_simbench.scene import Coupling, Gripper, Polytope, Pose
from pytest_simbench.scene.robot import FASTEST, FREE, WIDEST
from pytest_simbench.simulator import DescriptionError
from tests.approval import assert_approved
from tests.conftest import ADAPTERS, case_of

CABINET = """<robot name="cabinet">
  <material name="grey"/>
  <link name="carcass">
    <visual><geometry><sphere radius="1"/></geometry></visual>
    <collision><origin xyz="-.3 0 0"/><geometry><box size=".1 .4 .6"/></geometry></collision>
  </link>
  <link name="drawer">
    <inertial><mass value="2"/>
      <inertia ixx=".02" iyy=".02" izz=".02" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><cylinder radius=".1" length=".2"/></geometry></collision>
  </link>
  <link name="door">
    <inertial><mass value="1"/>
      <inertia ixx=".02" iyy=".02" izz=".02" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius=".05"/></geometry></collision>
  </link>
  <link name="handle"><collision><geometry><box size=".02 .02 .1"/></geometry></collision></link>
  <joint name="rail" type="prismatic"><parent link="carcass"/><child link="drawer"/>
    <axis xyz="0 0 1"/><limit lower="-.2" upper=".3" effort="5" velocity="2"/>
    <dynamics damping="4" friction=".5"/><safety_controller k_velocity="1"/></joint>
  <joint name="hinge" type="continuous"><parent link="carcass"/><child link="door"/>
    <origin xyz="0 1 0"/><axis xyz="0 0 1"/></joint>
  <joint name="grip" type="fixed"><parent link="door"/><child link="handle"/></joint>
  <gazebo reference="door"><mu1>0.2</mu1></gazebo>
  <transmission name="motor"/>
</robot>
"""
"""It reaches 0.3 m below its origin."""


def read(folder: Path, *changes: tuple[str, str]) -> SceneFile:
    text = CABINET
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "cabinet.urdf").write_text(text)
    return read_scene_file(folder / "cabinet.urdf")


def test_joints_have_no_drives_and_the_dynamics_of_the_file(tmp_path: Path) -> None:
    scene = read(tmp_path).scene
    rail, hinge = scene.robot.joints
    assert (rail.passive_damping, rail.friction) == (4.0, 0.5)
    assert (hinge.passive_damping, hinge.friction) == (0.0, 0.0)
    damped = read(tmp_path, (' friction=".5"', "")).scene.robot.joints[0]
    assert (damped.passive_damping, damped.friction) == (4.0, 0.0)
    assert {(j.stiffness, j.damping, j.effort_limit, j.armature) for j in (rail, hinge)} == {
        (FREE, 0.0, FREE, 0.0)
    }
    prepared = PreparedRobot(scene.robot)
    assert {name: list(ends) for name, ends in prepared.limits.items()} == {
        "rail": [-0.2, 0.3], "hinge": [-WIDEST, WIDEST],
    }  # fmt: skip
    assert prepared.velocity_limits == {"rail": FASTEST, "hinge": FASTEST}
    assert [len(link.shapes) for link in prepared.moving_links] == [1, 2]  # with its handle
    assert (scene.robot.gripper, scene.robot.srdf) == (Gripper((), 0.0, 0.0, 0.0), "")
    assert (scene.name, scene.file) == ("cabinet", str(tmp_path / "cabinet.urdf"))


def test_it_is_moved_up_onto_the_ground(tmp_path: Path) -> None:
    assert read(tmp_path).scene.file_lift == pytest.approx(0.3)
    higher = read(tmp_path, ('xyz="-.3 0 0"', 'xyz="-.3 0 .7"')).scene
    assert higher.file_lift == pytest.approx(0.1)  # of the drawer
    assert higher.robot.base == Pose.at(0.0, 0.0, higher.file_lift)


def test_its_meshes_are_kept_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder.cache_clear()
    try:
        robot = read(tmp_path).scene.robot
        meshes = [link.shapes[0].mesh for link in PreparedRobot(robot).moving_links]
        assert {Path(file).parent for file in (*meshes, robot.urdf)} == {folder()}
    finally:
        folder.cache_clear()


def test_round_shapes_are_hulls_that_touch_them_from_inside(tmp_path: Path) -> None:
    robot = read(tmp_path).scene.robot
    drawer, door = PreparedRobot(robot).moving_links
    for link, reach, height in ((drawer, 0.1, 0.1), (door, 0.05, 0.05)):
        mesh = link.shapes[0].mesh
        corners = read_stl(Path(mesh).read_bytes()).reshape(-1, 3)
        assert np.hypot(*corners.T[:2]).max() == pytest.approx(reach, rel=0.01)
        assert np.abs(corners[:, 2]).max() == pytest.approx(height, rel=0.02)
        volume = np.pi * reach**2 * height * (2 if link is drawer else 4 / 3)
        less = 0.007 if link is drawer else 0.1  # a regular polygon of 32 corners: 0.64 %
        assert Polytope(np.unique(corners, axis=0)).volume == pytest.approx(volume, rel=less)


def test_of_everything_it_is_told_what_became_of_it(tmp_path: Path) -> None:
    hull = Polytope([(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)])
    write_stl(tmp_path / "knob.stl", hull)
    knob = ('<box size=".02 .02 .1"/>', '<mesh filename="knob.stl"/>')
    follow = ("<dynamics", '<mimic joint="hinge" offset="1"/><dynamics')
    plain = ('<sphere radius=".05"/>', '<box size=".1 .1 .1"/>')
    coupled = ("<dynamics", '<mimic joint="hinge" multiplier=".2"/><dynamics')
    heavy = ('<mass value="2"/>', '<mass value="2"><unit name="kilogram"/></mass>')
    away = ('"continuous">', '"revolute"><calibration/><limit lower=".5" upper="1"/>')
    for name, changes in (
        ("cabinet", [knob]),
        ("cabinet-follows", [follow, plain]),
        ("cabinet-coupled", [coupled, away, heavy, ('robot name="cabinet"', "robot")]),
    ):
        account = read(tmp_path, *changes).account
        assert_approved(name, "\n".join(" | ".join(line.to_wire().values()) for line in account))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('mass value="2"', 'mass value="3"'),
        ('ixx=".02"', 'ixx=".03"'),
        ('radius=".1"', 'radius=".11"'),
        ('radius=".05"', 'radius=".06"'),
        ('box size=".02', 'box size=".03'),
        ('xyz="0 1 0"', 'xyz="0 1 .1"'),
        ('axis xyz="0 0 1"', 'axis xyz="0 1 0"'),
        ('upper=".3"', 'upper=".4"'),
        ('damping="4"', 'damping="5"'),
        ('friction=".5"', 'friction=".6"'),
        ("<dynamics", '<mimic joint="hinge"/><dynamics'),
        ("<dynamics", '<calibration rising="0"/><dynamics'),
        ('<link name="handle">', '<link name="handle"><sensor/>'),
    ],
)
def test_nothing_is_dropped_in_silence(tmp_path: Path, old: str, new: str) -> None:
    before = read(tmp_path)
    after = read(tmp_path, (old, new))
    assert before.scene != after.scene or before.account != after.account


def test_a_joint_that_mimics_is_coupled_and_starts_where_it_belongs(tmp_path: Path) -> None:
    follow = '<mimic joint="hinge" multiplier="2" offset="{}"/><dynamics'
    robot = read(tmp_path, ("<dynamics", follow.format(0.1))).scene.robot
    assert robot.couplings == (Coupling("rail", "hinge", 2.0, 0.1),)
    assert robot.joints[0].initial_position == 0.1
    found = read(tmp_path, ("<dynamics", follow.format(0.4)))
    assert not found.scene.robot.couplings
    assert found.scene.robot.joints[0].initial_position == 0.3


def test_a_range_that_does_not_hold_0_begins_at_its_nearest_end(tmp_path: Path) -> None:
    found = read(tmp_path, ('lower="-.2"', 'lower=".2"'))
    assert found.scene.robot.joints[0].initial_position == 0.2
    assert "joint limit (start)" in {line.quantity for line in found.account}


def test_packages_are_folders_above_the_file_or_beside_one(tmp_path: Path) -> None:
    """As ROS packages lie: `shop/urdf/cabinet.urdf`, `shop/meshes`, and `parts` beside `shop`."""
    folder = tmp_path / "shop" / "urdf"
    folder.mkdir(parents=True)
    hull = Polytope([(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, -0.7)])
    for package in ("shop", "parts"):
        (tmp_path / package / "meshes").mkdir(parents=True)
        write_stl(tmp_path / package / "meshes" / "knob.stl", hull)
        mesh = f'<mesh filename="package://{package}/meshes/knob.stl"/>'
        assert read(folder, ('<sphere radius=".05"/>', mesh)).scene.file_lift == pytest.approx(0.7)
    deep = tmp_path / "shop" / "robots" / "one" / "urdf"
    deep.mkdir(parents=True)
    read(deep, ('<sphere radius=".05"/>', '<mesh filename="package://shop/meshes/knob.stl"/>'))
    with pytest.raises(DescriptionError, match="unknown package 'other'"):
        read(folder, ('<sphere radius=".05"/>', '<mesh filename="package://other/knob.stl"/>'))


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('radius=".05"', 'radius="a"', "link 'door' has <sphere radius='a'>"),
        ('<sphere radius=".05"/>', "<mesh/>", "link 'door' has a mesh that cannot be used: ''"),
        ('<sphere radius=".05"/>', '<sphere radius="51"/>', "a sphere whose size is not .* 50 m"),
        ('<sphere radius=".05"/>', "<capsule/>", "must be one box, sphere, cylinder or mesh"),
        ('length=".2"', 'length="0"', "link 'drawer' has a cylinder whose size"),
        ('length=".2"', 'length="x"', "link 'drawer' has <cylinder length='x'>"),
        ('friction=".5"', 'friction="-1"', "joint 'rail' has a damping or friction"),
        ('friction=".5"', 'friction="x"', "joint 'rail' has <dynamics friction='x'>"),
        ('damping="4"', 'damping="x"', "joint 'rail' has <dynamics damping='x'>"),
        ("<dynamics ", "<dynamics/><dynamics ", "joint 'rail' has 2 <dynamics>; leave one"),
        ('name="hinge" type="continuous"', 'name="hinge" type="floating"', "'hinge' is floating"),
        ('<mass value="1"/>', '<mass value="0"/>', "has moments of inertia and no mass"),
        ('child link="door"', 'child link="gate"', "joint 'hinge' has the child 'gate'"),
    ],
)
def test_what_cannot_be_is_one_sentence(tmp_path: Path, old: str, new: str, why: str) -> None:
    line = CABINET[: CABINET.index(old)].count("\n") + 1
    with pytest.raises(DescriptionError, match=f"cabinet.urdf, line {line}: .*{why}"):
        read(tmp_path, (old, new))


def test_a_link_without_mass_is_told_with_the_users_file(tmp_path: Path) -> None:
    inertial = CABINET[CABINET.index('<inertial><mass value="2') :].partition("</inertial>")[0]
    with pytest.raises(DescriptionError, match=r"/cabinet.urdf: link 'drawer' .* has no mass"):
        read(tmp_path, (f"{inertial}</inertial>", ""))


def test_without_a_file_or_a_joint_there_is_no_scene(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match=r"cabinet.urdf is not valid XML"):
        read(tmp_path, ("</robot>", ""))
    with pytest.raises(DescriptionError, match=r"none.urdf: No such file"):
        read_scene_file(tmp_path / "none.urdf")
    (tmp_path / "a'b.urdf").write_text(CABINET)
    with pytest.raises(DescriptionError, match=r"a'b.urdf: a scene has the name"):
        read_scene_file(tmp_path / "a'b.urdf")
    (tmp_path / "post.urdf").write_text('<robot name="post"><link name="post"/></robot>')
    with pytest.raises(DescriptionError, match=r"post.urdf has no joint that moves"):
        read_scene_file(tmp_path / "post.urdf")


@pytest.mark.engine
@pytest.mark.parametrize("name", ADAPTERS)
def test_in_every_engine_a_drawer_falls(tmp_path: Path, case: Case, name: str) -> None:
    """To its stop where nothing brakes it, else at its end speed: m g = F + d v."""
    own = 'damping="4" friction=".5"'
    free = read(tmp_path, (f"<dynamics {own}/>", "")).scene
    braked = read(tmp_path, (own, 'damping="100" friction="5"')).scene
    with closing(SimulatorHandle(case_of(case, name))) as handle:
        with handle.episode(free) as world:
            world.wait(1.0)
            rail, hinge = world.joints[0]
        assert rail == pytest.approx(-0.2, abs=5e-3)
        assert hinge == pytest.approx(0.0, abs=0.01)
        with handle.episode(braked) as world:
            world.wait(0.3)
            before = world.joints[0][0]
            world.wait(0.5)
            speed = (world.joints[0][0] - before) / 0.5
        assert speed == pytest.approx(-(2 * 9.80665 - 5) / 100, rel=0.02)
