"""States that are none, from a real engine with an adapter that errs: found, named, survived."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repeater import Repeater
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.records.record import Record
from pytest_simbench.scene import Box, Pose, Scene, Trajectory
from pytest_simbench.simulator import ParityError, StateError
from pytest_simbench.tasks import Stacking
from pytest_simbench.tasks.base import Count, Jitter, Outcome
from pytest_simbench.worker.state import check_following, check_start, checked_state
from tests.client.failing import Silent
from tests.tiny import Falling
from tests.worker.misshapen import BODIES, BUILT, JOINTS, LATER, LATER_TIMES, TIMES

ROBOT = Stacking().scene(1, Jitter()).robot


@dataclass(frozen=True)
class Turning(Falling):
    """The arm turns joints 1 to 3, each by another angle, while two cubes lie beside it."""

    name: ClassVar[str] = "turning"

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        cubes = Stacking().scene(seed, jitter).bodies
        return Scene("turning", cubes, ROBOT)

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        assert ROBOT is not None
        start = ROBOT.column("initial_position")
        position = np.tile(start, (200, 1))
        for joint, angle in enumerate((0.5, -0.1, -0.4)):
            position[:, joint] += angle * np.minimum(1.0, np.linspace(0.0, 2.0, 200))
        rest = np.zeros_like(position)
        with world.phase("turn"):
            world.follow(Trajectory(0.01, position, rest, rest), log_period=0.05)
        return Outcome({"landed": 1.0})


def misshapen(case: Case, fault: str) -> Case:
    adapter = "tests.worker.misshapen:Misshapen"
    return replace(case, adapter=adapter, environment={"UNRULY": fault}, stall_timeout=60.0)


EXPECTED = {
    "too few joints": "joint_state() must be an array of float64 (2, 9), not float64 (2, 8)",
    "no velocities": "joint_state() must be an array of float64 (2, 9), not float64 (9,)",
    "joints transposed": "joint_state() must be an array of float64 (2, 9), not float64 (9, 2)",
    "joints as a list": "joint_state() must be an array of float64 (2, 9), not a list",
    "joints of float32": "joint_state() must be an array of float64 (2, 9), not float32 (2, 9)",
    "joints of int": "joint_state() must be an array of float64 (2, 9), not int64 (2, 9)",
    "joints of objects": "joint_state() must be an array of float64 (2, 9), not object (2, 9)",
    "complex joints": "joint_state() must be an array of float64 (2, 9), not complex128 (2, 9)",
    "joints exchanged": "row 1, 'panda_joint2', starts at (-2.356), where the scene has (-0.7854); "
    "that is the place of 'panda_joint4', so the order is another",
    "joints reversed": "row 0, 'panda_joint1', starts at (0.035), where the scene has (0)",
    "joints not a number": "the state of the joints is not finite after loading",
    "joints of nothing": "joint_state() must be an array of float64 (2, 9), not a NoneType",
    "too few bodies": "body_state() must be an array of float64 (N, 13), not float64 (N-1, 13)",
    "too many bodies": "body_state() must be an array of float64 (N, 13), not float64 (N+1, 13)",
    "no velocity columns": "body_state() must be an array of float64 (N, 13), not float64 (N, 7)",
    "bodies of float32": "body_state() must be an array of float64 (N, 13), not float32 (N, 13)",
    "bodies of objects": "body_state() must be an array of float64 (N, 13), not object (N, 13)",
    "bodies exchanged": "so the order is another",
    "quaternion not a number": "must have length 1, but (nan, ",
    "quaternion of length 2": "must have length 1, but (2, 0, 0, 0) has 2",
    "quaternion of zeros": "must have length 1, but (0, 0, 0, 0) has 0",
    "quaternion x y z w": "(w, x, y, z)",
    "position infinite": "the state of the bodies is not finite after loading",
    "time as a text": "the time must be a float, not '0.0'",
    "time of nothing": "the time must be a float, not None",
    "time complex": "the time must be a float, not 0j",
    "time an array": "the time must be a float, not array([0.])",
    "time not a number": "the time must be finite, not nan",
    "nothing read back": "read_back() must be a dict of numbers by name, not None",
    "texts read back": "read_back()['gravity'] must be numbers, not 'downward'",
}


def test_all_are_expected() -> None:
    assert set(EXPECTED) == {*JOINTS, *BODIES, *TIMES, *BUILT}


@pytest.mark.parametrize("fault", EXPECTED)
def test_found_when_the_world_is_loaded(case: Case, fault: str) -> None:
    free = len(Turning().scene(1, Jitter()).free_bodies)
    message = EXPECTED[fault]
    for text, number in (("N-1", free - 1), ("N+1", free + 1), ("N", free)):
        message = message.replace(f"({text},", f"({number},")
    record, _ = Repetition(Experiment(misshapen(case, fault), Turning()), 1).run()
    assert record.error is not None
    assert (record.error.type, record.error.phase) == ("BadState", "load")
    assert message in record.error.message
    assert "mujoco" in record.error.message


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("later float32", "must be an array of float64 (2, 9), not float32 (2, 9)"),
        ("later too few", "must be an array of float64 (2, 9), not float64 (2, 8)"),
        ("later nothing", "joint_state() must be an array of float64 (2, 9), not a NoneType"),
        ("later a text", "joint_state() must be an array of float64 (2, 9), not a str"),
        ("joints 1 and 3 exchanged", "panda_joint1, panda_joint3 stand at each other's"),
        ("time nan", "the time must be finite, not nan"),
        ("time inf", "the time must be finite, not inf"),
        ("time stands", "0.35 s after 350 steps of 0.001 s from 0 s on, not 0.3 s"),
        ("time runs back", "0.35 s after 350 steps of 0.001 s from 0 s on, not 0.25 s"),
        ("time jumps", "0.35 s after 350 steps of 0.001 s from 0 s on, not 100.35 s"),
        ("time slow", "0.05 s after 50 steps of 0.001 s from 0 s on, not 0.025 s"),
    ],
)
def test_found_in_a_motion(case: Case, fault: str, message: str) -> None:
    record, _ = Repetition(Experiment(misshapen(case, fault), Turning()), 1).run()
    assert record.error is not None
    assert (record.error.type, record.error.phase) == ("BadState", "turn")
    assert message in record.error.message
    assert fault in (*LATER, *LATER_TIMES, "time slow") or "exchanged" in fault


def test_an_honest_adapter_passes(case: Case) -> None:
    record, error = Repetition(Experiment(misshapen(case, "nothing"), Turning()), 1).run()
    assert error is None
    assert record.status == "ok"


def test_it_ends_that_repetition_alone(case: Case) -> None:
    kept: list[Record] = []
    experiment = Experiment(misshapen(case, "too few bodies"), Falling())
    Repeater(experiment, LocalExecutor(1), Silent(), kept.append).run([1, 2])  # type: ignore[arg-type]
    assert [record.status for record in kept] == ["failed", "failed"]


CUBES = tuple(
    Box(name, (0.05,) * 3, Pose.at(x, 0.0, 0.5, yaw=x), mass=0.1)
    for name, x in (("a", 0.4), ("shelf", 0.5), ("b", 0.6))
)
WORLD = Scene("world", (CUBES[0], replace(CUBES[1], mass=0.0), CUBES[2]), ROBOT)
FREE = (CUBES[0], CUBES[2])
HOME = ROBOT.column("initial_position") if ROBOT is not None else np.zeros(0)


def saying(**what: Any) -> Any:
    """A simulator that says what a sound one says at the start, but for `what`."""
    bodies = np.hstack([[cube.pose.as_array() for cube in FREE], np.zeros((2, 6))])
    joints = np.array([HOME, np.zeros(9)])
    says = {"time": 0.0, "joints": joints, "bodies": bodies, **what}
    return SimpleNamespace(
        info=SimpleNamespace(name="sim"),
        time=says["time"],
        joint_state=lambda: says["joints"],
        body_state=lambda: says["bodies"],
    )


def changed(what: str, index: Any, value: Any) -> Any:
    """The same with one value of its state changed."""
    sound = saying()
    state = {"joints": sound.joint_state, "bodies": sound.body_state}[what]().copy()
    state[index] = value
    return saying(**{what: state})


def test_a_sound_state_is_given_on() -> None:
    for time in (0, 0.0, np.float32(0.5), np.float64(1e-9)):
        state = checked_state(saying(time=time), WORLD)
        assert set(state) == {"time", "joints", "bodies"}
        assert (type(state["time"]), state["time"]) == (float, float(time))
        assert state["joints"].shape == (2, 9)
        assert state["bodies"].shape == (2, 13)
    check_start(saying(time=1e-9), WORLD)
    check_start(saying(joints=np.zeros((2, 0)), bodies=np.zeros((0, 13))), Scene("empty"))


@pytest.mark.parametrize("time", [True, "0" * 99, None, 0j])
def test_a_time_that_is_none(time: Any) -> None:
    with pytest.raises(StateError) as caught:
        checked_state(saying(time=time), WORLD)
    assert str(caught.value) == f"sim: the time must be a float, not {time!r:.80}"


@pytest.mark.parametrize(("length", "found"), [(0.9991, ""), (1.0009, ""), (1.0011, "1.001")])
def test_how_long_a_quaternion_may_be(length: float, found: str) -> None:
    odd = changed("bodies", (1, slice(3, 7)), (0.0, 0.0, length, 0.0))
    if not found:
        checked_state(odd, WORLD)
        return
    with pytest.raises(StateError) as caught:
        checked_state(odd, WORLD)
    assert str(caught.value) == (
        f"sim: the quaternion of 'b' must have length 1, but (0, 0, {length:.4g}, 0) has {found}"
    )


@pytest.mark.parametrize(
    ("world", "time", "speed"),
    [
        (changed("joints", (1, 3), -2e-6), 0, 2e-6),
        (changed("bodies", (0, 12), 0.5), 0, 0.5),
        (saying(time=2e-9), 2e-9, 0),
        (saying(time=-1.0), -1, 0),
    ],
)
def test_a_world_starts_at_0_and_at_rest(world: Any, time: float, speed: float) -> None:
    with pytest.raises(ParityError) as caught:
        check_start(world, WORLD)
    assert str(caught.value) == (
        f"sim starts a world at t = {time:g} s with speeds up to {speed:.3g} (m/s, rad/s); it must "
        "start at 0 and at rest"
    )
    check_start(changed("joints", (1, 3), 9e-7), WORLD)


def test_a_body_starts_as_fast_as_the_scene_says() -> None:
    fast = replace(WORLD.bodies[0], linear_velocity=(0.0, 0.0, 2.0))
    check_start(changed("bodies", (0, 9), 2.0001), WORLD.with_body(fast))
    for speed in (0.0, 1.999):
        with pytest.raises(ParityError, match=f"by up to {2 - speed:.3g} .* the scene's speeds"):
            check_start(changed("bodies", (0, 9), speed), WORLD.with_body(fast))


@pytest.mark.parametrize(("what", "index"), [("joints", (0, 8)), ("bodies", (1, 7))])
def test_what_is_not_finite_at_the_start(what: str, index: Any) -> None:
    with pytest.raises(StateError) as caught:
        check_start(changed(what, index, np.inf), WORLD)
    assert str(caught.value) == f"sim: the state of the {what} is not finite after loading"


def test_where_joints_and_bodies_start() -> None:
    """Up to 1 mm or 1 mrad off; else the message says whose place it is, if it is one."""
    names = [joint.name for joint in ROBOT.joints] if ROBOT is not None else []
    check_start(changed("joints", (0, 3), HOME[3] + 0.0009), WORLD)
    check_start(changed("bodies", (1, 0), 0.6009), WORLD)
    with pytest.raises(StateError) as caught:
        check_start(changed("joints", (0, 3), 0.5), WORLD)
    assert str(caught.value) == (
        f"sim: joint_state() row 3, {names[3]!r}, starts at (0.5), where the scene has "
        f"({HOME[3]:.4g})"
    )
    with pytest.raises(StateError) as caught:
        check_start(changed("bodies", (1, 0), 0.6011), WORLD)
    assert str(caught.value) == (
        "sim: body_state() row 1, 'b', starts at (0.6011, 0, 0.5), where the scene has "
        "(0.6, 0, 0.5)"
    )
    with pytest.raises(StateError) as caught:
        check_start(changed("bodies", (0, 0), 0.6), WORLD)
    assert str(caught.value) == (
        "sim: body_state() row 0, 'a', starts at (0.6, 0, 0.5), where the scene has (0.4, 0, 0.5); "
        "that is the place of 'b', so the order is another"
    )


@pytest.mark.parametrize("sign", [1, -1])
def test_how_a_body_is_turned_at_the_start(sign: int) -> None:
    """By up to 1.6 degrees otherwise; both signs of a quaternion are one rotation."""

    def turned(angle: float) -> Any:
        yaw = 0.6 + angle
        quaternion = sign * np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]) + 0.0
        return changed("bodies", (1, slice(3, 7)), quaternion)

    check_start(turned(np.radians(1.5)), WORLD)
    with pytest.raises(StateError) as caught:
        check_start(turned(np.radians(90.0)), WORLD)
    here, there = (sign * np.cos(0.3 + np.pi / 4), sign * np.sin(0.3 + np.pi / 4)), (0.9553, 0.2955)
    assert str(caught.value) == (
        f"sim: body 'b' starts with quaternion ({here[0]:.4g}, 0, 0, {here[1]:.4g}), where the "
        f"scene has ({there[0]}, 0, 0, {there[1]}) (w, x, y, z)"
    )
    with pytest.raises(StateError):
        check_start(turned(np.radians(1.7)), WORLD)


def test_joints_at_each_others_set_points() -> None:
    goal = HOME.copy()
    goal[[0, 2]] = 0.5, -0.4

    def reached(**places: float) -> np.ndarray:
        position = goal.copy()
        for joint, place in places.items():
            position[int(joint[1:])] = place
        return np.array([position, np.zeros(9)])

    with pytest.raises(StateError) as caught:
        check_following(saying(), WORLD, reached(j0=-0.4, j2=0.5), goal)
    assert str(caught.value) == (
        "sim: the joints panda_joint1, panda_joint3 stand at each other's set points, (-0.4, 0.5) "
        "where (0.5, -0.4) was commanded: their order is not that of scene.robot.joints"
    )
    with pytest.raises(StateError):  # nearly there
        check_following(saying(), WORLD, reached(j0=-0.381, j2=0.519), list(goal))
    check_following(saying(), WORLD, reached(j0=-0.379, j2=0.5), goal)  # late, and badly
    check_following(saying(), WORLD, reached(j0=0.4001, j2=-0.4999), goal)  # lag is no exchange
    check_following(saying(), WORLD, reached(j0=-0.4), goal)  # one alone changed with none
    check_following(saying(), WORLD, reached(), goal)
    check_following(saying(), Scene("no robot", CUBES), reached(j0=-0.4, j2=0.5), goal)
