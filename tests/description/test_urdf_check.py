"""Broken robots: each is refused in one sentence with file, element and what to do."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from pytest_simbench.description.links import check_names, check_robot
from pytest_simbench.description.mesh_check import LARGEST_MESH, read_stl, written_stl
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import Box, Gripper, Joint, Pose, Robot, Scene, SceneError
from pytest_simbench.simulator import DescriptionError, PreparedRobot
from tests.hostile import assert_harmless_terminal

SOUND = """<robot name="arm">
  <link name="foot"/>
  <link name="upper">
    <inertial>
      <origin xyz="0 0 0.1"/>
      <mass value="1.0"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>
    </inertial>
    <collision><geometry><box size="0.1 0.1 0.2"/></geometry></collision>
  </link>
  <link name="hand">
    <inertial>
      <mass value="0.5"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>
    </inertial>
    <collision><geometry><mesh filename="meshes/hand.stl"/></geometry></collision>
  </link>
  <link name="tip"/>
  <joint name="shoulder" type="revolute">
    <origin xyz="0 0 0.2" rpy="0 0 0"/>
    <parent link="foot"/><child link="upper"/>
    <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="10" velocity="1"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="upper"/><child link="hand"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.1" effort="10" velocity="1"/>
  </joint>
  <joint name="end" type="fixed"><parent link="hand"/><child link="tip"/></joint>
</robot>
"""


def stl(corners: float = 1.0) -> bytes:
    """A tetrahedron as binary STL."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) * corners
    return written_stl(points[[[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]])


def described(folder: Path, urdf: str) -> Robot:
    """The robot of a description like `SOUND`, its files in a folder that is made."""
    (folder / "meshes").mkdir(parents=True)
    (folder / "arm.urdf").write_text(urdf)
    (folder / "arm.srdf").write_text('<robot name="arm"/>')
    (folder / "meshes" / "hand.stl").write_bytes(stl(0.1))
    joints = (Joint("shoulder", 100, 10, 10, 0.1, 0.0), Joint("slide", 100, 10, 10, 0.1, 0.0))
    return Robot(
        "arm",
        str(folder / "arm.urdf"),
        {"arm": str(folder)},
        str(folder / "arm.srdf"),
        joints,
        Gripper(("slide",), 0.05, 0.0, 10.0),
        "tip",
    )


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    return described(tmp_path / "arm", SOUND)


def written(robot: Robot, text: str | bytes) -> Robot:
    Path(robot.urdf).write_bytes(text if isinstance(text, bytes) else text.encode())
    return robot


def changed(robot: Robot, old: str, new: str) -> Robot:
    assert old in SOUND
    return written(robot, SOUND.replace(old, new, 1))


def refused(robot: Robot) -> str:
    """The sentence, which is one, names the file and holds no control character."""
    with pytest.raises(DescriptionError) as caught:
        PreparedRobot(robot)
    said = str(caught.value)
    assert "\n" not in said
    assert robot.urdf in said or "tool frame" in said
    assert len(said) < 1000
    assert_harmless_terminal(said)
    return said


def test_the_sound_one_is_taken(robot: Robot) -> None:
    check_robot(robot)
    prepared = PreparedRobot(robot)
    assert [joint.name for joint in prepared.joints] == ["shoulder", "slide"]
    RobotModel(robot)


HAND = '<mesh filename="meshes/hand.stl"/>'
AXIS = '<axis xyz="0 0 1"/>'
LIMIT = 'lower="-2" upper="2" effort="10" velocity="1"'
INERTIA = 'ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"'


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('<link name="tip"/>', '<link name="hand"/>', "link 'hand' is there already, in line 11"),
        ('joint name="slide"', 'joint name="shoulder"', "joint 'shoulder' is there already"),
        ('<link name="tip"/>', "<link/>", "a link has the name None"),
        ('<link name="tip"/>', '<link name=""/>', "a link has the name ''"),
        ('<link name="tip"/>', '<link name="../tip"/>', "a link has the name '../tip'"),
        ('<link name="tip"/>', '<link name="a&#10;b"/>', r"a link has the name 'a\nb'"),
        ('<link name="tip"/>', '<link name="&#x202e;x"/>', r"a link has the name '\u202ex'"),
        ('xyz="0 0 0.2"', 'xyz="1 2"', "joint 'shoulder' has <origin xyz='1 2'>; give 3 numbers"),
        ('xyz="0 0 0.2"', 'xyz="1 2 3 4"', "give 3 numbers"),
        ('xyz="0 0 0.2"', 'xyz="a b c"', "give 3 numbers"),
        ('xyz="0 0 0.2"', 'xyz="1_0 0 0"', "give 3 numbers"),
        ('xyz="0 0 0.2"', 'xyz="0 0 nan"', "has <origin xyz='0 0 nan'>; give finite numbers"),
        ('xyz="0 0 0.2"', 'xyz="0 0 1e300"', "give finite numbers up to 1e+06"),
        ('rpy="0 0 0"', 'rpy="inf 0 0"', "has <origin rpy='inf 0 0'>; give finite numbers"),
        ('<mass value="1.0"/>', '<mass value="-1"/>', "link 'upper' has the mass -1 kg"),
        ('<mass value="1.0"/>', '<mass value="NaN"/>', "give finite numbers"),
        ('<mass value="1.0"/>', "<mass/>", "link 'upper' has <mass value=''>; give a number"),
        ('<mass value="1.0"/>', "", "link 'upper' has no <mass>"),
        ('<mass value="1.0"/>', '<mass value="0"/>', "has moments of inertia and no mass"),
        ('<mass value="1.0"/>', '<mass value="1"/><mass value="2"/>', "has 2 <mass>; leave one"),
        (INERTIA, INERTIA.replace("ixx", "ixz"), "is not valid XML: duplicate attribute"),
        (INERTIA, INERTIA.replace(' iyz="0"', ""), "has <inertia iyz=''>; give a number"),
        (INERTIA, INERTIA.replace("0.01", "0.1", 1), "none is larger than the other two together"),
        (INERTIA, INERTIA.replace("0.01", "-0.1", 1), "principal moments -0.1, 0.01, 0.01 kg m^2"),
        (INERTIA, INERTIA.replace('ixy="0"', 'ixy="1"'), "they must be positive"),
        (INERTIA, INERTIA.replace("0.01", "0"), "they must be positive"),
        (HAND, "", "has a collision shape of nothing; it must be one box or mesh"),
        (HAND, '<sphere radius="1"/>', "has a collision shape of <sphere>"),
        (HAND, HAND + HAND, "has a collision shape of <mesh>, <mesh>"),
        ('size="0.1 0.1 0.2"', 'size="0.1 0.1"', "has <box size='0.1 0.1'>; give 3 numbers"),
        ('size="0.1 0.1 0.2"', 'size="0.1 0 0.2"', "has a box of size '0.1 0 0.2'"),
        ('size="0.1 0.1 0.2"', 'size="0.1 0.1 -1"', "edges are longer than 0"),
        (HAND, HAND.replace("/>", ' scale="2 2 2"/>'), "has a mesh with scale='2 2 2'"),
        (HAND, "<mesh/>", "has a mesh that cannot be used: '' is no path of a package"),
        ("hand.stl", "none.stl", "none.stl, which does not exist"),
        ("meshes/hand.stl", "/etc/passwd", "'/etc/passwd' is no path of a package"),
        ("meshes/hand.stl", "file:///etc/passwd", "is no path of a package"),
        ("meshes/hand.stl", "https://evil.example/a.stl", "is no path of a package"),
        ("meshes/hand.stl", "../../../../../../../../../etc/passwd", "out of the robot's folders"),
        ("meshes/hand.stl", "package://arm/../../x.stl", "out of the robot's folders"),
        ("<collision><geometry><box", '<collision><geometry/><geometry><box',
         "link 'upper' has 2 <geometry>; leave one"),
        ('<geometry><box size="0.1 0.1 0.2"/></geometry>', "", "link 'upper' has no <geometry>"),
        ('<geometry><box size="0.1 0.1 0.2"/></geometry>', "<geometry/>", "link 'upper' has"),
        ('<inertial>', '<inertial/><inertial>', "link 'upper' has 2 <inertial>; leave one"),
        ('<mass value="1.0"/>', "", "link 'upper' has no <mass>; give it one"),
        (f"<inertia {INERTIA}/>", "", "link 'upper' has no <inertia>; give it one"),
        ('xyz="0 0 0.1"', 'xyz="0 0"', "link 'upper' has <origin xyz='0 0'>; give 3 numbers"),
        ("<geometry><box", '<origin rpy="0"/><geometry><box', "link 'upper' has <origin rpy='0'>"),
        ('<origin xyz="0 0 0.2"', '<origin/><origin xyz="0 0 0.2"',
         "joint 'shoulder' has 2 <origin>; leave one"),
        (HAND, HAND.replace("/>", ' scale="2 2"/>'), "link 'hand' has <mesh scale='2 2'>; give 3"),
        (LIMIT, LIMIT.replace("10", "x"), "joint 'shoulder' has <limit effort='x'>; give a number"),
        ('<mass value="1.0"/>', '<mass value="1"/><mass/>', "link 'upper' has 2 <mass>"),
        (AXIS, AXIS + AXIS, "joint 'shoulder' has 2 <axis>; leave one"),
        (AXIS, AXIS + '<mimic joint="slide"/>' * 2, "joint 'shoulder' has 2 <mimic>; leave one"),
        (AXIS, AXIS + '<mimic joint="slide" offset="x"/>', "has <mimic offset='x'>; give a number"),
        ('rpy="0 0 0"', 'rpy="0 0"', "joint 'shoulder' has <origin rpy='0 0'>; give 3 numbers"),
        ("meshes/hand.stl", "package://arm//etc/passwd", "is no path of a package"),
        ("meshes/hand.stl", "package://../etc/passwd", "unknown package '..' (packages: arm)"),
        ("meshes/hand.stl", "package://arm", "is no path of a package"),
        ("meshes/hand.stl", "package://arm/package://arm/x", "is no path of a package"),
        ("meshes/hand.stl", "m" * 300, "File name too long"),
        ("meshes/hand.stl", "meshes/&#x1b;[2J.stl", "is not valid XML"),
        ("meshes/hand.stl", "arm.urdf", "is no mesh that every engine reads"),
        ("meshes/hand.stl", "meshes", "is no mesh that every engine reads"),
        ("meshes/hand.stl", "meshes/pipe.stl", "it is a pipe"),
        ("meshes/hand.stl", "meshes/folder.stl", "it is a folder"),
        ("meshes/hand.stl", "meshes/out.stl", "out of the robot's folders"),
        ("meshes/hand.stl", "meshes/loop.stl", "is no path"),
        ("meshes/hand.stl", "meshes/large.stl", "larger than 16 MB"),
        ("meshes/hand.stl", "meshes/text.stl", "holds no binary STL mesh"),
        ("meshes/hand.stl", "meshes/empty.stl", "holds no binary STL mesh"),
        ("meshes/hand.stl", "meshes/short.stl", "holds no binary STL mesh"),
        ("meshes/hand.stl", "meshes/nan.stl", "has a vertex that is not finite"),
        ("meshes/hand.stl", "meshes/far.stl", "has a vertex that is not finite, or more than"),
        ("meshes/hand.stl", "meshes/mm.stl", "50 m away; if it is in millimetres, scale it"),
        ('type="revolute"', 'type="continuous"', "is continuous, which no task can drive"),
        ('type="revolute"', 'type="floating"', "is floating"),
        ('type="revolute"', 'type="magic"', "has the type 'magic'; choose from revolute, prism"),
        ('type="revolute"', "", "has the type ''; choose from"),
        ('<child link="upper"/>', "", "joint 'shoulder' has no <child>"),
        ('<parent link="foot"/>', "", "joint 'shoulder' has no <parent>"),
        ('<child link="upper"/>', "<child/>", "has the child '', which is no link of the file"),
        ('<child link="upper"/>', '<child link="x"/>', "has the child 'x', which is no link"),
        ('<parent link="foot"/>', '<parent link="upper"/>', "joins link 'upper' to itself"),
        ('<child link="tip"/>', '<child link="hand"/>', "joins link 'hand' to itself"),
        ('<parent link="hand"/><child link="tip"/>', '<parent link="foot"/><child link="hand"/>',
         "leads to link 'hand', to which joint 'slide' leads too"),
        ('<child link="tip"/>', '<child link="foot"/>', "has 1 root links|no parent"),
        ('<link name="tip"/>', '<link name="tip"/><link name="lost"/>',
         "has 2 root links, not one: foot, lost"),
        ('<parent link="foot"/>', '<parent link="tip"/>', "run in a circle"),
        (AXIS, '<axis xyz="0 0 0"/>', "has the axis '0 0 0'; give it the length 1"),
        (AXIS, '<axis xyz="0 0 2"/>', "has the axis '0 0 2'; give it the length 1"),
        (AXIS, '<axis xyz="0 0 nan"/>', "give finite numbers"),
        (AXIS, "<axis/>", "has <axis xyz=''>; give 3 numbers"),
        (f"<limit {LIMIT}/>", "", "joint 'shoulder' has no <limit>"),
        (LIMIT, LIMIT.replace('lower="-2"', 'lower="3"'), "may go from 3 to 2; lower must be"),
        (LIMIT, LIMIT.replace('lower="-2"', 'lower="2"'), "may go from 2 to 2; lower must be"),
        (LIMIT, LIMIT.replace('lower="-2"', ""), "has <limit lower=''>; give a number"),
        (LIMIT, LIMIT.replace('upper="2"', 'upper="inf"'), "give finite numbers"),
        (LIMIT, LIMIT.replace('effort="10"', 'effort="-10"'), "has the effort limit '-10'"),
        (LIMIT, LIMIT.replace('velocity="1"', 'velocity="-1"'), "has the velocity limit '-1'"),
        (LIMIT, LIMIT.replace('velocity="1"', ""), "has <limit velocity=''>; give a number"),
        (AXIS, AXIS + '<mimic joint="slide"/>', ""),
        (AXIS, AXIS + "<mimic/>", "follows '', which is no moving joint"),
        (AXIS, AXIS + '<mimic joint="end"/>', "follows 'end', which is no moving joint"),
        (AXIS, AXIS + '<mimic joint="shoulder"/>', "follows itself (<mimic>)"),
        (AXIS, AXIS + '<mimic joint="slide" multiplier="x"/>', "has <mimic multiplier='x'>"),
        ('<link name="tip"/>', "".join(f'<link name="l{k}"/>' for k in range(300)), "303 links"),
        ("</robot>", "<x/>" * 100_001 + "</robot>", "has more than 100000 elements"),
        ("<robot ", '<!DOCTYPE robot SYSTEM "http://evil.example/x.dtd"><robot ', "<!DOCTYPE>"),
        ("<robot ", '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot ',
         "has a document type (<!DOCTYPE>), which may define entities; leave it out"),
        ("<robot ", '<!DOCTYPE robot [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;">'
         '<!ENTITY c "&b;&b;&b;&b;&b;">]><robot ', "<!DOCTYPE>"),
        ("</robot>", "<xacro:arm parent='tip'/></robot>", "<xacro:arm> is of xacro, which nothing"),
        ("</robot>", "", "is not valid XML"),
        ("</robot>", "</robot>garbage", "is not valid XML"),
        ("</robot>", "&undefined;</robot>", "is not valid XML: undefined entity"),
    ],
    ids=lambda value: value[:40],
)  # fmt: skip
def test_a_broken_file(robot: Robot, old: str, new: str, said: str) -> None:
    meshes = Path(robot.urdf).parent / "meshes"
    os.mkfifo(meshes / "pipe.stl")
    (meshes / "folder.stl").mkdir()
    outside = meshes.parent.parent / "outside.stl"
    outside.write_bytes(stl())
    (meshes / "out.stl").symlink_to(outside)
    (meshes / "loop.stl").symlink_to(meshes / "loop.stl")
    with (meshes / "large.stl").open("wb") as file:
        file.truncate(LARGEST_MESH + 1)
    (meshes / "text.stl").write_text("root:x:0:0:root:/root:/bin/sh\n" * 10)
    (meshes / "empty.stl").write_bytes(b"")
    (meshes / "short.stl").write_bytes(stl()[:-1])
    (meshes / "nan.stl").write_bytes(stl(np.nan))
    (meshes / "far.stl").write_bytes(stl(1e9))
    (meshes / "mm.stl").write_bytes(stl(100.0))
    if said:
        expected = said.split("|")[0]
        if new == '<child link="foot"/>':  # the root gets a parent, the tip has none
            expected = "run in a circle"
        assert expected in refused(changed(robot, old, new))
    else:
        PreparedRobot(changed(robot, old, new))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is not valid XML: no element found"),
        (b"\x7fELF\x02\x01\x01\0\0", "is not valid XML"),
        (b"just a text", "is not valid XML"),
        (b"\0" * 1000, "is not valid XML"),
        (b'<?xml version="1.0" encoding="magic"?><robot/>', "is not valid XML: unknown encoding"),
        (b"<sdf/>", "is no URDF: it holds <sdf>, not <robot>"),
        (b"<robot/>", "has 0 links"),
        (b"<robot>" * 90_000, "is not valid XML"),
        (b"<robot>" + b" " * 17 * 2**20 + b"</robot>", "it is larger than 16 MB"),
    ],
    ids=range(9),
)
def test_something_that_is_no_urdf(robot: Robot, content: bytes, said: str) -> None:
    assert said in refused(written(robot, content))


@pytest.mark.parametrize("path", ["/dev/zero", "/nowhere.urdf", "/etc", "{pipe}"])
def test_something_that_is_no_file(robot: Robot, tmp_path: Path, path: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    path = path.format(pipe=tmp_path / "pipe")
    assert refused(replace(robot, urdf=path)).startswith("cannot read the robot description")
    with pytest.raises(DescriptionError, match="cannot read the list of link pairs"):
        check_robot(replace(robot, srdf=path))


def test_a_list_of_link_pairs_with_entities(robot: Robot) -> None:
    Path(robot.srdf).write_text('<!DOCTYPE robot [<!ENTITY a "a">]><robot/>')
    with pytest.raises(DescriptionError, match="<!DOCTYPE>"):
        check_robot(robot)


def test_what_does_not_fit_the_drives(robot: Robot) -> None:
    assert "choose from foot, upper, hand, tip" in refused(replace(robot, tool_frame="nowhere"))
    late = replace(robot.joints[0], initial_position=3.0)
    assert "'shoulder' of arm starts at 3, and" in refused(
        replace(robot, joints=(late, robot.joints[1]))
    )
    bare = (
        '<inertial>\n      <mass value="0.5"/>\n      <inertia ' + INERTIA + "/>\n    </inertial>"
    )
    assert (
        "link 'hand' is moved by joint 'slide' and has no mass; give it an <inertial>"
        in refused(changed(robot, bare, ""))
    )


def test_meshes_that_some_engine_cannot_read(robot: Robot) -> None:
    folder = Path(robot.urdf).parent / "meshes"
    facet = "facet normal 0 0 1\nouter loop\n" + "vertex 0 0 1\n" * 3 + "endloop\nendfacet\n"
    (folder / "ascii.stl").write_text(f"solid a\n{facet}endsolid a\n")
    (folder / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (folder / "flat.stl").write_bytes(written_stl(read_stl(stl()) * [1.0, 1.0, 0.0]))
    (folder / "many.stl").write_bytes(written_stl(np.zeros((200_001, 3, 3))))
    for name, said in (
        ("ascii.stl", "holds no binary STL mesh"),
        ("a.obj", "is no mesh that every engine reads; give a binary .stl file"),
        ("flat.stl", "is flat: it has no convex hull"),
        ("many.stl", "has 200001 triangles; simplify it to 200000"),
    ):
        assert said in refused(changed(robot, "hand.stl", name))


def test_a_body_with_the_name_of_a_link(robot: Robot) -> None:
    for name in ("hand", "base"):
        box = Box(name, (0.1, 0.1, 0.1), Pose.at(1, 0, 0.5), mass=1.0)
        scene = Scene("s", (box,), robot)
        with pytest.raises(SceneError, match=f"a body is named '{name}', as a link of the robot"):
            check_names(scene)


ATTRIBUTES: list[tuple[str, str]] = [
    (element.tag, key) for element in ET.fromstring(SOUND).iter() for key in element.attrib
]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=300)
@given(
    place=st.integers(0, len(ATTRIBUTES) - 1),
    value=st.one_of(
        st.text(),
        st.floats().map(str),
        st.lists(st.floats(), max_size=4).map(lambda n: " ".join(map(str, n))),
        st.sampled_from(["foot", "upper", "hand", "tip", "shoulder", "slide", "fixed", "../x"]),
    ),
)
@example(ATTRIBUTES.index(("mesh", "filename")), "\U00018d09")  # assigned to nothing yet
@example(ATTRIBUTES.index(("mesh", "filename")), "\x1b[2Jx.stl")
def test_whatever_an_attribute_holds_it_is_sound_or_refused(
    robot: Robot, place: int, value: str
) -> None:
    xml = ET.fromstring(SOUND)
    attributes = [(element, key) for element in xml.iter() for key in element.attrib]
    element, key = attributes[place]
    element.set(key, value)
    written(robot, ET.tostring(xml, encoding="utf-8", xml_declaration=True))
    try:
        prepared = PreparedRobot(robot)
    except DescriptionError as error:
        assert_harmless_terminal(str(error))
        return
    for link in prepared.links.values():
        assert np.isfinite([link.mass, *link.centre, *link.inertia.flat]).all()
    assert all(np.isfinite(limits).all() for limits in prepared.limits.values())
    ET.fromstring(prepared.to_urdf())
