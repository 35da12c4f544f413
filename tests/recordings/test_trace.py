"""Traces, and the figure of a robot in them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_simbench.client.motion import Motion
from pytest_simbench.description.links import link_poses
from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.motion.registry import known, known_robot
from pytest_simbench.recordings.figure import Figure
from pytest_simbench.recordings.trace import Trace, TraceError
from pytest_simbench.scene import Pose
from tests.recordings.samples import motion, scene, trace


def test_it_is_read_back_without_the_robots_files(tmp_path: Path) -> None:
    kept = trace(phases=[(0.0, "pick"), (0.1, "place")])
    kept.write(tmp_path, "traces/x.npz")
    read = Trace.read(tmp_path / "traces" / "x.npz")
    assert kept.figure is not None
    assert read.figure is not None
    np.testing.assert_array_equal(read.time, kept.time)
    assert {read.time.dtype, read.joints.dtype, read.bodies.dtype} == {np.dtype(float)}
    np.testing.assert_allclose(read.joints, kept.joints, atol=1e-6)
    np.testing.assert_allclose(read.bodies, kept.bodies, atol=1e-6)
    assert (read.joint_names, read.body_names) == (list(kept.joint_names), ["red", "blue"])
    assert list(read.boxes) == list(kept.boxes)
    assert list(read.phases) == [(0.0, "pick"), (0.1, "place")]
    assert read.figure.to_wire() == kept.figure.to_wire()
    for mine, theirs in zip(read.figure.meshes, kept.figure.meshes, strict=True):
        np.testing.assert_array_equal(mine.vertices[mine.faces], theirs.vertices[theirs.faces])
    np.testing.assert_allclose(read.links(), kept.links(), atol=1e-6)


def test_it_names_no_path_of_this_machine(tmp_path: Path) -> None:
    trace().write(tmp_path, "x.npz")
    about = np.load(tmp_path / "x.npz")["about"].tobytes().decode()
    robot = scene().robot
    assert str(Path(robot.urdf).parent) not in about
    assert ".stl" not in about


def test_meshes_are_the_files_triangles() -> None:
    figure = trace().figure
    assert [len(mesh.faces) for mesh in figure.meshes] == [200, *[300] * 5, 200, 200, 200]
    assert max(float(abs(mesh.vertices).max()) for mesh in figure.meshes) < 0.5  # metres


def spoilt(path: Path, **changes: Any) -> None:
    """A written trace with some arrays replaced, or left out (None)."""
    trace().write(path.parent, path.name)
    arrays = {**np.load(path), **changes}
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})


def about(path: Path, **changes: Any) -> np.ndarray:
    trace().write(path.parent, path.name)
    told = {**json.loads(np.load(path)["about"].tobytes()), **changes}
    return np.frombuffer(json.dumps(told).encode(), dtype=np.uint8)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"about": None}, "of an older version"),
        ({"time": np.zeros(12)}, "its time does not go on"),
        ({"time": np.arange(12) * 1e10}, "its time is not from 0 to 2147483647 s"),
        ({"time": np.arange(12) - 1.0}, "its time is not from 0 to"),
        ({"time": np.full(12, np.nan)}, "its time are not finite numbers"),
        ({"joints": np.zeros((12, 2, 3))}, "its joints are not finite numbers in the shape"),
        ({"bodies": np.full((12, 2, 13), np.inf)}, "its bodies are not finite numbers"),
        ({"body_names": np.array(["a", "b"])}, "not those of its scene"),
        ({"joint_names": np.array(list("abcdefghi"))}, "no positions of the joints"),
        ({"faces_0": np.full((3, 3), 10**6)}, "a face of a mesh has no vertices"),
        ({"vertices_0": np.eye(3), "faces_0": np.array([[0, 1, 3]])}, "a face of a mesh has no"),
        ({"vertices_0": np.eye(3), "faces_0": np.array([[-1, 0, 1]])}, "a face of a mesh has no"),
        ({"faces_0": np.zeros((3, 3))}, "a face of a mesh has no vertices"),
        ({"faces_0": np.zeros((3, 4), int)}, "its meshes' faces are not finite numbers"),
        ({"vertices_0": np.zeros((9, 2))}, "its meshes' vertices are not finite numbers"),
        ({"time": None}, "it lacks 'time'"),
        ({"about": np.frombuffer(b"[1]", dtype=np.uint8)}, "is no trace of a repetition"),
        ({"about": np.frombuffer(b"{", dtype=np.uint8)}, "is no trace of a repetition"),
    ],
)
def test_what_is_no_trace_is_refused(changes: Any, message: str, tmp_path: Path) -> None:
    spoilt(tmp_path / "x.npz", **changes)
    with pytest.raises(TraceError, match=message):
        Trace.read(tmp_path / "x.npz")


def test_stamps_may_be_as_late_as_those_of_ros(tmp_path: Path) -> None:
    late = np.linspace(0.0, 2**31 - 1, 12)
    spoilt(tmp_path / "x.npz", time=late)
    assert Trace.read(tmp_path / "x.npz").time.tolist() == late.tolist()


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("phases", [[-1e300, "pick"]], "its time is not from 0 to"),
        ("parent", "panda_link1", "hangs on none before it"),
        ("axis", [0.0, 0.0, 0.0], "division by zero"),
        ("axis", ["x", "y", "z"], "'hinges.0..axis.0.': expected 'float', got 'str'"),
        ("link", "elbow", "a shape of 'elbow' is none"),
        ("mesh", None, "a shape of 'base' is none"),
        ("mesh", 99, "a shape of 'base' has no mesh"),
        ("pose", {"quaternion": [2, 0, 0, 0]}, "the quaternion of a shape of 'base' has"),
        ("origin", 7, "origin': expected 'dict', got 'int'"),
        ("origin", {"quaternion": [2, 0, 0, 0]}, "the quaternion of the joint 'panda_joint1' has"),
    ],
)
def test_a_robot_or_phase_that_cannot_be_is_refused(
    key: str, value: Any, message: str, tmp_path: Path
) -> None:
    wire = trace().figure.to_wire()
    wire["parts" if key in ("link", "mesh", "pose") else "hinges"][0][key] = value
    told = {"phases": value} if key == "phases" else {"figure": wire}
    spoilt(tmp_path / "x.npz", about=about(tmp_path / "y.npz", **told))
    with pytest.raises(TraceError, match=message):
        Trace.read(tmp_path / "x.npz")


def test_phases_in_which_no_time_passes_are_left_out() -> None:
    found = trace(phases=[(0.0, "launch"), (0.0, "pick"), (0.1, "task"), (0.1, "place")])
    assert list(found.phases) == [(0.0, "pick"), (0.1, "place")]


def test_it_ends_where_numbers_do(tmp_path: Path) -> None:
    moved = motion()
    moved.bodies[5:, 1, 2] = np.nan
    found = Trace.of(scene(), moved, [])
    assert len(found.time) == len(found.bodies) == len(found.joints) == 5
    found.write(tmp_path, "x.npz")
    assert len(Trace.read(tmp_path / "x.npz").time) == 5


def test_bodies_at_rest_cost_nothing(tmp_path: Path) -> None:
    """Ten minutes of cubes that tremble by less than anybody can see."""
    rng = np.random.default_rng(0)
    rest = motion(0)
    count = 30_000
    bodies = np.tile(rest.bodies[:1], (count, 1, 1)) + rng.normal(0, 1e-9, (count, 2, 13))
    still = Motion(np.arange(count) * 0.02, np.zeros((count, 2, 0)), bodies)
    Trace.of(scene(robot=False), still, []).write(tmp_path, "x.npz")
    assert (tmp_path / "x.npz").stat().st_size < bodies.astype(np.float32).nbytes / 10


@pytest.mark.parametrize("name", known())
def test_links_stand_where_the_engines_have_them(name: str) -> None:
    robot = known_robot(name)
    figure, prepared = Figure.of(robot), PreparedRobot(robot)
    rng = np.random.default_rng(0)
    positions = rng.uniform(-0.5, 0.5, (3, len(robot.joint_names)))
    found = figure.poses(robot.joint_names, positions)
    for k, row in enumerate(positions):
        expected = link_poses(prepared, row)
        assert set(figure.links) == expected.keys()
        for link, pose in zip(figure.links, found[k], strict=True):
            there = Pose.from_array(pose).matrix()
            np.testing.assert_allclose(there, expected[link].matrix(), atol=1e-9)
    assert {part.link for part in figure.parts} <= set(figure.links)
    assert all(len(mesh.faces) for mesh in figure.meshes)
