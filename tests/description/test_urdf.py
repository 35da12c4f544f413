"""The reduced robot, and how its description travels."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from pytest_simbench.description.robot_files import folder, received, with_content
from pytest_simbench.description.shapes import reach, shape_points
from pytest_simbench.description.urdf import body_urdf, write_link, write_origin
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Compound, ConvexMesh, Cylinder, Pose, Scene, principal
from pytest_simbench.scene.pose import quaternion_of
from pytest_simbench.simulator import PreparedRobot
from pytest_simbench.worker.wire import pack, unpack


def test_mass_is_conserved() -> None:
    robot = panda()
    masses = [float(m.attrib["value"]) for m in ET.parse(robot.urdf).iter("mass")]
    prepared = PreparedRobot(robot)
    assert sum(link.mass for link in prepared.links.values()) == pytest.approx(sum(masses))


def test_a_link_that_moves_may_be_named_base(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(Path(panda().urdf).read_text().replace('"panda_link1"', '"base"'))
    prepared = PreparedRobot(replace(panda(), urdf=str(file)))
    assert list(prepared.links)[:3] == ["fixed base", "base", "panda_link2"]


@pytest.mark.parametrize("base", [Pose(), Pose.at(0.3, -0.2, 0.5, yaw=0.7)])
def test_dynamics_are_those_of_the_original(base: Pose, tmp_path: Path) -> None:
    robot = panda(base=base)
    original = RobotModel(robot)
    reduced = pin.buildModelFromUrdf(str(PreparedRobot(robot).write_urdf(tmp_path)))
    data = reduced.createData()
    rng = np.random.default_rng(0)
    gravity = np.array([0.0, 0.0, -9.80665])
    reduced.gravity.linear = gravity
    for _ in range(20):
        q = np.concatenate([rng.uniform(original.lower, original.upper), [0.02, 0.02]])
        v, a = rng.normal(size=(2, 9))
        expected = original.inverse_dynamics(gravity, q[None], v[None], a[None])[0]
        rotors = robot.column("armature") * a
        assert np.allclose(pin.rnea(reduced, data, q, v, a) + rotors, expected, atol=1e-6)
        pin.forwardKinematics(reduced, data, q)
        joint = original.pin.getJointId("panda_joint7")
        pin.forwardKinematics(original.pin, original.data, q)
        there = original.base * original.data.oMi[joint]
        assert data.oMi[joint].isApprox(there, 1e-6)


def test_lines_are_short_enough_for_bullet() -> None:
    text = PreparedRobot(panda()).to_urdf()
    assert max(map(len, text.splitlines())) < 1000
    assert [text.count(f"<{tag}>") for tag in ("visual", "collision", "mimic")] == [17, 17, 0]


def test_other_fingers_follow_and_nothing_is_drawn_where_asked() -> None:
    root = ET.fromstring(PreparedRobot(panda()).to_urdf(mimic=True, visuals=False))
    followers = {j.get("name"): m.attrib for j in root for m in j.iter("mimic")}
    told = {"joint": "panda_finger_joint1", "multiplier": "1", "offset": "0"}
    assert followers == {"panda_finger_joint2": told}
    assert [len([*root.iter(tag)]) for tag in ("visual", "collision")] == [0, 17]
    write_link(drawn := ET.Element("robot"), PreparedRobot(panda()).links["base"])
    assert [len([*drawn.iter(tag)]) for tag in ("visual", "collision")] == [1, 1]


def test_a_body_is_one_link(tmp_path: Path) -> None:
    """With its mass about its own frame, and each shape at its place, also as a picture."""
    corners, _ = principal([(0, 0, 0), (0.06, 0, 0), (0, 0.06, 0), (0, 0, 0.06)])
    parts = (Cylinder("rod", 0.01, 0.06, Pose.at(0, 0, 0.1)), ConvexMesh("rock", corners, Pose()))
    body = Compound("pair", parts, Pose.at(1, 2, 3), 0.5, moments=(0.1, 0.2, 0.25))
    (link,) = root = ET.fromstring(body_urdf(body, lambda name, hull: tmp_path / name))
    assert (root.attrib, link.attrib) == ({"name": "body"}, {"name": "body"})
    assert [link.find("inertial/mass").get("value"), link.find("inertial/inertia").get("izz")] == [
        "0.5", "0.25",
    ]  # fmt: skip
    for kind in ("collision", "visual"):
        rod, rock = link.findall(kind)
        assert rod.find("geometry/cylinder").attrib == {"radius": "0.01", "length": "0.06"}
        assert rod.find("origin").get("xyz") == "0.0 0.0 0.1"
        assert rock.find("geometry/mesh").get("filename") == str(tmp_path / "1")


def test_limits_are_those_of_the_original(tmp_path: Path) -> None:
    """Positions and velocities from the description, efforts from the drives."""
    robot = panda(squeeze=12.0)
    original = RobotModel(robot).pin
    reduced = pin.buildModelFromUrdf(str(PreparedRobot(robot).write_urdf(tmp_path)))
    for name in ("lowerPositionLimit", "upperPositionLimit", "velocityLimit"):
        assert np.array_equal(getattr(reduced, name), getattr(original, name))
    assert np.array_equal(reduced.effortLimit, [87.0] * 4 + [12.0] * 5)


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Another machine's folder for descriptions."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder.cache_clear()
    yield tmp_path / "cache" / "pytest-simbench" / "robots"
    folder.cache_clear()


def sent() -> dict[str, Any]:
    scene = Scene("s", robot=panda())
    wire: dict[str, Any] = unpack(pack(with_content(scene.to_wire(), scene.robot)))
    return wire


def test_no_path_is_sent() -> None:
    robot = sent()["robot"]
    meshes = robot["content"].pop("meshes")
    assert len(meshes) == 9
    for part in (str(Path(panda().urdf).parents[3]), "package://", "site-packages", ".dae"):
        assert part not in repr(robot)


def test_what_arrives_is_the_same_robot(elsewhere: Path) -> None:
    there = Scene.from_wire(received(sent())).robot
    assert Path(there.urdf).parent == elsewhere
    ours, theirs = PreparedRobot(panda()), PreparedRobot(there)
    assert list(ours.links) == list(theirs.links)
    for name, link in ours.links.items():
        other = theirs.links[name]
        assert (other.mass, other.inertia.tolist()) == (link.mass, link.inertia.tolist())
        for one, two in zip(link.shapes, other.shapes, strict=True):
            assert np.array_equal(reach(shape_points(one)), reach(shape_points(two)))
    assert ours.limits.keys() == theirs.limits.keys()
    assert there.joints == panda().joints


def test_the_same_description_lies_in_the_same_place(elsewhere: Path) -> None:
    """Engines keep compiled meshes by path. A damaged file is written anew."""
    first = received(sent())["robot"]["urdf"]
    files = {path: path.read_bytes() for path in elsewhere.iterdir()}
    damaged = next(path for path in files if path.suffix == ".stl")
    damaged.write_bytes(b"half")
    assert received(sent())["robot"]["urdf"] == first
    assert {path: path.read_bytes() for path in elsewhere.iterdir()} == files


def test_where_no_cache_can_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    folder.cache_clear()
    try:
        assert Path(received(sent())["robot"]["urdf"]).is_file()
    finally:
        folder.cache_clear()


def test_a_scene_without_a_robot_and_one_with_paths_stay_as_they_are() -> None:
    for scene in (Scene("s"), Scene("s", robot=panda())):
        assert Scene.from_wire(received(scene.to_wire())) == scene


@pytest.mark.parametrize("pitch", [-90.0, -89.9, 0.0, 45.0, 90.0])
@pytest.mark.parametrize("yaw", [-170.0, -40.0, 0.0, 25.0, 90.0])
def test_an_origin_is_written_as_the_pose_that_it_is(pitch: float, yaw: float) -> None:
    """Also where the pose is pitched by 90 degrees, and roll and yaw turn about one axis."""
    turn = pin.rpy.rpyToMatrix(0.0, *np.deg2rad([pitch, yaw]))
    element = ET.Element("collision")
    write_origin(element, Pose.from_array([1.0, 2.0, 3.0, *quaternion_of(turn)]))
    read = pin.rpy.rpyToMatrix(*map(float, element[0].attrib["rpy"].split()))
    assert read == pytest.approx(turn, abs=1e-6)
