"""Swings for other arms: within the limits, in one plane, to the pyramid, as in their files."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import islice
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.cli.main import main
from pytest_simbench.motion import swing as module
from pytest_simbench.motion.collision import PlanningScene
from pytest_simbench.motion.errors import PlanningError, RobotError
from pytest_simbench.motion.files import read_robot
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.motion.registry import ARMS, find
from pytest_simbench.motion.swing import (
    LANDING,
    LANDING_TOLERANCE,
    LOWEST,
    THROWN,
    TRIED,
    _adjusted,
    _Candidate,
    _candidates,
    _easiest,
    _in_plane,
    _speed,
    found_swing,
)
from pytest_simbench.motion.throw import (
    LANDING_HEIGHT,
    SPEED_SHARE,
    feasible_swing,
    landing_x,
    released,
    swing_of,
)
from pytest_simbench.scene import STANDARD_GRAVITY, FloatArray, Pose, Robot, Scene, SceneError
from tests.motion.small_arm import TOML, small_arm

GRAVITY, START = np.array(STANDARD_GRAVITY), np.zeros(7)


def throw_of(robot: Robot):  # type: ignore[no-untyped-def]
    model = RobotModel(robot)
    timed, duration = feasible_swing(model, *swing_of(robot), GRAVITY, THROWN)
    return model, released(model, timed, duration, 0.5)


@pytest.mark.parametrize("name", ["ur5", "ur10", "xarm7"])
def test_the_swing_of_a_built_in_arm(name: str) -> None:
    robot = find(name)
    model, throw = throw_of(robot)
    landing = throw.landing(GRAVITY)
    assert landing == pytest.approx(LANDING, abs=0.01)
    # straight at the middle of the pyramid, also when the fingers let go 40 ms late
    for row in (throw.row, throw.row + 10):
        position = np.array(model.tool_pose(throw.timed.position[row]).position)
        velocity = model.tool_velocity(throw.timed.position[row], throw.timed.velocity[row])
        aside = position[1] + velocity[1] * (LANDING - position[0]) / velocity[0]
        assert aside == pytest.approx(0.0, abs=0.005)
    # not into the palm, the fingers opening across the flight
    axes = model.tool_transform(throw.timed.position[throw.row]).rotation
    assert throw.velocity @ axes[:, 2] >= 0.0
    assert abs(throw.velocity @ axes[:, 1]) < 0.01
    scene = PlanningScene(model, Scene("throw", (THROWN,), robot))
    scene.attach(THROWN.name, Pose())
    assert scene.first_collision(throw.timed.position[::10], ignored=(THROWN.name,)) is None


def test_the_file_has_what_the_command_finds(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["swing", "ur5"]) == 0
    found = capsys.readouterr().out.partition("\n")[2].strip()
    assert found in (ARMS / "ur5.toml").read_text("utf-8")


def test_it_lands_elsewhere_if_asked_to() -> None:
    """At half a cube's height in a scene of half the size."""
    robot = find("ur10")
    start, end = found_swing(robot, THROWN, GRAVITY, 1.2, 0.5)
    model, throw = throw_of(replace(robot, swing=(tuple(start.tolist()), tuple(end.tolist()))))
    whole = throw.timed.duration
    small = released(model, throw.timed, whole, throw.time / whole, 0.5)
    assert small.landing(GRAVITY) == pytest.approx(1.2, abs=LANDING_TOLERANCE / 2)


def test_candidates_throw_there_within_their_limits() -> None:
    model, scale = RobotModel(find("ur5")), 0.9
    limits = model.limits.column("velocity")
    _, moving = _in_plane(model, 1.2)
    found = list(islice(_candidates(model, GRAVITY, 1.2, scale), 3))
    again = next(_candidates(model, GRAVITY, 1.2, scale))
    assert (len(found), again.joints.tolist()) == (3, found[0].joints.tolist())
    for share, joints, velocity in found:
        tool, flight = model.tool_transform(joints), model.tool_velocity(joints, velocity)
        position = tool.translation
        landed = landing_x(position, flight, GRAVITY, LANDING_HEIGHT * scale)
        assert landed == pytest.approx(1.2, abs=1e-5)
        aside = position[1] + flight[1] * (1.2 - position[0]) / flight[0]
        assert aside == pytest.approx(0.0, abs=1e-5)
        assert flight @ tool.rotation[:, 2] >= -1e-9
        assert position[2] >= LOWEST * scale
        assert share == (np.abs(velocity) / limits).max() < SPEED_SHARE
        assert np.flatnonzero(velocity).tolist() == moving


@pytest.mark.parametrize("name", ["panda", "ur5", "xarm7"])
def test_the_fingers_open_across_a_plane_through_the_target(name: str) -> None:
    robot = find(name)
    *others, last = robot.arm_joints
    for turned in (-0.3, 0.4):
        bent = replace(last, initial_position=last.initial_position + turned)
        joints = (*others, bent, *robot.joints[len(others) + 1 :])
        model = RobotModel(replace(robot, joints=joints))
        ready, moving = _in_plane(model, 1.2)
        ready[moving] += 0.1
        tool = model.tool_transform(ready)
        across, away = tool.rotation[:, 1], np.array([1.2, 0.0, 0.0]) - tool.translation
        assert (across[2], away @ across) == pytest.approx((0.0, 0.0), abs=1e-5)


def test_joints_share_a_velocity_by_their_limits() -> None:
    """The second one alone makes the second part; shares 1 and 1 of the others make the first."""
    ways, limits = np.array([[1.0, 0.0, 2.0], [0.0, -1.0, 0.0]]), np.array([1.0, 4.0, 3.0])
    assert _easiest(ways, np.array([-7.0, 2.0]), limits) == pytest.approx([-1.0, -2.0, -3.0])
    assert _easiest(0 * ways, np.array([-7.0, 2.0]), limits).tolist() == [np.inf] * 3


def test_the_easiest_swings_are_tried_first_and_so_many(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the thing in the hand, whose fingers touch it."""
    tried: list[float] = []

    def adjusted(model: RobotModel, scene: PlanningScene, release: object, *rest: object) -> object:
        assert (scene.held, scene.opening, scene.scale) == (THROWN.name, 0.025, 0.5)
        assert rest == (THROWN, GRAVITY, 1.3)
        tried.append(release.share)  # type: ignore[attr-defined]
        return "swing" if tried[-1] == 0.3 else None

    def candidates(*given: object) -> list[_Candidate]:
        assert given[1:] == (GRAVITY, 1.3, 0.5)
        return [_Candidate(share, START, START) for share in shares]

    monkeypatch.setattr(module, "_adjusted", adjusted)
    monkeypatch.setattr(module, "_candidates", candidates)
    shares = [0.5, 0.3, 0.2, 0.9]
    assert found_swing(panda(), THROWN, GRAVITY, 1.3, 0.5) == "swing"
    assert tried == [0.2, 0.3]
    shares = [0.4] * 20
    with pytest.raises(RobotError, match=r"^robot 'panda' cannot throw to x = 1.3 m: no swing"):
        found_swing(panda(), THROWN, GRAVITY, 1.3, 0.5)
    assert len(tried) == 2 + TRIED


@pytest.mark.parametrize(
    ("wanted", "below", "found"),
    [(0.3, 1.5, True), (0.45, 1.5, True), (0.52, 1.5, False), (0.05, 1.5, False),
     (0.15, 0.1, True), (0.3, 0.1, False), (0.3, 0.01, False), (0.08, 0.05, False)],
)  # fmt: skip
def test_a_swing_is_as_long_as_its_throw_must_be(
    wanted: float, below: float, found: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a throw that goes as far as its swing is long: through the release, from a fifth of a
    first guess on, no longer than what is free (0.5 s) nor beyond limits that stand `below`."""
    model = RobotModel(panda())
    joints, velocity = model.home, np.eye(7)[1]
    joints[1] = model.upper[1] - below

    def planned(arm: object, start: FloatArray, end: FloatArray, *rest: object) -> object:
        assert (arm, *rest) == (model, GRAVITY, THROWN)
        if start[1] > 1.65:
            raise PlanningError("too weak")
        return (start, end), 2.0

    def thrown(arm: object, ends: tuple[FloatArray, FloatArray], *rest: object) -> object:
        assert (arm, *rest) == (model, 2.0, 0.5, 0.5)
        way = ends[1][1] - ends[0][1]
        return SimpleNamespace(landing=lambda g: way if g is GRAVITY and way > 0.1 else None)

    def touched(path: FloatArray, ignored: tuple[str, ...]) -> object:
        assert (len(path), ignored) == (60, (THROWN.name,))
        return None if path[-1][1] - path[0][1] < 0.5 else ("hand", "ground")

    monkeypatch.setattr(module, "feasible_swing", planned)
    monkeypatch.setattr(module, "released", thrown)
    planning = SimpleNamespace(scale=0.5, first_collision=touched)
    swing = _adjusted(model, planning, _Candidate(0.5, joints, velocity), THROWN, GRAVITY, wanted)  # type: ignore[arg-type]
    assert (swing is not None) is found
    if swing is not None:
        assert sum(swing) / 2 == pytest.approx(joints)
        assert swing[1] - swing[0] == pytest.approx(wanted * velocity, abs=LANDING_TOLERANCE / 2)


@given(st.floats(0.2, 3.0), st.floats(0.1, 1.5), st.floats(0.0, 1.0))
def test_a_flight_of_that_speed_goes_so_far(away: float, drop: float, elevation: float) -> None:
    speed = _speed(away, drop, elevation, GRAVITY)
    velocity = speed * np.array([np.cos(elevation), 0.0, np.sin(elevation)])
    assert landing_x(np.array([0.0, 0.0, drop]), velocity, GRAVITY, 0.0) == pytest.approx(away)


def test_too_far_is_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["swing", "ur5", "--landing=30"]) == 2
    said = "robot 'ur5' cannot throw to x = 30 m: no swing within its limits was found\n"
    assert capsys.readouterr().err == f"simbench swing: {said}"
    assert main(["swing", "ur7"]) == 2
    assert "unknown robot 'ur7'; choose from" in capsys.readouterr().err


def test_a_file_may_have_a_swing(tmp_path: Path) -> None:
    swing = "[throw]\nstart = [0.1, 0.2, 0.3]\nend = [0.4, 0.5, 0.6]\n"
    robot = read_robot(small_arm(tmp_path, TOML + swing))
    assert robot.swing == ((0.1, 0.2, 0.3), (0.4, 0.5, 0.6))
    assert Robot.from_wire(robot.to_wire()).swing is None
    robot = read_robot(small_arm(tmp_path))
    told = "'small' has no swing for the throw: write one into its file, under [throw]"
    with pytest.raises(RobotError, match=re.escape(told)):
        swing_of(robot)
    with pytest.raises(RobotError, match="arms whose first joint is upright and whose last one"):
        _in_plane(RobotModel(robot), 1.2)


def test_a_swing_has_a_number_for_each_joint() -> None:
    with pytest.raises(SceneError, match=r"the swing \[rad\] of 'panda'"):
        replace(panda(), swing=((0.0,), (1.0,)))
