"""A recording says what the trace says, read back by `mcap` and by `rosbags`."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from pytest_simbench.recordings import bag
from pytest_simbench.recordings.bag import BagsUnavailable, frame_of, write_bag
from pytest_simbench.recordings.trace import Trace
from pytest_simbench.scene import Pose
from tests.approval import assert_approved
from tests.hostile import HOSTILE
from tests.recordings.samples import SAMPLES, motion, trace

LATCHED = {"/tf_static", "/markers", "/robot_description"}
STORE = get_typestore(Stores.ROS2_JAZZY)


def messages(folder: Path) -> dict[str, list[tuple[int, Any]]]:
    """By topic the stamps [ns] and messages, read by rosbags from the folder's metadata.yaml."""
    found: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([folder]) as reader:
        for connection, stamp, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((stamp, message))
    return found


def messages_of_mcap(folder: Path) -> dict[str, list[tuple[int, Any]]]:
    """The same, read by Foxglove's own library from the one MCAP file."""
    (path,) = folder.glob("*.mcap")
    found: dict[str, list[tuple[int, Any]]] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            read = STORE.deserialize_cdr(message.data, schema.name)
            found.setdefault(channel.topic, []).append((message.log_time, read))
    return found


def pose(transform: Any) -> list[float]:
    t, q = transform.translation, transform.rotation
    return [t.x, t.y, t.z, q.w, q.x, q.y, q.z]


@pytest.mark.parametrize("read", [messages, messages_of_mcap])
def test_it_reads_back_as_the_trace(read: Any, tmp_path: Path) -> None:
    kept = trace()
    kept.write(tmp_path, "x.npz")
    write_bag(Trace.read(tmp_path / "x.npz"), tmp_path / "x")
    found = read(tmp_path / "x")
    states = found["/joint_states"]
    assert len(states) == len(kept.time)
    for k, (stamp, state) in enumerate(states):
        assert stamp == state.header.stamp.sec * 10**9 + state.header.stamp.nanosec
        assert stamp == pytest.approx(kept.time[k] * 1e9, abs=1)
        assert state.name == list(kept.joint_names)
        np.testing.assert_allclose(state.position, kept.joints[k, 0], atol=1e-6)
        np.testing.assert_allclose(state.velocity, kept.joints[k, 1], atol=1e-6)
    for k, (_, message) in enumerate(found["/tf"]):
        frames = {
            t.child_frame_id: (t.header.frame_id, pose(t.transform)) for t in message.transforms
        }
        for body, box in enumerate(kept.free):
            parent, found_pose = frames[frame_of(box)]
            assert parent == "world"
            np.testing.assert_allclose(found_pose, kept.bodies[k, body, :7], atol=1e-6)
    assert [m.clock.sec * 10**9 + m.clock.nanosec for _, m in found["/clock"]] == [
        stamp for stamp, _ in states
    ]


def test_links_stand_where_the_model_has_them(tmp_path: Path) -> None:
    """Along /tf from the root, as a viewer goes, against the adapters' own forward kinematics."""
    from pytest_simbench.description.links import link_poses
    from pytest_simbench.description.urdf import PreparedRobot
    from pytest_simbench.motion.panda import panda

    kept = trace()
    write_bag(kept, tmp_path / "x")
    found = messages(tmp_path / "x")
    prepared = PreparedRobot(panda())
    for k, (_, message) in enumerate(found["/tf"]):
        positions = dict(zip(kept.joint_names, kept.joints[k, 0], strict=True))
        expected = link_poses(prepared, positions)
        poses = {"base": Pose()}
        for transform in message.transforms:
            if not transform.child_frame_id.startswith("bodies/"):
                own = Pose.from_array(pose(transform.transform))
                poses[transform.child_frame_id] = poses[transform.header.frame_id] * own
        assert poses.keys() == expected.keys()
        for name, there in poses.items():
            np.testing.assert_allclose(there.matrix(), expected[name].matrix(), atol=1e-6)


def test_what_does_not_change_is_latched_and_said_once(tmp_path: Path) -> None:
    kept = trace()
    write_bag(kept, tmp_path / "x")
    found = messages(tmp_path / "x")
    assert {topic for topic, sent in found.items() if len(sent) == 1} >= LATCHED
    assert all(found[topic][0][0] == found["/clock"][0][0] for topic in LATCHED)
    with AnyReader([tmp_path / "x"]) as reader:
        told = {c.topic: str(*c.ext.offered_qos_profiles) for c in reader.connections}
    assert {topic for topic, quality in told.items() if "TRANSIENT_LOCAL" in quality} == LATCHED
    assert_approved("qos", "\n".join(sorted(set(told.values()))))
    urdf = found["/robot_description"][0][1].data
    assert urdf.startswith("<robot")
    assert "mesh" not in urdf
    assert "panda_joint7" in urdf


def test_every_shape_has_a_marker_in_a_frame_that_there_is(tmp_path: Path) -> None:
    kept = trace()
    write_bag(kept, tmp_path / "x")
    found = messages(tmp_path / "x")
    markers = found["/markers"][0][1].markers
    frames = {
        t.child_frame_id for topic in ("/tf", "/tf_static") for t in found[topic][0][1].transforms
    }
    assert {marker.header.frame_id for marker in markers} <= frames
    assert len({(marker.ns, marker.id) for marker in markers}) == len(markers)
    triangles = [m for m in markers if m.type == m.TRIANGLE_LIST and m.ns == "robot"]
    assert sum(len(m.points) for m in triangles) == 3 * sum(
        len(m.faces) for m in kept.figure.meshes
    )


def test_a_link_that_is_a_box_is_drawn_where_it_is(tmp_path: Path) -> None:
    kept = trace()
    box = replace(kept.figure.parts[3], mesh=None, size=(0.1, 0.2, 0.3), pose=Pose.at(1, 2, 3))
    write_bag(replace(kept, figure=replace(kept.figure, parts=[box])), tmp_path / "x")
    marker = messages(tmp_path / "x")["/markers"][0][1].markers[-1]
    at, size = marker.pose.position, marker.scale
    assert (marker.type, marker.ns, marker.header.frame_id) == (marker.CUBE, "robot", box.link)
    assert [at.x, at.y, at.z, size.x, size.y, size.z] == [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]


def test_messages_are_what_somebody_approved(tmp_path: Path) -> None:
    write_bag(trace(robot=False), tmp_path / "x")
    found = sorted(messages(tmp_path / "x").items())
    lines = [f"{topic} {stamp} {message}" for topic, sent in found for stamp, message in sent[:2]]
    assert_approved("bag", "\n".join(lines))


def test_phases_are_log_messages_at_their_own_time(tmp_path: Path) -> None:
    write_bag(trace(phases=[(0.0, "pick"), (0.11, "place"), (9.0, "settle")]), tmp_path / "x")
    found = messages(tmp_path / "x")["/rosout"]
    assert [(stamp, m.msg) for stamp, m in found] == [
        (0, "pick"), (110_000_000, "place"), (9_000_000_000, "settle")
    ]  # fmt: skip


def named(hostile: Sequence[str]) -> Trace:
    """A stranger's trace: each name of the robot's is one of these texts, its description is all of
    them. A body refuses such names."""
    kept = trace(phases=[(0.01 * k, text) for k, text in enumerate(hostile)])
    text = itertools.cycle(hostile)
    links = {name: f"{name} {next(text)}" for name in kept.figure.links}
    joints = {name: f"{name} {next(text)}" for name in kept.joint_names}
    hinges = [
        replace(h, name=joints[h.name], parent=links[h.parent], child=links[h.child])
        for h in kept.figure.hinges
    ]
    parts = [replace(part, link=links[part.link]) for part in kept.figure.parts]
    root, urdf = links[kept.figure.root], "\n".join(hostile)
    figure = replace(kept.figure, root=root, hinges=hinges, parts=parts, urdf=urdf)
    return replace(kept, figure=figure, joint_names=list(joints.values()))


def texts(message: Any) -> Iterator[str]:
    """All texts in a message and the messages in it."""
    if isinstance(message, str):
        yield message
    elif isinstance(message, list):
        for item in message:
            yield from texts(item)
    elif is_dataclass(message):
        for field in fields(message):
            yield from texts(getattr(message, field.name))


@pytest.mark.parametrize("read", [messages, messages_of_mcap])
def test_hostile_names_stay_text(read: Any, tmp_path: Path) -> None:
    """Of links, joints, phases, the robot's description, and what metadata tell."""
    hostile = (*HOSTILE[:10], "x\x00y", "\u2028\u2029", "A" * 5000)
    told = {f"text {k}": text for k, text in enumerate(HOSTILE)}
    write_bag(named(hostile), tmp_path / "x", told)
    found = read(tmp_path / "x")
    assert len(found["/tf"]) == SAMPLES
    assert len(found["/rosout"]) == len(hostile)
    seen = {t for sent in found.values() for _, message in sent for t in texts(message)}
    assert sum("owned" in text for text in seen) > 2
    description = found["/robot_description"][0][1].data
    assert [t for t in (seen - {description}) if not t.isprintable()] == []
    assert all(line.isprintable() for line in description.split("\n"))
    metadata = (tmp_path / "x" / "metadata.yaml").read_text()
    assert all(line.isprintable() for line in metadata.splitlines())


def test_the_lines_of_a_description_stay_lines(tmp_path: Path) -> None:
    kept = trace()
    assert kept.figure is not None
    urdf = "<robot>\n" + "<a/>" * 10_000 + "\x1b\n</robot>"
    write_bag(replace(kept, figure=replace(kept.figure, urdf=urdf)), tmp_path / "x")
    data = messages(tmp_path / "x")["/robot_description"][0][1].data
    assert data == urdf.replace("\x1b", "\\x1b")


def test_a_scene_without_a_robot_is_a_bag_too_and_one_is_replaced_whole(tmp_path: Path) -> None:
    write_bag(trace(), tmp_path / "x")
    write_bag(trace(robot=False), tmp_path / "x")
    found = messages(tmp_path / "x")
    assert not {"/joint_states", "/robot_description"} & found.keys()
    assert len(found["/tf"]) == len(motion(0).time)
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


def test_what_is_missing_is_one_sentence(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(BagsUnavailable, match=r"pip install 'pytest-simbench\[ros\]'"):
        bag.write_bag(trace(), tmp_path / "x")
