"""Tapes: what was asked for, asked again; and a controller that is late."""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.client.tape import ARRAYS, Latency, Operation
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.tasks.base import cube

WHITE = (1.0, 1.0, 1.0, 1.0)
SCENE = Scene("s", (cube("a", Pose.at(0.0, 0.0, 0.2), WHITE),))
TICK = 0.004


@pytest.fixture
def handle(case: Case) -> Iterator[SimulatorHandle]:
    handle = SimulatorHandle(case)
    yield handle
    handle.close()


def ramp(start: float, end: float, rows: int) -> Operation:
    """One joint from start to end."""
    position = np.linspace(start, end, rows)[:, None]
    velocity = np.full((rows, 1), (end - start) / (TICK * (rows - 1)))
    velocity[-1] = 0.0
    arrays = {"position": position, "velocity": velocity, "effort": 10 * position}
    return Operation("follow", {"tick": TICK, **arrays}, "move")


def wait(duration: float) -> Operation:
    return Operation("wait", {"duration": duration}, "rest")


def heard(operations: list[Operation], asked_last: float = 0.0) -> np.ndarray:
    """Set points tick by tick, as the drives get them."""
    points: list[float] = []
    for operation in operations:
        if operation.kind == "wait":
            held = points[-1] if points else asked_last
            points += [held] * round(operation.duration / TICK)
        else:
            points += list(operation.arguments["position"][1:, 0])
    return np.array(points)


@given(
    delay=st.integers(1, 30),
    parts=st.lists(st.one_of(st.integers(1, 40), st.integers(-60, -1)), min_size=1, max_size=8),
)
def test_late_commands_are_the_same_commands_later(delay: int, parts: list[int]) -> None:
    """Positive parts are motions of so many ticks, negative ones waits. What the drives get is
    what was asked for, shifted, and takes as long."""
    latency, asked, late = Latency(delay * TICK), [], []
    at = 0.0
    for number, part in enumerate([20, *parts]):
        if part > 0:
            asked.append(ramp(at, number + 1.0, part + 1))
            at = number + 1.0
        else:
            asked.append(wait(-part * TICK))
        late += latency.late(asked[-1])
    wanted, got = heard(asked), heard(late)
    assert len(got) == len(wanted)
    shifted = np.concatenate([np.zeros(delay), wanted])[: len(wanted)]
    assert got == pytest.approx(shifted)


def test_every_row_goes_with_its_velocity_and_effort() -> None:
    latency = Latency(2 * TICK)
    first = ramp(0.0, 1.0, 11)
    (late,) = latency.late(first)
    for name in ARRAYS:
        assert np.array_equal(late.arguments[name][3:], first.arguments[name][1:-2])
    assert not late.arguments["velocity"][:3].any()  # held until the first set point arrives


def test_before_the_first_motion_nothing_is_late() -> None:
    asked = wait(1.0)
    assert Latency(0.02).late(asked) == [asked]


def test_playing_a_tape_repeats_the_episode(handle: SimulatorHandle) -> None:
    with handle.episode(SCENE, period=0.02) as world:
        with world.phase("fall"):
            world.wait(0.1)
        with world.phase("land"):
            world.wait(0.5)
        first = world
    with handle.episode(SCENE, period=0.02) as world:
        world.play(first.tape)
        assert world.bodies.tobytes() == first.bodies.tobytes()
    assert [operation.phase for operation in world.tape] == ["fall", "land"]
    assert all(a.to_wire() == b.to_wire() for a, b in zip(first.tape, world.tape, strict=True))
    for a, b in zip(first.motions, world.motions, strict=True):
        assert a.bodies.tobytes() == b.bodies.tobytes()
    assert [round(motion.time[-1], 3) for motion in first.motions] == [0.0, 0.1, 0.6]
    assert len(first.motions[2]) in (25, 26)


def test_the_tape_replaces_what_is_asked_for(handle: SimulatorHandle) -> None:
    with handle.episode(SCENE, play=[wait(0.3), wait(0.2)]) as world:
        world.wait(0.1)
        assert world.time == pytest.approx(0.3)
        world.wait(0.1)
        assert world.time == pytest.approx(0.5)
        assert world.left_at is None
        world.wait(0.1)  # the tape is over: what is asked for is done
        assert world.time == pytest.approx(0.6)
        assert world.left_at == pytest.approx(0.5)


def test_another_kind_of_operation_leaves_the_tape(handle: SimulatorHandle) -> None:
    with handle.episode(SCENE, play=[ramp(0.0, 1.0, 3), wait(0.2)]) as world:
        world.wait(0.1)
        assert (world.left_at, world.time) == (0.0, pytest.approx(0.1))
        world.wait(0.1)
        assert world.time == pytest.approx(0.2)


def test_a_log_that_was_asked_for_is_all_there(handle: SimulatorHandle) -> None:
    with handle.episode(SCENE, period=0.02) as world:
        motion = world.wait(0.1, log_period=0.0)
        assert motion is not None
        assert len(motion) == 100
        assert len(world.motions[1]) == 6  # every 20 ms, and the end
        assert world.wait(0.1) is None


def test_performing_leaves_no_trace(handle: SimulatorHandle) -> None:
    with handle.episode(SCENE, period=0.02) as world:
        world.perform(wait(0.1))
        assert world.time == pytest.approx(0.1)
        assert (len(world.tape), len(world.motions)) == (0, 1)


def test_operations_travel_as_json_to_the_last_bit() -> None:
    for operation in (ramp(0.1, 1 / 3, 7), wait(0.1)):
        again = Operation.from_wire(json.loads(json.dumps(operation.to_wire())))
        assert (again.kind, again.phase) == (operation.kind, operation.phase)
        assert again.arguments.keys() == operation.arguments.keys()
        for name, value in operation.arguments.items():
            np.testing.assert_array_equal(again.arguments[name], value)
        assert again.duration == operation.duration
