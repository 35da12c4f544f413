"""The stepping loop: what it asks of a simulator, what it tells it, what its clocks make of it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import (
    Box,
    FloatArray,
    Pose,
    Robot,
    Scene,
    SceneError,
    Trajectory,
    Wrench,
)
from pytest_simbench.simulator import DivergedError, NotSupportedError
from pytest_simbench.worker import control
from pytest_simbench.worker.loop import Loop
from pytest_simbench.worker.stepping import CHECK_PERIOD, Acting, Clocks, Stepper, prescribed
from tests.worker.hosted import Toy

CUBE = Box("cube", (0.05, 0.05, 0.05), Pose.at(0.5, 0.0, 0.5, yaw=0.3), mass=0.1)


def test_time_and_clocks_advance_together() -> None:
    stepper = stepping(Toy())
    for duration, steps in ((0.25, 125), (0.1, 175)):
        stepper.wait(duration, None)
        assert stepper.clocks.steps == steps
        assert stepper.clocks.simulated == pytest.approx(stepper.simulator.time) == 0.002 * steps


def test_a_state_that_is_sampled_is_not_read_again_to_be_checked() -> None:
    """So samples of that period cost nothing; the last look is at the end of each operation."""
    toy = Toy()
    log = stepping(toy).wait(1.0, CHECK_PERIOD)
    assert (len(log["time"]), toy.looked) == (10, 10)
    stepping(toy).wait(1.0, None)
    assert toy.looked == 20
    stepping(toy).wait(0.05, None)
    assert toy.looked == 21


def test_pictures_go_on_from_one_operation_to_the_next() -> None:
    toy, times = Toy(), []
    stepper = stepping(toy)
    stepper.film = 20, lambda: times.append(toy.time)
    for duration in (0.05, 0.02, 0.06):
        stepper.wait(duration, None)
    assert times == pytest.approx([0.04, 0.08, 0.12])


def stepping(
    toy: Toy, beat: Callable[[float], None] = lambda at: None, robot: Robot | None = None
) -> Stepper:
    return Stepper(toy, Scene("s", (CUBE,), robot), beat)


def test_the_wall_clock_is_that_of_the_steps_alone() -> None:
    """Not of looks at the state, windows, pacing, or the control workload."""
    toy = Toy(sleep=0.002, look=0.01)
    stepper = stepping(toy)
    stepper.wait(0.1, 0.01)
    assert toy.looked >= 10
    assert toy.wall <= stepper.clocks.wall < toy.wall + 0.05
    toy.gui, toy.look = True, 0.0
    stepper.wait(0.1, None)
    assert toy.pictures >= 2
    assert toy.wall <= stepper.clocks.wall < toy.wall + 0.05
    assert stepper.clocks.simulated / stepper.clocks.wall == pytest.approx(0.2 / toy.wall, rel=0.3)


def test_pacing_waits_for_the_clock_and_is_not_the_steps_time() -> None:
    toy = Toy(burn=0.0002)
    stepper = stepping(toy)
    stepper.real_time = True
    began = time.perf_counter()
    stepper.wait(0.4, None)
    assert time.perf_counter() - began >= 0.39
    assert stepper.clocks.wall < toy.wall + 0.05


def test_cpu_seconds_are_those_of_the_steps_and_not_the_control_s() -> None:
    """Nor the clock's, read twice for each sample, which made a throw 3 % too dear. In a process of
    its own, as a worker is: threads that other tests left compute too."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as alone:
        burnt, clocks, spent, runs = alone.submit(_step_with_a_slow_control).result()
    control = runs["control_runs"] * runs["control_cpu"]
    assert control >= 0.02
    assert runs["control_cpu"] == pytest.approx(0.02, rel=0.2)
    assert burnt <= clocks.cpu <= burnt + 0.015
    assert clocks.cpu <= spent - 0.9 * control


def _step_with_a_slow_control() -> tuple[float, Clocks, float, dict[str, float]]:
    """CPU seconds burnt in steps, the stepper's clocks, CPU seconds in all, the control's."""

    def slow(seconds: float = 0.02) -> float:
        began = time.process_time()
        while time.process_time() - began < seconds:
            pass
        return 0.0

    class Slow(control.Clock):
        def waited(self) -> float:
            return slow(0.0003)

    control.workload = slow
    toy = Toy(burn=0.001, look=0.001)
    toy.burns_looking = True
    stepper = stepping(toy)
    stepper._clock = Slow()
    began = time.process_time()
    stepper.wait(0.4, 0.004)  # every other step is sampled
    return toy.burnt, stepper.clocks, time.process_time() - began, stepper.control.to_wire()


def test_who_waits_for_a_processor_while_looking_or_asking_did_not_wait_in_a_step() -> None:
    toy = Toy(look=0.002)
    stepper = stepping(toy)

    class Waiting(control.Clock):
        def waited(self) -> float:
            return 0.002 * toy.looked

    stepper._clock = Waiting()
    stepper.wait(0.4, 0.0)
    stepper.close_loop(asked(lambda: True), None)
    assert toy.looked == 225  # once before, 20 times to ask, 4 to check between
    assert stepper.clocks.waited == pytest.approx(0.0)


def asked(answer: Callable[[], bool]) -> Loop:
    """Asks 20 times, each 20 steps, whether it goes on."""
    row, none = np.zeros(1), np.zeros(1)
    return Loop(20, 20, 0, (row, none, none), 0.04, lambda *_: (row, none) if answer() else None)


def test_a_loop_goes_evenly_from_answer_to_answer_as_late_as_declared() -> None:
    said = iter([(np.array([4.0]), np.array([6.0])), (np.array([0.0]), np.array([7.0])), None])
    seen: list[tuple[Any, ...]] = []
    start = np.array([1.0]), np.array([9.0]), np.array([5.0])  # its velocity is not gone on with
    loop = Loop(2, 3, 1, start, 0.1, lambda *now: seen.append(now) or next(said))  # type: ignore[func-returns-value]
    rows, steps, more = loop.rows(), [], True
    for k in range(3):
        more = more and loop.ask(0.1 * k, np.full((2, 1), k), np.full((1, 13), k))
        steps += [np.ravel(next(rows)).tolist() for _ in range(2) if more]
    assert (loop.steps, more) == (6, False)
    assert steps == [[1.0, 0.0, 5.0], [2.5, 30.0, 6.0], [4.0, 30.0, 6.0], [2.0, -40.0, 7.0]]
    for k, (now, joints, told, bodies) in enumerate(seen):  # what is in force is that of `steps`
        assert (now, joints[1, 0], bodies[0, 0]) == (0.1 * k, k, k)
        assert np.ravel(told).tolist() == [[1.0, 0.0, 5.0], *steps[1::2]][k]


def test_a_question_is_no_time_of_the_steps_also_where_the_policy_ends_it() -> None:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as alone:
        burnt, wall, clocks = alone.submit(_ask_thrice).result()
    assert clocks.steps == 40
    assert wall <= clocks.wall < wall + 0.03
    assert burnt <= clocks.cpu < burnt + 0.02


def _ask_thrice() -> tuple[float, float, Clocks]:
    """CPU and wall seconds of the steps, and the stepper's clocks."""
    toy, answers = Toy(burn=0.001), iter([True, True, False])
    stepper = stepping(toy)

    def think() -> None:
        began = time.thread_time()
        while time.thread_time() - began < 0.05:
            pass

    def answer() -> bool:
        thread = threading.Thread(target=think)  # as of numpy, or of a renderer
        thread.start()
        thread.join()
        time.sleep(0.05)
        return next(answers)

    stepper.close_loop(asked(answer), None)
    return toy.burnt, toy.wall, stepper.clocks


def test_an_engine_s_other_threads_are_cpu_time() -> None:
    class Threaded(Toy):
        def step(self) -> None:
            thread = threading.Thread(target=super().step)
            thread.start()
            thread.join()

    toy = Threaded(burn=0.001)
    stepper = stepping(toy)
    stepper.wait(0.1, None)
    assert stepper.clocks.cpu >= toy.burnt > 0.0


def test_sleeping_is_no_cpu_time() -> None:
    toy = Toy(sleep=0.002)
    stepper = stepping(toy)
    stepper.wait(0.2, None)
    assert stepper.clocks.cpu < 0.3 * stepper.clocks.wall


def test_signs_of_life_come_while_it_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pytest_simbench.worker.stepping.HEARTBEAT_PERIOD", 0.05)
    beats: list[float] = []
    toy = Toy(sleep=0.002)
    stepping(toy, beats.append).wait(0.6, None)
    assert 2 <= len(beats) <= 14
    assert beats == sorted(beats)
    assert all(0.0 < at <= 0.6 + 1e-9 for at in beats)


def test_what_is_quick_gives_no_sign_of_life() -> None:
    beats: list[float] = []
    stepping(Toy(), beats.append).wait(1.0, None)
    assert beats == []


def test_each_step_gets_its_own_command_and_a_wait_none() -> None:
    toy = Toy()
    stepper = stepping(toy)
    rows = np.arange(6.0)[:, None]
    stepper.follow(Trajectory(0.002, rows, 10 * rows, 100 * rows), None)
    assert [c.ravel().tolist() for c in toy.commands] == [
        [k, 10.0 * k, 100.0 * k] for k in (1.0, 2.0, 3.0, 4.0, 5.0)
    ]
    assert (toy.steps, np.ravel(stepper.told).tolist()) == (5, [5.0, 50.0, 500.0])
    stepper.wait(0.01, None)
    assert (len(toy.commands), toy.steps) == (5, 10)
    stepper.wait(0.0, None)
    assert toy.steps == 11  # a wait is a step at least


@pytest.mark.parametrize("what", ["bodies", "joints"])
@pytest.mark.parametrize("at", [0.04, 0.3])
def test_a_state_that_is_no_number_is_seen_within_a_tenth_of_a_second(
    what: str, at: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    toy = Toy()
    toy.joints = np.zeros((2, 9))
    step = toy.step

    def failing() -> None:
        step()
        if toy.time >= at:
            setattr(toy, what, np.full_like(getattr(toy, what), np.inf))

    monkeypatch.setattr(toy, "step", failing)
    with pytest.raises(DivergedError, match=f"{what} is not finite at t = .*timestep=0.002"):
        stepping(toy, robot=panda()).wait(0.5 if at > 0.1 else 0.05, None)
    assert toy.time <= at + 0.1 + 1e-9


def test_log_at_its_period() -> None:
    class Rising(Toy):
        def body_state(self) -> FloatArray:
            return super().body_state() + self.time

    toy = Rising()
    toy.joints = np.zeros((2, 9))
    stepper = stepping(toy, robot=panda())
    log = stepper.wait(0.1, 0.02)
    assert np.allclose(log["time"], [0.02, 0.04, 0.06, 0.08, 0.10])
    assert log["joints"].shape == (5, 2, 9)
    assert log["bodies"].shape == (5, 1, 13)
    assert np.allclose(log["bodies"][:, 0, 2], log["time"])
    assert len(stepper.wait(0.01, 0.0)["time"]) == 5
    assert stepper.wait(0.01, None) == {}


def test_a_log_keeps_what_was_even_where_an_adapter_gives_one_array_again_and_again() -> None:
    class Reusing(Toy):
        def step(self) -> None:
            super().step()
            self.bodies[0, 2] = self.joints[0, 0] = self.time

    toy = Reusing()
    toy.joints = np.zeros((2, 9))
    log = stepping(toy, robot=panda()).wait(0.1, 0.02)
    assert np.allclose(log["bodies"][:, 0, 2], log["time"])
    assert np.allclose(log["joints"][:, 0, 0], log["time"])


def test_a_motion_shorter_than_the_period_has_no_log() -> None:
    """None at all: arrays of no samples would not have a sample's shape."""
    stepper = stepping(Toy())
    assert stepper.wait(0.01, 0.05) == {}
    assert len(stepper.wait(0.05, 0.05)["time"]) == 1


def test_a_slow_window_takes_at_most_half_of_the_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pictures, stepper = [], stepping(Toy(burn=0.0001))

    def draw() -> None:
        began = time.perf_counter()
        time.sleep(0.05)
        pictures.append(time.perf_counter() - began)

    monkeypatch.setattr(stepper.simulator, "gui", True)
    monkeypatch.setattr(stepper.simulator, "refresh_window", draw)
    began = time.perf_counter()
    for _ in range(4):
        stepper.wait(1.0, None)
    elapsed = time.perf_counter() - began
    assert pictures
    assert sum(pictures) <= elapsed / 2 + pictures[-1]


PULL = Wrench(force=(1.0, 0.0, 0.0), start=0.003, end=0.007)
PULLED = Scene("pulled", (Box("a", (0.1,) * 3, Pose.at(0.0, 0.0, 1.0), 1.0, wrenches=(PULL,)),))
BELT = Box(
    "belt",
    (1.0, 0.2, 0.1),
    Pose.at(0.0, 0.0, 0.5),
    linear_velocity=(0.5, 0.0, 0.0),
    angular_velocity=(0.0, 0.0, 2.0),
    prescribed=True,
)


class Told(Toy):
    """Notes what it is told."""

    def __init__(self) -> None:
        super().__init__()
        self.pushed: list[float] = []
        self.led: list[tuple[FloatArray, FloatArray]] = []

    def push(self, wrenches: FloatArray) -> None:
        self.pushed.append(float(wrenches[0, 0]))

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        self.led.append((before, after))


def told(scene: Scene, steps: int) -> Told:
    simulator = Told()
    acting = Acting.of(simulator, scene)
    simulator.pushed.clear()
    simulator.led.clear()
    Stepper(simulator, scene, lambda at: None, acting).wait(0.002 * steps, None)
    return simulator


def test_a_force_is_told_while_it_acts_and_once_that_it_ended() -> None:
    # steps of 2 ms; the first is told whatever acts, since nobody knows what was before
    assert told(PULLED, 8).pushed == pytest.approx([0.0, 0.5, 1.0, 0.5, 0.0])


def test_a_force_from_the_start_on_is_not_told_before_the_first_step() -> None:
    """Engines that add up forces would have it twice in that step."""
    pulled = PULLED.bodies[0].changed(wrenches=(Wrench(force=(0.5, 0.0, 0.0)),))
    simulator = Told()
    assert Acting.of(simulator, Scene("s", (pulled,)))
    assert simulator.pushed == [0.0]


def test_a_motion_goes_on_from_the_simulators_time() -> None:
    simulator = Told()
    acting = Acting.of(simulator, Scene("s", (BELT,)))
    simulator.steps = 100  # restored
    acting.steps()()
    before, after = simulator.led[-1]
    assert before[0] == pytest.approx(prescribed(BELT, 0.2))
    assert after[0, :3] == pytest.approx([0.101, 0.0, 0.5])
    assert Pose.from_array(after[0]).yaw == pytest.approx(0.404)
    assert after[0, 7:] == pytest.approx([0.5, 0.0, 0.0, 0.0, 0.0, 2.0])


def test_where_nothing_acts_nobody_is_told() -> None:
    assert Acting.of(Toy(), Scene("s", (CUBE,))) is None


@pytest.mark.parametrize(
    ("scene", "what"),
    [(PULLED, "forces on bodies"), (Scene("s", (BELT,)), "bodies that move as prescribed")],
)
def test_who_takes_none_says_so_before_the_first_step(scene: Scene, what: str) -> None:
    with pytest.raises(NotSupportedError, match=f"toy has no {what}"):
        Acting.of(Toy(), scene)


def test_a_prescribed_body_is_neither_free_of_its_motion_nor_fixed() -> None:
    scene = Scene("s", (BELT,))
    assert scene.free_bodies == scene.prescribed_bodies == (BELT,)
    assert not scene.fixed_bodies
    assert Scene.from_wire(scene.to_wire()) == scene
    assert "prescribed" not in BELT.changed(prescribed=False, mass=1.0).to_wire()
    with pytest.raises(SceneError, match="moves as prescribed, so it has no mass"):
        BELT.changed(mass=1.0)


def test_a_turn_about_any_axis_keeps_the_quaternion_a_unit() -> None:
    row = prescribed(BELT.changed(angular_velocity=(0.3, -1.0, 2.0)), 7.3)
    turn = Rotation.from_rotvec(7.3 * np.array([0.3, -1.0, 2.0])).as_matrix()
    assert Pose.from_array(row).rotation() == pytest.approx(turn)
    assert np.linalg.norm(row[3:7]) == pytest.approx(1.0)


def test_what_only_slides_keeps_its_orientation() -> None:
    turned = Pose.at(0.0, 0.0, 0.5, yaw=0.3)
    row = prescribed(BELT.changed(angular_velocity=(0.0, 0.0, 0.0), pose=turned), 2.0)
    assert row == pytest.approx([1.0, 0.0, 0.5, *turned.quaternion, 0.5, 0, 0, 0, 0, 0])
