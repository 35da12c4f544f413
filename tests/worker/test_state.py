"""States that are none are found and named, and end a repetition of a real engine."""

from __future__ import annotations

from collections.abc import Callable
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
from pytest_simbench.scene import Box, FloatArray, Pose, Scene, Trajectory
from pytest_simbench.simulator import ParityError, StateError
from pytest_simbench.tasks import Stacking
from pytest_simbench.tasks.base import Count, Jitter, Outcome
from pytest_simbench.worker.state import (
    States,
    check_following,
    check_start,
    checked_quantities,
    checked_state,
)
from tests.client.failing import Silent, failure, faulty
from tests.tiny import Falling

ROBOT = Stacking().scene(1, Jitter()).robot


@dataclass(frozen=True)
class Turning(Falling):
    """The arm turns joints 1 to 3, each by another angle, while two cubes lie beside it."""

    name: ClassVar[str] = "turning"

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        cubes = Stacking().scene(seed, jitter).bodies
        return Scene("turning", cubes, ROBOT)

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        start = ROBOT.column("initial_position")
        position = np.tile(start, (200, 1))
        for joint, angle in enumerate((0.5, -0.1, -0.4)):
            position[:, joint] += angle * np.minimum(1.0, np.linspace(0.0, 2.0, 200))
        rest = np.zeros_like(position)
        with world.phase("turn"):
            world.follow(Trajectory(0.01, position, rest, rest), log_period=0.05)
        return Outcome({"landed": 1.0})


def test_it_ends_that_repetition_alone(case: Case) -> None:
    kept: list[Record] = []
    experiment = Experiment(faulty(case, "Lies bodies"), Falling())
    Repeater(experiment, LocalExecutor(1), Silent(), kept.append).run([1, 2])  # type: ignore[arg-type]
    assert [record.status for record in kept] == ["failed", "failed"]


def test_joints_in_another_order_are_found_when_they_have_moved(case: Case) -> None:
    """They all stand at 0 at the start."""
    record, error = Repetition(Experiment(case, Turning()), 1).run()
    assert (record.status, error) == ("ok", None)
    kind, phase, message = failure(faulty(case, "Lies joints"), Turning())
    assert (kind, phase) == ("BadState", "turn")
    assert "panda_joint1, panda_joint3 stand at each other's" in message


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
        settings=SimpleNamespace(timestep=0.001),
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


JOINTS, BODIES = (
    "joint_state() must be an array of float64 (2, 9)",
    "body_state() must be an array of float64 (2, 13)",
)
ORDER = [0, 3, 2, 1, 4, 5, 6, 7, 8]


def put(index: Any, value: Any) -> Callable[[Any], Any]:
    """Changes one value of a state."""

    def change(state: FloatArray) -> FloatArray:
        state = state.copy()
        state[index] = value
        return state

    return change


@pytest.mark.parametrize(
    ("what", "change", "message"),
    [
        ("joints", lambda q: q[:, :-1], f"{JOINTS}, not float64 (2, 8)"),
        ("joints", lambda q: q.tolist(), f"{JOINTS}, not a list"),
        ("joints", lambda q: q.astype(np.float32), f"{JOINTS}, not float32 (2, 9)"),
        ("joints", lambda q: q[:, ORDER], "row 1, 'panda_joint2', starts at (-2.356), where the "
         "scene has (-0.7854); that is the place of 'panda_joint4', so the order is another"),
        ("joints", lambda q: q[:, ::-1].copy(), "row 0, 'panda_joint1', starts at (0.035), where"),
        ("joints", put((0, 4), np.nan), "the state of the joints is not finite after loading"),
        ("bodies", lambda b: b[:-1], f"{BODIES}, not float64 (1, 13)"),
        ("bodies", lambda b: b.astype(np.float32), f"{BODIES}, not float32 (2, 13)"),
        ("bodies", lambda b: b[::-1].copy(), "so the order is another"),
        ("bodies", put((0, 3), np.nan), "must have length 1, but (nan, "),
        ("bodies", put((1, slice(3, 7)), (2.0, 0.0, 0.0, 0.0)), "but (2, 0, 0, 0) has 2"),
        ("bodies", put((0, slice(3, 7)), 0.0), "must have length 1, but (0, 0, 0, 0) has 0"),
        ("bodies", lambda b: b[:, [0, 1, 2, 4, 5, 6, 3, 7, 8, 9, 10, 11, 12]], "(w, x, y, z)"),
        ("bodies", put((0, 0), np.inf), "the state of the bodies is not finite after loading"),
        ("bodies", put((1, 7), np.inf), "the state of the bodies is not finite after loading"),
        ("time", lambda t: None, "the time must be a float, not None"),
        ("time", bool, "the time must be a float, not False"),
        ("time", lambda t: np.array([t]), "the time must be a float, not array([0.])"),
        ("time", lambda t: "0" * 99, f"the time must be a float, not '{'0' * 79}"),
        ("time", lambda t: np.nan, "the time must be finite, not nan"),
        ("time", lambda t: np.inf, "the time must be finite, not inf"),
    ],
)  # fmt: skip
def test_what_is_no_state(what: str, change: Callable[[Any], Any], message: str) -> None:
    sound = saying()
    says = {"time": sound.time, "joints": sound.joint_state(), "bodies": sound.body_state()}
    with pytest.raises(StateError, match="^sim: ") as caught:
        check_start(saying(**{what: change(says[what])}), WORLD)
    assert message in str(caught.value)


@pytest.mark.parametrize("what", ["joint_state", "body_state"])
def test_who_tells_other_states_is_not_asked_for_samples(what: str) -> None:
    told = type("Told", (), {"joint_state": 0, "body_state": 0, "sample": 0})
    assert States(type("Same", (told,), {})(), WORLD).quick()
    assert not States(type("Other", (told,), {what: 0})(), WORLD).quick()
    world = told()
    setattr(world, what, 0)
    assert not States(world, WORLD).quick()


@pytest.mark.parametrize("what", ["joint_state", "body_state"])
@pytest.mark.parametrize("change", [lambda rows: rows + 2e-9, lambda rows: rows[..., :-1]])
def test_a_sample_that_tells_another_state(what: str, change: Callable[[Any], Any]) -> None:
    sound = saying()
    told = {"joint_state": np.array([HOME, 0 * HOME]), "body_state": sound.body_state()}
    sound.sample = lambda: told
    sound.sampled = lambda samples: tuple(np.array([s[n] for s in samples]) for n in told)
    assert np.array_equal(States(sound, WORLD).sampled([told] * 3)[1], [told["body_state"]] * 3)
    nowhere = saying(joints=np.full((2, 9), np.nan))
    nowhere.sample = lambda: {**told, "joint_state": np.full((2, 9), np.nan)}
    nowhere.sampled = sound.sampled
    States(nowhere, WORLD).sampled([told])  # that has diverged, which others tell
    told[what] = change(told[what])
    with pytest.raises(StateError, match=f"^sim: sampled.. tells another state than {what}"):
        States(sound, WORLD).sampled([told])


@pytest.mark.parametrize(
    ("found", "message"),
    [
        (None, "read_back() must be a dict of numbers by name, not None"),
        ({"gravity": "downward"}, "read_back()['gravity'] must be numbers, not 'downward'"),
    ],
)
def test_what_is_no_dict_of_quantities(found: Any, message: str) -> None:
    simulator: Any = SimpleNamespace(info=SimpleNamespace(name="sim"), read_back=lambda: found)
    with pytest.raises(StateError) as caught:
        checked_quantities(simulator)
    assert str(caught.value) == f"sim: {message}"


@pytest.mark.parametrize(
    "time", [0.3, 0.25, 100.35, 0.3509], ids=["stands", "back", "jumps", "fast"]
)
def test_a_clock_that_goes_otherwise_than_the_steps(time: float) -> None:
    with pytest.raises(StateError) as caught:
        States(saying(time=time), WORLD).time_after(350, 0.0)
    assert str(caught.value) == (
        f"sim: the time must be 0.35 s after 350 steps of 0.001 s from 0 s on, not {time} s"
    )
    assert States(saying(time=0.3504), WORLD).time_after(350, 0.0) == 0.3504


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
