"""When a wait may end: never before what moves can no longer change a count."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.client.motion import Motion
from pytest_simbench.records.notes import Wait
from pytest_simbench.scene import Body, Box, FloatArray, Pose, Scene, Wrench
from pytest_simbench.tasks.base import cube
from pytest_simbench.tasks.waiting import MARGIN, Slack, carried_on, settle

COLOUR = (1.0, 1.0, 1.0, 1.0)
SCENE = Scene("two", tuple(cube(n, Pose.at(k, 0.0, 0.0), COLOUR) for k, n in enumerate("ab")))
SUPPORT = pytest.approx(0.002)


class Gliding:
    """A world whose first cube goes where `x` says, turned by `turn` about z, and whose joint
    follows `swing`."""

    def __init__(
        self,
        x: Callable[[float], float] = lambda t: 0.0,
        turn: Callable[[float], float] = lambda t: 0.0,
        swing: Callable[[float], float] = lambda t: 0.0,
        timestep: float = 0.01,
    ) -> None:
        self.scene, self.time, self.timestep, self.asked = SCENE, 12.8, timestep, 0
        self.began = self.time
        self.worked: dict[str, float] = {}
        self.paths = x, turn, swing

    def row(self, t: float) -> tuple[FloatArray, FloatArray]:
        x, turn, swing = (path(t - self.began) for path in self.paths)
        bodies = np.zeros((2, 13))
        bodies[:, 0], bodies[:, 3] = (x, 1.0), 1.0
        bodies[0, 3], bodies[0, 6] = np.cos(turn / 2), np.sin(turn / 2)
        return np.array([[swing], [0.0]]), bodies

    def stats(self) -> dict[str, dict[str, float]]:
        return {"stepping": {"simulated": self.time}}

    def wait(self, duration: float, *, log_period: float | None = None) -> Motion:
        self.asked += 1
        steps, every = (max(1, round(t / self.timestep)) for t in (duration, log_period))
        times = self.time + self.timestep * np.arange(every, steps + 1, every)
        self.time += steps * self.timestep
        joints, bodies = ([self.row(t)[part] for t in times] for part in (0, 1))
        return Motion(times, np.reshape(joints, (-1, 2, 1)), np.reshape(bodies, (-1, 2, 13)))


def waited(
    world: Gliding, *, at: float = 0.01, seconds: float = 60.0, full: bool = False
) -> tuple[Wait, bool]:
    """The wait for a count of whether the first cube is beyond `at` [m]; and the count."""

    def slacks(motion: Motion) -> Iterable[Slack]:
        assert motion.time[-1] == pytest.approx(world.time)
        yield Slack("a", "beyond", abs(float(motion.bodies[-1, 0, 0]) - at))

    _, wait = settle(world, seconds, slacks, full=full)
    assert wait.seconds == pytest.approx(world.time - world.began)
    assert world.worked == {"simulated": world.began}  # what the wait costs does not count
    return wait, world.paths[0](world.time - world.began) > at


def test_what_is_still_is_waited_for_two_seconds() -> None:
    flips = Gliding(turn=lambda t: 2 * np.pi * (round(20 * t) % 2))  # of the quaternion's sign
    for world in (Gliding(), flips):
        wait, _ = waited(world)
        assert wait == Wait(pytest.approx(2.0), 60.0, "support of a", pytest.approx(1e-6), SUPPORT)


PUSH = (1.0, 0.0, 0.0)
BELT = Box("belt", (1, 1, 0.1), Pose.at(0, 0, 1), prescribed=True, linear_velocity=PUSH)
LATE = Wrench(force=PUSH, start=50.0, end=50.5)


@pytest.mark.parametrize(("wrench", "more", "seconds"), [(LATE, (), 40), (Wrench(), (BELT,), 60)])
def test_what_acts_later_is_waited_for(
    wrench: Wrench, more: tuple[Body, ...], seconds: float
) -> None:
    world, (a, b) = Gliding(), SCENE.bodies
    world.scene = Scene("pushed", (a.changed(wrenches=(wrench,)), b, *more))
    assert waited(world)[0].seconds == pytest.approx(seconds)


def test_the_nearest_count_is_told() -> None:
    wait, _ = waited(Gliding(lambda t: 0.009))
    assert (wait.bound, wait.reach) == ("beyond of a", pytest.approx(1e-6))
    assert wait.slack == pytest.approx(0.001)


def test_in_full_it_is_one_wait() -> None:
    for world, full in ((Gliding(), True), (Gliding(), False)):
        wait, _ = waited(world, seconds=60.0 if full else 2.0, full=full)
        assert wait == Wait(pytest.approx(wait.of), wait.of)
        assert world.asked == (1 if full else 2)


@pytest.mark.parametrize(
    "world",
    [
        Gliding(lambda t: 0.0002 * t),  # it creeps: 12 mm in a minute
        Gliding(lambda t: 2e-5 * t, timestep=1 / 240),  # 1.2 mm, but with the margin 3.6
        Gliding(lambda t: 2e-6 * t**2),  # 1 mm as fast as after 2 s; it gets faster, to 7 mm
        Gliding(lambda t: 0.001 * np.sin(40 * t)),  # it rocks
        Gliding(turn=lambda t: 0.05 * t),  # it spins where it stands
        Gliding(swing=lambda t: 0.001 * t),  # the robot is not at rest
        Gliding(lambda t: 0.01 - 5e-7),  # less than a micrometre from the count
    ],
    ids=["creep", "slow creep", "accelerating", "rocking", "spinning", "robot", "near"],
)
def test_what_moves_or_is_undecided_keeps_it_running(world: Gliding) -> None:
    assert waited(world)[0].seconds > 20.0


def test_what_comes_to_rest_later_is_waited_for_until_then() -> None:
    wait, beyond = waited(Gliding(lambda t: 0.002 * min(t, 7.5)))
    assert beyond
    assert (wait.seconds, wait.bound) == (pytest.approx(9.0), "support of a")


@given(
    st.floats(-1e-3, 1e-3), st.floats(0.0, 1e-4), st.floats(0.0, 2.0), st.floats(-0.01, 0.01),
    st.floats(3.0, 60.0),
)  # fmt: skip
def test_no_count_changes_where_the_motion_keeps_within_what_it_was_carried_on_to(
    speed: float, more: float, less: float, at: float, seconds: float
) -> None:
    """A speed that grows no more than evenly, or dies away, changes no count after the end. One
    that turns back is not what was carried on."""
    lasting = lambda t: -np.expm1(-less * t) / less if less else t  # noqa: E731
    path = lambda t: (speed + np.sign(speed) * more * lasting(t) / 2) * lasting(t)  # noqa: E731
    _, beyond = waited(Gliding(path), at=at, seconds=seconds)
    assert beyond == (path(seconds) > at)


@given(st.floats(0.0, 1e-3), st.floats(0.0, 1e-5), st.floats(0.1, 60.0))
def test_it_is_carried_on_at_least_as_fast_and_as_it_grows(v: float, a: float, left: float) -> None:
    before, last = (np.array([v + a * k]) for k in (0, 1))
    least = MARGIN * (last[0] * left + a * left**2 / 2)
    assert carried_on(before, last, left)[0] >= least * (1 - 1e-9) - 1e-15
    assert carried_on(last, before, left)[0] == pytest.approx(MARGIN * v * left)


@given(st.floats(0.0005, 0.3), st.floats(0.01, 70.0))
def test_in_pieces_there_are_as_many_steps_as_in_one(timestep: float, seconds: float) -> None:
    gliding = Gliding(lambda t: t, timestep=timestep)  # no sampling takes it for still
    waited(gliding, seconds=seconds)
    off = abs(gliding.time - gliding.began - seconds)
    assert off <= max(timestep / 2, timestep - seconds) + 1e-9
