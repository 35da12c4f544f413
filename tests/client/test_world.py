"""What a world keeps of its motion, and pictures along the way; what a tape asks again."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, nullcontext
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.client.answers import Frame
from pytest_simbench.client.errors import BadState, Diverged, Where
from pytest_simbench.client.motion import Motion
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.tape import ARRAYS, Latency, Operation, TapedWorld
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Pose, Scene, SceneError, Sphere, Trajectory
from pytest_simbench.tasks.base import cube
from pytest_simbench.worker.wire import pack
from tests.tasks.scripted import ScriptedProcess

SCENE = Scene("s", (cube("a", Pose.at(0.0, 0.0, 2.0), (1.0,) * 4),))


@contextmanager
def opened(
    case: Case, scene: Scene = SCENE, period: float | None = None, **changes: Any
) -> Iterator[World]:
    """A world in a worker of its own, whose motion is kept with this period [s]."""
    process = WorkerProcess(case.launch("x"), Where(case.simulator, case.mode))
    process.construct(changes=changes)
    with closing(process):
        yield World(process, scene, trace_period=period)


def test_what_was_undone_is_not_in_it(case: Case) -> None:
    with opened(case, period=0.02) as world:
        with world.phase("fall"):
            world.wait(0.1)
        world.save()
        with world.phase("lost"):
            world.wait(0.1)
        world.restore()
        with world.phase("fall again"):
            world.wait(0.06)
    motion = Motion.joined(world.trace)
    np.testing.assert_allclose(motion.time, np.arange(1, 9) * 0.02)
    assert (np.diff(motion.bodies[:, 0, 2]) < 0).all()
    begun = {name: round(time, 3) for time, name in world.phases}
    assert begun.items() >= {"fall": 0.0, "fall again": 0.1, "task": 0.16}.items()
    assert "lost" not in begun


def test_what_went_wrong_is_in_it(case: Case) -> None:
    """The motion that ends in a state that cannot be is the one to look at."""
    blown = replace(SCENE, gravity=(500.0, 0.0, 0.0))
    with opened(case, blown, 0.02) as world, pytest.raises(Diverged, match="left the room"):
        world.wait(0.4)
    assert Motion.joined(world.trace).bodies[-1, 0, 0] > 5.0


def test_what_cannot_be_at_the_start_is_wrong_with_its_loading(case: Case) -> None:
    fast = replace(SCENE, bodies=(SCENE.bodies[0].changed(linear_velocity=(99.0, 0.0, 0.0)),))
    with pytest.raises(Diverged, match="'a' moves at 99 m/s") as raised, opened(case, fast):
        pass
    assert raised.value.phase == "load"


def test_an_impact_is_no_divergence_where_the_task_says_so(case: Case) -> None:
    """MuJoCo's default contacts stop a marble only when it is deep in the ground."""
    marble = Sphere("m", 0.008, Pose.at(0.0, 0.0, 0.01), 0.005, linear_velocity=(0.0, 0.0, -2.4))
    for striking in (True, False):
        with opened(case, Scene("s", (marble,)), solref=(0.02, 1.0)) as world:
            with nullcontext() if striking else pytest.raises(Diverged, match="deep in the ground"):
                world.wait(0.012, striking=striking)
            if striking:
                world.wait(1.0)
                assert world.bodies[0, 2] == pytest.approx(0.008, abs=1e-3)


def test_it_follows_set_points_of_all_its_joints(case: Case) -> None:
    with opened(case) as world, pytest.raises(SceneError, match="1 joints; give all 0 of"):
        world.follow(Trajectory(0.1, [[0.0]], [[0.0]], [[0.0]]))


def test_a_long_wait_is_kept_out_of_the_simulators_memory(case: Case) -> None:
    """60 MB of samples: the worker sends them as it goes, else its peak would be the trace's."""
    places = [Pose.at(0.5 * (k % 16), 0.5 * (k // 16), 2.0) for k in range(256)]
    cubes = tuple(cube(f"c{k}", place, (1.0,) * 4) for k, place in enumerate(places))
    scene = Scene("s", cubes, gravity=(0.0, 0.0, 0.0), room=(20.0, 20.0, 4.0))
    peaks = []
    for period in (None, 0.02):
        with opened(case, scene, period, timestep=0.01) as world:
            world.wait(45.0)
            peaks.append(world.stats()["peak_rss_mb"])
    motion = Motion.joined(world.trace)
    np.testing.assert_allclose(motion.time, np.arange(1, 2251) * 0.02)
    assert motion.bodies.nbytes > 55e6
    assert peaks[1] - peaks[0] < 20.0


SIZE = (48, 36)


def fallen(case: Case, film: bool) -> tuple[World, list[Frame]]:
    frames: list[Frame] = []
    with opened(case) as world:
        deadline = world.process.deadline = time.monotonic() + 100.0
        if film:
            world.film(frames.append, 0.04, SIZE)
        world.wait(0.1)
        world.wait(0.11)
        if film:
            world.film(None, 0.04, SIZE)
            spent = sum(frame.seconds for frame in frames)
            assert world.process.deadline == pytest.approx(deadline + spent)
            assert (spent > 0) == (frames[0].picture is not None)
        world.wait(0.1)
    return world, frames


def test_pictures_are_evenly_spaced_and_change_nothing(case: Case) -> None:
    world, frames = fallen(case, film=True)
    assert [frame.time for frame in frames] == pytest.approx([0.04, 0.08, 0.12, 0.16, 0.2])
    for frame in frames:
        assert frame.problem == ""
        assert frame.picture.shape == (36, 48, 3)
    without, none = fallen(case, film=False)
    assert none == []
    np.testing.assert_array_equal(world.bodies, without.bodies)


def test_a_picture_that_cannot_be_drawn_ends_the_film_alone(case: Case) -> None:
    world, frames = fallen(replace(case, adapter="tests.client.faulty:Blind"), film=True)
    assert [frame.problem for frame in frames] == ["mujoco has no offscreen picture"]
    assert world.time == pytest.approx(0.31)


def drawn(kind: str, *shape: int, seconds: float = 2.0) -> dict[str, Any]:
    """What a worker sends of a picture."""
    return {"time": 1, "seconds": seconds, "picture": pack(np.zeros(shape, kind))}


@pytest.mark.parametrize(
    ("data", "came"),
    [(None, "None"), ("x" * 99, "'" + "x" * 79), ({"time": 1, "seconds": 2},) * 2,
     (drawn("u1", 2, 2), "uint8 (2, 2)"), (drawn("f8", 36, 48, 3), "float64 (36, 48, 3)")],
)  # fmt: skip
def test_what_is_no_picture_is_a_problem(data: Any, came: object) -> None:
    told = f"the engine drew what is no picture of (48, 36): {came}"
    assert Frame.from_wire(data, SIZE) == Frame(0.0, None, told, 0.0)


def test_a_picture_and_why_there_is_none() -> None:
    for seconds, kept in ((2, 2.0), (-1, 0.0), (np.inf, 0.0)):
        found = Frame.from_wire(drawn("u1", 36, 48, 3, seconds=seconds), SIZE)
        assert found.picture is not None
        assert replace(found, picture=None) == Frame(1.0, None, "", kept)
    told = {"time": 1, "seconds": 2, "problem": "it is blind"}
    assert Frame.from_wire(told, SIZE) == Frame(1.0, None, "it is blind", 0.0)


LOW = SCENE.with_pose("a", Pose.at(0.0, 0.0, 0.2))
TICK = 0.004


def ramp(start: float, end: float, rows: int, tick: float = TICK) -> Operation:
    """One joint from start to end."""
    position = np.linspace(start, end, rows)[:, None]
    velocity = np.full((rows, 1), (end - start) / (tick * (rows - 1)))
    velocity[-1] = 0.0
    arrays = {"position": position, "velocity": velocity, "effort": 10 * position}
    return Operation("follow", {"tick": tick, **arrays}, "move")


def wait(duration: float) -> Operation:
    return Operation("wait", {"duration": duration}, "rest")


def heard(operations: list[Operation]) -> np.ndarray:
    """Set points each `TICK`, as the drives get them."""
    points: list[float] = []
    for operation in operations:
        at = TICK * np.arange(1, 1 + round(operation.duration / TICK))
        if operation.kind == "wait":
            points += [points[-1]] * len(at)
        else:
            rows = operation.arguments["position"][:, 0]
            points += [*np.interp(at, operation.arguments["tick"] * np.arange(len(rows)), rows)]
    return np.array(points)


@given(
    delay=st.integers(1, 30),
    parts=st.lists(st.one_of(st.integers(1, 40), st.integers(-60, -1)), min_size=1, max_size=8),
)
def test_late_commands_are_the_same_commands_later(delay: int, parts: list[int]) -> None:
    """Positive parts are motions of so many ticks, each tenth one of a single long one; negative
    ones waits. What the drives get is what was asked for, shifted, and takes as long."""
    latency, asked, at = Latency(delay * TICK), list[Operation](), 0.0
    for number, part in enumerate([20, *parts]):
        if part > 0:
            rows = 2 if part % 10 == 0 else part + 1
            asked.append(ramp(at, number + 1.0, rows, TICK * part / (rows - 1)))
            at = number + 1.0
        else:
            asked.append(wait(-part * TICK))
    late = [*map(latency.late, asked)]
    assert [one.phase for one in late] == [one.phase for one in asked]
    assert [one.duration for one in late] == pytest.approx([one.duration for one in asked])
    wanted = heard(asked)
    shifted = np.concatenate([np.zeros(delay), wanted])[: len(wanted)]
    assert heard(late) == pytest.approx(shifted)


def test_every_row_goes_with_its_velocity_and_effort() -> None:
    latency = Latency(2 * TICK)
    first = ramp(0.0, 1.0, 11)
    late = latency.late(first)
    for name in ARRAYS:
        assert late.arguments[name][3:] == pytest.approx(first.arguments[name][1:-2])
    assert not late.arguments["velocity"][:3].any()  # held until the first set point arrives
    end = latency.late(Operation("wait", {"duration": 0.0, "striking": True}))
    assert end.arguments.keys() == {"tick", "striking", *ARRAYS}  # the task still knows of a blow
    assert end.arguments["effort"] == pytest.approx(first.arguments["effort"][-3:-2])


def test_a_delay_is_no_whole_number_of_ticks_and_an_effort_ends_at_once() -> None:
    pushed = np.zeros((3, 2, 1))
    pushed[2] = 7.0
    latency = Latency(TICK / 4)
    ends = []
    for rows in (pushed, 0 * pushed):
        motion = dict(zip(ARRAYS, rows, strict=True))
        ends.append(latency.late(Operation("follow", {"tick": 0.5, **motion})).arguments["effort"])
    assert [one.ravel()[[0, 1, 2, -1]].tolist() for one in ends] == [[7.0] * 4, [7.0, 0, 0, 0]]
    late = latency.late(ramp(0.0, 1.0, 5)).arguments["position"]
    assert late.ravel() == pytest.approx([0.0, 0.1875, 0.4375, 0.6875, 0.9375])


def test_a_world_with_a_late_controller_moves_late() -> None:
    process: Any = ScriptedProcess()
    world = TapedWorld(process, replace(LOW, robot=panda()), delay=TICK)
    rows = panda().column("initial_position") + np.linspace(0.0, 0.1, 11)[:, None]
    world.follow(Trajectory(TICK, rows, 0 * rows, 0 * rows))
    assert process.asked[-1].arguments["position"] == pytest.approx(rows[[0, *range(10)]])
    assert world.tape[-1].arguments["position"] is rows  # what was asked for


def test_before_the_first_motion_nothing_is_late() -> None:
    asked = wait(1.0)
    assert Latency(0.02).late(asked) is asked


def test_playing_a_tape_repeats_the_episode(handle: SimulatorHandle) -> None:
    with handle.episode(LOW, period=0.02) as world:
        with world.phase("fall"):
            world.wait(0.1)
        with world.phase("land"):
            world.wait(0.5)
        first = world
    with handle.episode(LOW, period=0.02) as world:
        world.play(first.tape)
        assert world.bodies.tobytes() == first.bodies.tobytes()
    assert [operation.phase for operation in world.tape] == ["fall", "land"]
    assert all(a.to_wire() == b.to_wire() for a, b in zip(first.tape, world.tape, strict=True))
    for a, b in zip(first.motions, world.motions, strict=True):
        assert a.bodies.tobytes() == b.bodies.tobytes()
    assert [round(motion.time[-1], 3) for motion in first.motions] == [0.0, 0.1, 0.6]
    assert len(first.motions[2]) in (25, 26)


def test_the_tape_replaces_what_is_asked_for(handle: SimulatorHandle) -> None:
    with handle.episode(LOW, play=[wait(0.3), wait(0.2)]) as world:
        world.wait(0.1)
        assert world.time == pytest.approx(0.3)
        world.wait(0.1)
        assert world.time == pytest.approx(0.5)
        assert world.left_at is None
        world.wait(0.1)  # the tape is over: what is asked for is done
        assert world.time == pytest.approx(0.6)
        assert world.left_at == pytest.approx(0.5)


def test_another_kind_of_operation_leaves_the_tape(handle: SimulatorHandle) -> None:
    with handle.episode(LOW, play=[ramp(0.0, 1.0, 3), wait(0.2)]) as world:
        world.wait(0.1)
        assert (world.left_at, world.time) == (0.0, pytest.approx(0.1))
        world.wait(0.1)
        assert world.time == pytest.approx(0.2)


def test_a_log_that_was_asked_for_is_all_there(handle: SimulatorHandle) -> None:
    with handle.episode(LOW, period=0.02) as world:
        motion = world.wait(0.1, log_period=0.0)
        assert len(motion) == 100
        assert len(world.motions[1]) == 6  # every 20 ms, and the end
        assert not len(world.wait(0.1))


def test_performing_leaves_no_trace(handle: SimulatorHandle) -> None:
    with handle.episode(LOW, period=0.02) as world:
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


@pytest.mark.parametrize("drawn", [np.zeros((4, 3, 3), np.uint8), np.zeros((3, 4, 3))])
def test_what_is_no_picture_is_refused(drawn: np.ndarray) -> None:
    process: Any = ScriptedProcess()
    process.do_render = lambda width, height: drawn
    with pytest.raises(BadState, match="what is no picture: .*, not uint8"):
        World(process, Scene("empty")).render(4, 3)
