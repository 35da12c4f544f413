"""What moves on joints in a file: the same tree of links, or a line of the account, or refused."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.distance import pdist

mujoco = pytest.importorskip("mujoco")

from pytest_simbench.sims.mujoco.adapter import MuJoCo  # noqa: E402
from pytest_simbench.sims.mujoco.reading import Reading  # noqa: E402

from pytest_simbench.description.robot_files import description_xml  # noqa: E402
from pytest_simbench.description.shapes import mesh_points  # noqa: E402
from pytest_simbench.description.urdf import PreparedRobot  # noqa: E402
from pytest_simbench.experiment.case import Case  # noqa: E402
from pytest_simbench.experiment.handle import SimulatorHandle  # noqa: E402
from pytest_simbench.experiment.scene_file import read_scene_file  # noqa: E402
from pytest_simbench.scene import Scene  # noqa: E402
from pytest_simbench.simulator import DescriptionError  # noqa: E402
from tests.conftest import ADAPTERS, case_of  # noqa: E402

from .test_mujoco_reading import wrong  # noqa: E402
from .worlds import loaded, stepped  # noqa: E402

KITCHEN = """
<mujoco model="kitchen">
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1"/>
    <body name="cabinet" pos="0 0 .3">
      <geom name="back" type="box" size=".01 .2 .2" pos="-.2 0 0"/>
      <body name="drawer">
        <joint name="slide" type="slide" axis="1 0 0" range="0 .25" damping="2"/>
        <geom name="bottom" type="box" size=".15 .15 .01" pos="0 0 -.05" mass="1"/>
        <geom name="front" type="box" size=".01 .15 .05" pos=".15 0 0" mass=".3"/>
        <geom name="knob" type="sphere" size=".02" pos=".18 0 0" mass=".05"/>
      </body>
    </body>
    <body name="arm" pos="0 1 1" euler="0 30 20">
      <joint name="shoulder" axis="0 .6 .8" pos="0 -.2 0" damping=".05" armature=".01"
             range="-90 120"/>
      <geom type="box" size=".01 .2 .02" mass="2"/>
      <body name="handle" pos=".05 .15 .1" euler="10 0 0">
        <geom type="capsule" size=".01 .05" mass=".1"/>
      </body>
      <body name="hand" pos="0 .3 0" euler="0 0 40">
        <joint name="elbow" axis="1 0 .2" pos="0 0 .01" stiffness="3"/>
        <geom name="palm" type="cylinder" size=".03 .1" pos=".05 .1 0" mass=".5"/>
      </body>
    </body>
    <body name="ball" pos="0 0 .3"><freejoint/><geom size=".03" mass=".2"/></body>
  </worldbody>
  <actuator><position name="servo" joint="elbow" kp="20" kv="2" forcerange="-8 8"/></actuator>
</mujoco>
"""
"""A drawer, an arm of two links with something fixed on it, and a ball in the drawer."""


@pytest.fixture
def kitchen(tmp_path: Path) -> Path:
    path = tmp_path / "kitchen.xml"
    path.write_text(KITCHEN)
    return path


def changed(path: Path, old: str, new: str, whole: str = KITCHEN) -> Reading:
    text = whole.replace(old, new)
    assert text != whole
    path.write_text(text)
    return Reading(str(path))


@pytest.mark.parametrize("seed", range(5))
def test_joints_accelerate_as_those_of_the_file(kitchen: Path, seed: int) -> None:
    """At any position and speed: masses, inertias, anchors, axes, armature, damping and drives."""
    found = accelerations(Reading(str(kitchen)), seed)
    assert np.abs(found["file"]).min() > 0.01
    assert found["scene"] == pytest.approx(found["file"], rel=1e-5, abs=1e-6)


def test_rotors_and_damping_of_actuators_are_those_of_the_joint(kitchen: Path) -> None:
    own = '<position armature=".02" damping=".5" gear="3"'
    reading = changed(kitchen, "<position", own)
    found = accelerations(reading, 1)
    assert found["scene"] == pytest.approx(found["file"], rel=1e-5, abs=1e-6)
    elbow = reading.scene.robot.joints[-1]
    assert (elbow.armature, elbow.passive_damping) == pytest.approx((0.18, 4.5))


def accelerations(reading: Reading, seed: int) -> dict[str, list[float]]:
    """Of all joints, in the file's model and in the scene's, without contacts."""
    names = reading.scene.robot.joint_names
    simulator = loaded(MuJoCo, reading.scene, "default")
    rng = np.random.default_rng(seed)
    positions, speeds = rng.uniform(0, 0.2, len(names)), rng.uniform(-1, 1, len(names))
    found = {}
    for who, model in (("file", reading.model), ("scene", simulator.model)):
        data = mujoco.MjData(model)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        for name, position, speed in zip(names, positions, speeds, strict=True):
            data.qpos[model.joint(name).qposadr] = position
            data.qvel[model.joint(name).dofadr] = speed
        mujoco.mj_forward(model, data)
        found[who] = [float(data.qacc[model.joint(name).dofadr][0]) for name in names]
    simulator.close()
    return found


def borne(kitchen: Path, of_handle: str = ".4") -> Reading:
    """Arm and hand are compensated, the arm in part, and so is what is fixed on it."""
    text = KITCHEN.replace('name="hand"', 'name="hand" gravcomp="1"')
    text = text.replace('name="handle"', f'name="handle" gravcomp="{of_handle}"')
    kitchen.write_text(text)
    return changed(kitchen, '<body name="arm"', '<body name="arm" gravcomp=".4"', text)


@pytest.mark.parametrize("seed", range(2))
def test_compensated_links_accelerate_as_those_of_the_file(kitchen: Path, seed: int) -> None:
    reading = borne(kitchen)
    found = accelerations(reading, seed)
    assert found["scene"] == pytest.approx(found["file"], rel=1e-5, abs=1e-6)
    (line,) = (line for line in reading.account if "gravcomp" in line.quantity)
    assert (line.state, line.where) == ("carried", "arm, handle, hand")
    assert PreparedRobot(reading.scene.robot).gravity == {"drawer": 1.0, "arm": 0.6, "hand": 0.0}


def test_a_link_of_parts_feels_their_mean_share_of_gravity(kitchen: Path) -> None:
    """2 kg of 0.6 and 0.1 kg of the whole; without gravity nothing is compensated."""
    reading = borne(kitchen, "0")
    assert PreparedRobot(reading.scene.robot).gravity["arm"] == pytest.approx(1.3 / 2.1)
    told = {line.quantity: line.state for line in reading.account}
    assert told["body gravcomp (of parts)"] == "approximated"
    still = '<option gravity="0 0 0"/><worldbody>'
    reading = changed(kitchen, "<worldbody>", still, kitchen.read_text())
    assert set(PreparedRobot(reading.scene.robot).gravity.values()) == {1.0}


def test_limits_drives_and_the_rest_of_the_scene(kitchen: Path) -> None:
    scene = Reading(str(kitchen)).scene
    limits = PreparedRobot(scene.robot).limits
    assert limits["slide"] == pytest.approx([0, 0.25])
    assert limits["shoulder"] == pytest.approx(np.radians([-90, 120]))
    elbow = scene.robot.joints[scene.robot.joint_names.index("elbow")]
    assert (elbow.stiffness, elbow.damping, elbow.effort_limit) == (20.0, 2.0, 8.0)
    assert (elbow.spring, elbow.rest, scene.robot.joints[0].passive_damping) == (3.0, 0.0, 2.0)
    assert scene.robot.self_collide
    hulls = {  # of a ball, a capsule and a cylinder
        link.get("name"): np.ptp(mesh_points(mesh.get("filename", "")), axis=0)
        for link in description_xml(scene.robot).iter("link")
        for mesh in link.iter("mesh")
    }
    for link, size in (
        ("drawer", [0.04] * 3),
        ("arm", [0.02, 0.02, 0.12]),
        ("hand", [0.06, 0.06, 0.2]),
    ):
        assert hulls[link] == pytest.approx(size, abs=1e-3)
    assert scene.apart == (("link/arm", "link/hand"),)  # parent and child
    assert [body.name for body in scene.bodies] == ["cabinet", "ball"]


def test_a_link_may_be_a_mesh(kitchen: Path) -> None:
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]])
    mesh = f'<asset><mesh name="m" vertex="{" ".join(map(str, corners.flat))}"/></asset>'
    text = KITCHEN.replace("<worldbody>", f"{mesh}<worldbody>")
    scene = changed(kitchen, 'type="cylinder" size=".03 .1"', 'type="mesh" mesh="m"', text).scene
    (found,) = description_xml(scene.robot).findall("link[@name='hand']/collision/geometry/mesh")
    edges = pdist(np.unique(mesh_points(found.get("filename", "")).round(9), axis=0))
    assert sorted(edges) == pytest.approx(sorted(pdist(corners)), abs=1e-6)


def test_masks_between_links_and_the_rest_keep_them_apart(kitchen: Path) -> None:
    """The floor meets the ball, and no link."""
    text = KITCHEN.replace('mass=".2"', 'mass=".2" contype="3" conaffinity="3"')
    kitchen.write_text(text.replace('name="floor"', 'name="floor" contype="2" conaffinity="2"'))
    scene = Reading(str(kitchen)).scene
    assert all(scene.kept_apart("ground", f"link/{name}") for name in ("drawer", "arm", "hand"))
    assert not scene.kept_apart("ground", "body/ball")
    assert not scene.kept_apart("link/drawer", "body/ball")


def test_links_pass_through_a_ground_that_the_file_has_not(kitchen: Path) -> None:
    plane = '<geom name="floor" type="plane" size="2 2 .1"/>'
    scene = changed(kitchen, plane, "").scene
    assert all(scene.kept_apart("ground", f"link/{name}") for name in ("drawer", "arm", "hand"))
    assert not scene.kept_apart("ground", "body/ball")


def test_without_contacts_all_are_kept_apart(kitchen: Path) -> None:
    off = '<option><flag contact="disable"/></option><worldbody>'
    scene = changed(kitchen, "<worldbody>", off).scene
    assert scene.kept_apart("link/drawer", "body/ball")
    assert scene.kept_apart("ground", "body/ball")


EQUALITY = "</worldbody><equality>{}</equality>"
WELD = '<weld body1="arm" body2="drawer" solref="2e-4 1"/>'
CONNECT = '<connect body1="hand" body2="cabinet" anchor="0 .1 .1" solref="2e-4 1"/>'
GEARS = '<joint joint1="slide" joint2="shoulder" polycoef="0 .3 0 0 0" solref="2e-4 1"/>'


@pytest.mark.parametrize(
    ("held", "closures", "couplings"),
    [(WELD, 1, 0), (CONNECT, 1, 0), (GEARS, 0, 1), (WELD + GEARS, 1, 1)],
)
def test_constraints_move_links_as_in_the_file(
    kitchen: Path, held: str, closures: int, couplings: int
) -> None:
    """A tenth of a second in steps of 0.1 ms, as hard in the file as in the scene."""
    reading = changed(kitchen, "</worldbody>", EQUALITY.format(held))
    assert len(reading.scene.robot.closures) == closures
    assert len(reading.scene.robot.couplings) == couplings
    found = {}
    for profile in ("default", "file"):
        found[profile] = moved(reading.scene, profile).joint_state()
    kitchen.write_text(KITCHEN)
    free = moved(Reading(str(kitchen)).scene, "file").joint_state()[0]
    assert np.abs(found["file"][0] - free).max() > 0.01
    assert found["default"][0] == pytest.approx(found["file"][0], rel=0.01, abs=2e-4)


def moved(scene: Scene, profile: str) -> MuJoCo:
    """The world after a tenth of a second in steps of 0.1 ms."""
    return stepped(loaded(MuJoCo, scene, profile, timestep=1e-4), 0.1)


@pytest.mark.parametrize(
    ("held", "why"),
    [
        ('<weld body1="ball" body2="drawer"/>', "it holds ball at drawer, .* fall or part: ball"),
        ('<weld body1="arm" body2="drawer" relpose="0 0 1 1 0 0 0"/>', "is open by"),
        ('<joint joint1="slide" polycoef=".1 0 0 0 0"/>', "two hinges or sliders"),
        ('<joint joint1="slide" joint2="elbow" polycoef="0 0 1 0 0"/>', "polynomial"),
        ('<joint joint1="slide" joint2="elbow" polycoef=".1 1 0 0 0"/>', "where the file starts"),
        (GEARS.replace("<joint", '<joint active="false"'), "switched off"),
    ],
)
def test_constraints_that_are_not_carried_say_why(kitchen: Path, held: str, why: str) -> None:
    reading = changed(kitchen, "</worldbody>", EQUALITY.format(held))
    assert not reading.scene.robot.closures + reading.scene.robot.couplings
    told = {line.quantity: line.reason for line in reading.account if line.state == "not carried"}
    (reason,) = (text for name, text in told.items() if name.startswith("equality"))
    assert re.search(why, reason)


JOINED = """<mujoco>{}<worldbody>
<body name="arm" pos="0 0 1"><joint/><geom name="upper" type="box" size=".1 .1 .1"/>
<body name="hand" pos="0 0 .4"><joint axis="1 0 0"/><geom name="fore" size=".1"/></body></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize(
    "told",
    ['<option><flag filterparent="disable"/></option>',
     '<contact><pair geom1="upper" geom2="fore"/></contact>'],
)  # fmt: skip
def test_joined_links_that_meet_in_the_file_are_told(tmp_path: Path, told: str) -> None:
    path = tmp_path / "two.xml"
    path.write_text(JOINED.format(told))
    (line,) = (a for a in Reading(str(path)).account if a.quantity == "contact (of joined links)")
    assert (line.state, line.where) == ("not carried", "link/arm and link/hand")


@pytest.mark.parametrize("other", ["world", "arm", "led"])
@pytest.mark.parametrize("kind", ["weld", "connect"])
def test_constraints_of_free_bodies_say_what_may_part(kitchen: Path, kind: str, other: str) -> None:
    at = f'body2="{other}"' * (other != "world") + ' anchor="0 0 0"'
    held = EQUALITY.format(f'<{kind} body1="ball" {at}/>')
    reading = changed(kitchen, "</worldbody>", f'<body name="led" mocap="true"/>{held}')
    (line,) = (line for line in reading.account if line.quantity == f"equality ({kind})")
    assert f"holds ball at {other}, " in line.reason
    assert "may fall or part: ball" in line.reason
    assert ("led is a mocap body" in line.reason) == (other == "led")


def test_a_coupling_that_a_clipped_start_opens_is_told(kitchen: Path) -> None:
    """The drawer starts at the near end of its range, 0.1 m from where the file has it."""
    text = KITCHEN.replace('range="0 .25"', 'range=".1 .25"')
    kitchen.write_text(text.replace("</worldbody>", EQUALITY.format(GEARS)))
    reading = Reading(str(kitchen))
    assert not reading.scene.robot.couplings
    (line,) = (line for line in reading.account if line.quantity == "equality (joint)")
    assert (line.state, "are 0.1 rad or m from" in line.reason) == ("not carried", True)


def test_several_actuators_of_a_joint_are_one_drive(kitchen: Path) -> None:
    two = '<position joint="slide" kp="50" gear="2"/><velocity joint="slide" kv="3"/><position name'
    joint = changed(kitchen, "<position name", two).scene.robot.joints[0]
    assert (joint.stiffness, joint.damping, joint.passive_damping) == (200.0, 3.0, 2.0)


MOTOR = '<motor joint="slide" gear="-20" {}/><position name'


@pytest.mark.parametrize(
    ("limits", "most"),
    [
        ("", 1e4),
        ('forcerange="-3 3"', 60.0),
        ('ctrlrange="-.4 .4"', 8.0),
        ('ctrlrange="-.4 .4" forcerange="-.1 .1"', 2.0),
    ],
)
def test_motors_are_drives_that_are_told_efforts(kitchen: Path, limits: str, most: float) -> None:
    reading = changed(kitchen, "<position name", MOTOR.format(limits))
    joint = reading.scene.robot.joints[0]
    assert joint.motor
    assert joint.effort_limit == pytest.approx(most)
    (line,) = (line for line in reading.account if line.quantity == "actuator (motor)")
    assert line.state == "carried"
    assert f"at most {most:g} N" in line.reason
    assert "actuator" not in {other.quantity for other in reading.account}


def test_a_motor_that_pulls_without_a_command_is_not_as_in_the_file(kitchen: Path) -> None:
    pulling = '<general joint="slide" gear="2" biastype="affine" biasprm="3 0 0"/><position name'
    reading = changed(kitchen, "<position name", pulling)
    (line,) = (line for line in reading.account if line.quantity == "actuator (motor)")
    assert (line.state, "pulls 6 in the file" in line.reason) == ("approximated", True)


def test_a_keyframe_tells_motors_efforts_and_velocity_servos_speeds(kitchen: Path) -> None:
    text = KITCHEN.replace(
        "</actuator>",
        '<motor joint="slide" gear="-20"/><velocity joint="shoulder" kv="3" gear="2"/></actuator>'
        '<keyframe><key ctrl=".4 .1 .5"/></keyframe>',
    )
    kitchen.write_text(text)
    (start,) = Reading(str(kitchen)).scene.starts
    assert start.efforts == pytest.approx((-2.0, 0.0, 0.0))
    assert start.speeds == pytest.approx((0.0, 0.25, 0.0))
    assert start.targets == pytest.approx((0.0, 0.0, 0.4))


def test_a_keyframe_has_joints_and_what_their_drives_are_told(kitchen: Path) -> None:
    pose = "0 0 .5 1 0 0 0"
    key = f'</actuator><keyframe><key qpos=".1 2 -.3 {pose}" ctrl=".4"/></keyframe>'
    (start,) = changed(kitchen, "</actuator>", key).scene.starts
    assert start.positions == pytest.approx((0.1, 2.0, -0.3))
    assert start.targets == pytest.approx((0.1, 2.0, 0.4))
    assert start.speeds == start.efforts == ()
    assert start.poses[0].position == (0.0, 0.0, 0.5)


def test_a_keyframe_outside_of_a_range_is_told_and_a_joint_without_one_has_room(
    kitchen: Path,
) -> None:
    key = '</actuator><keyframe><key name="far" qpos=".3 1 -9 0 0 .5 1 0 0 0"/></keyframe>'
    reading = changed(kitchen, "</actuator>", key)
    (start,) = reading.scene.starts
    assert start.positions == pytest.approx((0.25, 1.0, -9.0))
    (line,) = (line for line in reading.account if line.quantity == "key (range)")
    told = "slide is at 0.3 rad or m, outside of its range; here at 0.25"
    assert (line.state, line.reason, line.where) == ("approximated", told, "far")
    for profile in ("default", "file"):
        simulator = loaded(MuJoCo, reading.scene.at_start(start), profile)
        assert simulator.joint_state()[0] == pytest.approx(start.positions)
        simulator.close()


def test_where_the_file_counts_a_joint_from_is_kept_and_told(kitchen: Path) -> None:
    reading = changed(kitchen, 'name="slide"', 'name="slide" ref=".1"')
    assert reading.scene.arm.column("file_zero") == pytest.approx([0.1, 0.0, 0.0])
    assert "joint ref" in {line.quantity for line in reading.account}


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('name="elbow"', 'name="elbow" type="ball"', "hand moves on the ball joint elbow"),
        (
            '<freejoint/><geom size=".03" mass=".2"/>',
            '<freejoint/><geom size=".03"/><body name="ear"><joint/><geom size=".01"/></body>',
            "ear hangs on ball, which moves freely",
        ),
        ('type="cylinder" size=".03 .1"', 'type="ellipsoid" size=".1 .1 .2"', "of type ellipsoid"),
    ],
)
def test_what_no_tree_holds_is_refused(kitchen: Path, old: str, new: str, why: str) -> None:
    with pytest.raises(DescriptionError, match=why):
        changed(kitchen, old, new)


@pytest.mark.parametrize("read", [lambda path: Reading(str(path)), borne], ids=["plain", "borne"])
def test_the_file_itself_moves_as_the_carried_tree(
    kitchen: Path, read: Callable[[Path], Reading]
) -> None:
    """The profile `file` beside `default`, a tenth of a second long."""
    scene, found = read(kitchen).scene, {}
    for profile in ("default", "file"):
        assert not wrong(loaded(MuJoCo, scene, profile))
        simulator = moved(scene, profile)
        found[profile] = simulator.joint_state()
        assert {name for pair in simulator.contact_forces() for name in pair[:2]} <= {
            "body/ball", "link/drawer",
        }  # fmt: skip
        simulator.close()
    assert np.abs(found["file"][0]).max() > 0.01
    assert found["file"] == pytest.approx(found["default"], rel=1e-3, abs=1e-4)


def test_a_body_on_several_joints_moves_as_in_the_file(kitchen: Path) -> None:
    """To the share of its mass that stands between them."""
    two = '<joint name="lift" type="slide" axis="0 0 1" pos=".02 0 0"/><joint name="elbow"'
    found = accelerations(changed(kitchen, '<joint name="elbow"', two), 1)
    assert found["scene"] == pytest.approx(found["file"], rel=0.02)
    assert found["scene"] != pytest.approx(found["file"], rel=1e-5)


def test_a_start_outside_of_the_range_is_its_nearest_end(kitchen: Path) -> None:
    reading = changed(kitchen, 'range="0 .25"', 'range=".1 .25"')
    assert reading.scene.robot.joints[0].initial_position == pytest.approx(0.1)
    assert "joint range (start)" in {line.quantity for line in reading.account}


@pytest.mark.engine
@pytest.mark.parametrize("name", ADAPTERS)
def test_every_engine_holds_drawer_and_arm(kitchen: Path, case: Case, name: str) -> None:
    """Parity holds, the servo holds its link, and a ball that falls into the drawer does not move
    it from its stop. Links feel shares of gravity."""
    borne(kitchen)
    scene = read_scene_file(kitchen).scene
    with (
        closing(SimulatorHandle(case_of(case, name))) as handle,
        handle.episode(scene) as world,
    ):
        world.wait(0.5)
        slide, _, elbow = world.joints[0]
        assert abs(slide) < 1e-3
        assert abs(elbow) < 0.15
        assert world.pose("ball").position == pytest.approx((0, 0, 0.29), abs=0.01)
