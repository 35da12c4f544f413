"""Logs that a scene follows: three formats say the same, and what cannot be is one sentence."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_simbench.recordings import logs
from pytest_simbench.recordings.bag import write_bag
from pytest_simbench.recordings.logs import beyond, read_log
from pytest_simbench.scene import Box, Compound, Pose, Scene
from pytest_simbench.simulator import DescriptionError
from pytest_simbench.tasks import Log
from tests.approval import assert_approved
from tests.recordings.samples import scene, trace
from tests.tasks.scripted_scene import SCENE

TIME = np.arange(21) * 0.05
HINGE = 0.5 * np.sin(TIME)
FRAME = Pose.at(0, 0, -0.1)
TABLE = Compound(
    "table", (Box("top", (0.1, 0.1, 0.1), Pose.at(0, 0, 0)),), Pose.at(1, 0, 0.3), 1.0,
    moments=(0.01,) * 3, file_frame=FRAME,
)  # fmt: skip
WHOLE = replace(SCENE, bodies=(TABLE,), file_lift=0.2)


def npz(folder: Path, **arrays: Any) -> Path:
    np.savez(folder / "log.npz", **arrays)
    return folder / "log.npz"


def table(folder: Path, text: str) -> Path:
    (folder / "log.csv").write_text(text, errors="surrogateescape")
    return folder / "log.csv"


@pytest.mark.parametrize("begins", [3.0, 1.7e9])  # as of a robot, whose clock counts from 1970
def test_a_joint_that_is_not_named_holds_its_start(tmp_path: Path, begins: float) -> None:
    log = read_log(npz(tmp_path, time=TIME + begins, hinge=HINGE), SCENE)
    assert log.trajectory.tick == pytest.approx(0.05)
    assert log.trajectory.position[:, 0] == pytest.approx(HINGE, abs=1e-6)
    assert (log.trajectory.position[:, 1] == 0.05).all()
    assert not log.trajectory.velocity.any()
    assert log.joints == ["hinge"]
    assert log.start.positions == (0.0, 0.05)


def test_what_a_drive_was_told_is_followed_and_what_was_measured_is_kept(tmp_path: Path) -> None:
    log = read_log(npz(tmp_path, time=TIME, hinge=HINGE, **{"hinge/command": TIME + 0.5}), SCENE)
    assert log.trajectory.position[:, 0] == pytest.approx(TIME + 0.5)
    assert log.seen["hinge"] == pytest.approx(HINGE)
    assert (log.joints, log.told) == (["hinge"], ["hinge"])
    assert log.start.positions == (0.0, 0.05)
    assert not read_log(npz(tmp_path, time=TIME, hinge=HINGE), SCENE).told


def test_a_log_may_be_of_bodies_alone(tmp_path: Path) -> None:
    poses = np.tile([1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (21, 1))
    for world in (WHOLE, replace(WHOLE, robot=None)):
        log = read_log(npz(tmp_path, time=TIME, **{"table/pose": poses}), world)
        assert log.joints == beyond(log, world) == []
        assert log.trajectory.duration == pytest.approx(1.0)
        assert log.seen["table/pose"][:, 2] == pytest.approx(0.2)


def test_npz_and_csv_of_the_same_are_the_same_log(tmp_path: Path) -> None:
    speed = {"hinge/velocity": 0.5 * np.cos(TIME), "hinge/effort": 2 * TIME}
    rows = zip(TIME, HINGE, *speed.values(), strict=True)
    lines = "\n".join(", ".join(map(repr, map(float, row))) for row in rows)
    first = read_log(npz(tmp_path, time=TIME, hinge=HINGE, **speed), SCENE)
    second = read_log(
        table(tmp_path, f"time, hinge,hinge/velocity,hinge/effort\n{lines}\n\n"), SCENE
    )
    assert same(first, second)
    assert first.trajectory.velocity[-1] == pytest.approx([0.5 * np.cos(1.0), 0.0])
    assert first.trajectory.effort[-1] == pytest.approx([2.0, 0.0])
    assert first.digest == second.digest
    assert first.digest != read_log(npz(tmp_path, time=TIME, hinge=HINGE + 0.1), SCENE).digest


def same(a: Log, b: Log) -> bool:
    return all(
        np.allclose(one, other, atol=1e-6)
        for one, other in zip(vars(a.trajectory).values(), vars(b.trajectory).values(), strict=True)
    )


def test_whole_arrays_are_in_the_order_of_the_scene(tmp_path: Path) -> None:
    position = np.stack([HINGE, 0.1 * TIME], axis=1)
    parts = {"position": 1.0, "velocity": 2.0, "effort": 3.0}
    path = npz(tmp_path, time=TIME, **{what: k * position for what, k in parts.items()})
    whole, names = read_log(path, SCENE), {}
    for part, k in zip(("", "/velocity", "/effort"), parts.values(), strict=True):
        names |= {f"hinge{part}": k * HINGE, f"slider{part}": k * 0.1 * TIME}
    assert same(whole, read_log(npz(tmp_path, time=TIME, **names), SCENE))


def test_uneven_times_become_even_ones(tmp_path: Path) -> None:
    time = np.array([0.0, 0.1, 0.2, 0.4, 0.5, 0.6])
    log = read_log(npz(tmp_path, time=time, hinge=time), SCENE)
    assert log.trajectory.tick == pytest.approx(0.1)
    assert log.trajectory.position[:, 0] == pytest.approx(np.arange(7) * 0.1)


def test_a_log_may_be_as_short_long_and_far_as_is_said(tmp_path: Path) -> None:
    for lasts in (logs.SHORTEST, logs.LONGEST):
        time, far = np.linspace(0.0, lasts, 21), np.full(21, -logs.FARTHEST)
        log = read_log(npz(tmp_path, time=time, hinge=far), SCENE)
        assert log.trajectory.duration == pytest.approx(lasts)


def test_a_start_out_of_range_is_the_nearest_end_and_commands_are_as_logged(tmp_path: Path) -> None:
    log = read_log(npz(tmp_path, time=TIME, slider=TIME + 1.2), SCENE)
    assert log.start.positions == (0.0, 1.0)
    assert log.trajectory.position[0, 1] == 1.2
    told = "slider goes from {} to {} rad or m, and in scene 'two joints' it stops at -1 and 1"
    assert beyond(log, SCENE) == [told.format(1.2, 2.2)]
    below, level = (
        read_log(npz(tmp_path, time=TIME, slider=TIME - end), SCENE) for end in (1.0011, 1.0009)
    )
    assert beyond(below, SCENE) == [told.format(-1.001, -0.0011)]
    assert not beyond(level, SCENE)
    started = SCENE.at_start(log.start)
    assert started.robot.joints[1].initial_position == 1.0


def test_bodies_start_and_end_where_the_log_has_them(tmp_path: Path) -> None:
    """In the frames of the file, which lies 0.2 m below the scene."""
    poses = np.tile([1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (21, 1))
    poses[:, 1] = TIME
    told = {"hinge/effort": TIME, "slider/command": 0.1 * TIME, "slider/velocity": 0.2 * TIME}
    path = npz(tmp_path, time=TIME, hinge=TIME + 0.1, **told, **{"table/pose": poses})
    log = read_log(path, WHOLE)
    assert_approved("log", str(log))
    assert log.start.bodies == log.end.bodies == ("table",)
    assert log.end.poses[0].position == pytest.approx((1.0, 1.0, 0.2))
    body = WHOLE.at_start(log.start).body("table")
    assert body.pose.position == pytest.approx((1.0, 0.0, 0.3))


@pytest.mark.parametrize("robot", [True, False])
def test_a_recording_of_ours_is_read_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, robot: bool
) -> None:
    kept, world = trace(robot=robot), scene(robot=robot)
    write_bag(kept, tmp_path / "run")
    log = read_log(tmp_path / "run" / "run.mcap", world)
    if robot:
        assert log.trajectory.position == pytest.approx(kept.joints[:, 0], abs=1e-5)
        assert log.trajectory.velocity == pytest.approx(kept.joints[:, 1], abs=1e-5)
    assert log.trajectory.duration == pytest.approx(kept.time[-1] - kept.time[0])
    ends = dict(zip(log.end.bodies, log.end.poses, strict=True))
    for name, row in zip(kept.body_names, kept.bodies[-1], strict=True):
        assert ends[name].as_array() == pytest.approx(row[:7], abs=1e-5)
    monkeypatch.setattr(logs, "MOST", 3)
    with pytest.raises(DescriptionError, match="is no recording: it holds more than 3 messages"):
        read_log(tmp_path / "run" / "run.mcap", world)


def test_a_recording_has_a_number_for_each_name(tmp_path: Path) -> None:
    kept = trace()
    write_bag(replace(kept, joint_names=[*kept.joint_names, "wrist"]), tmp_path / "run")
    with pytest.raises(DescriptionError, match="is no recording: zip.. argument 2 is shorter"):
        read_log(tmp_path / "run" / "run.mcap", scene())


@pytest.mark.parametrize(
    ("arrays", "why"),
    [
        ({"time": TIME, "knee": TIME}, "holds 'knee'.* it has hinge, slider, table/pose"),
        ({"time": TIME, "table/pose": np.zeros((21, 7)), "hinge": TIME}, "no unit length"),
        ({"time": TIME, "hinge": TIME * np.nan}, "no finite number of 'hinge' in row 0"),
        ({"time": TIME, "hinge": TIME * 1e10}, "a number of 'hinge' beyond 1e.09 .in SI units"),
        ({"time": TIME[::-1], "hinge": TIME}, "goes from 1 s to 0.95 s in row 1"),
        ({"time": 1.7e9 - TIME, "hinge": TIME}, "goes from 1700000000 s to 1699999999.95 s in row"),
        ({"time": np.minimum(TIME, 0.5), "hinge": TIME}, "goes from 0.5 s to 0.5 s in row 11"),
        ({"time": TIME, "hinge": TIME[1:]}, r"'hinge' in the shape \(20,\) instead of \(21,\)"),
        ({"time": TIME, "hinge": np.array(["a"] * 21)}, "which is no column of numbers"),
        ({"time": np.array(3.0), "hinge": TIME}, "which is no column of numbers"),
        ({"time": TIME, "position": np.zeros((21, 3))}, "of 3 joints, and the scene has 2"),
        ({"time": TIME, "hinge/velocity": TIME}, "has positions of no joint"),
        ({"hinge": TIME}, "no column 'time'"),
        ({"time": TIME[:20].reshape(10, 2), "hinge": TIME[:10]}, "no column 'time'"),
        ({"time": TIME, "hinge": np.zeros(0)}, "in the shape"),
        ({"time": TIME * 0.01, "hinge": TIME}, "lasts 0.01 s"),
        ({"time": TIME * 1000, "hinge": TIME}, "lasts 1000 s"),
    ],
)
def test_what_cannot_be_is_one_sentence(tmp_path: Path, arrays: Any, why: str) -> None:
    with pytest.raises(DescriptionError, match=f"log.npz .*{why}"):
        read_log(npz(tmp_path, **arrays), WHOLE)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("time,hinge\n0,0\n1\n", "line 3: 1 values for 2 columns"),
        ("time,hinge\n0,0\n1,a\n", "line 3: could not convert"),
        ("time,time\n0,0\n", "two columns of one name"),
        ("time,hinge\n0,0\n1,nan\n", "no finite number of 'hinge' in row 1"),
        ("", "no column 'time'"),
        ("\udcff,hinge\n0,0\n", "no column 'time'"),
    ],
)
def test_a_table_that_cannot_be_is_told_with_its_line(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises(DescriptionError, match=why):
        read_log(table(tmp_path, text), SCENE)


def test_a_table_counts_joints_from_where_its_file_does(tmp_path: Path) -> None:
    joints = SCENE.arm.with_joints("hinge", "slider", file_zero=0.5)
    text = "time,hinge,slider,slider/command,slider/velocity\n0,0,1,1,1\n1,1,1,2,1\n"
    log = read_log(table(tmp_path, text), replace(SCENE, robot=joints))
    assert log.start.positions == (-0.5, 0.5)
    assert log.trajectory.position.tolist() == [[-0.5, 0.5], [0.5, 1.5]]
    assert log.trajectory.velocity.tolist() == [[0.0, 1.0], [0.0, 1.0]]


def test_what_is_no_log_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DescriptionError, match=r"log.txt is no log; give .npz, .csv, .mcap"):
        read_log(tmp_path / "log.txt", SCENE)
    for name in ("log.csv", "log.mcap"):
        with pytest.raises(DescriptionError, match="the log .*: No such file"):
            read_log(tmp_path / name, SCENE)
    (tmp_path / "log.mcap").write_bytes(b"\x89MCAP0\r\n and no more")
    with pytest.raises(DescriptionError, match="log.mcap is no recording"):
        read_log(tmp_path / "log.mcap", SCENE)
    with pytest.raises(DescriptionError, match="has no joints"):
        read_log(tmp_path / "log.npz", Scene("empty"))
    monkeypatch.setattr(logs, "LARGEST", 10)
    with pytest.raises(DescriptionError, match="larger than"):
        read_log(npz(tmp_path, time=TIME, hinge=HINGE), SCENE)
