"""What random perturbations leave, and how a displacement grows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from pytest_simbench.client.world import World
from pytest_simbench.measure.results import InconclusiveWarning
from pytest_simbench.repeatability.episode import Episodes
from pytest_simbench.repeatability.motions import gaps
from pytest_simbench.repeatability.perturbation import Perturbation
from pytest_simbench.repeatability.stability import (
    Sensitivity,
    Stability,
    sensitivity,
    stability,
)
from pytest_simbench.robot.panda import panda
from pytest_simbench.scene import Scene, Trajectory
from pytest_simbench.tasks import Jitter, Moment
from pytest_simbench.tasks.base import Count, Outcome
from tests.repeatability.conftest import Tumbling, first_seed


def test_within_the_margin_all_is_kept(towers: Callable[..., Episodes]) -> None:
    result = stability(towers(), {"x": 0.001, "mass": 0.05}, examples=8)
    assert list(result.kept) == [1.0] * 8
    assert (result.unchanged, result.worst) == (8, "")
    assert result.sentence == (
        "kept 100 % [58, 100] within 1 mm in x, 5 % in mass; the same outcome in 8 of 8"
    )
    result.assert_kept_at_least(0.5)
    with pytest.warns(
        InconclusiveWarning, match="at least 90 % should be kept, inconclusive: kept"
    ):
        result.assert_kept_at_least(0.9)
    with pytest.raises(AssertionError, match=r"inconclusive: kept 100 % .*\(--sim-strict\)"):
        replace(result, strict=True).assert_kept_at_least(0.9)


def test_few_runs_are_not_judged() -> None:
    result = Stability("x", [0.0] * 4, 0, "1 mm in x", "")
    with pytest.warns(InconclusiveWarning, match="not judged: .*a claim needs 5 repetitions"):
        result.assert_kept_at_least(0.9)


def test_beyond_it_towers_fall(towers: Callable[..., Episodes]) -> None:
    result = stability(towers(margin=0.003), {"x": 0.012}, examples=20)
    assert 0 < result.unchanged < 20
    assert min(result.kept) == 0.0
    assert result.worst.endswith("topples tower 1")
    with pytest.raises(AssertionError, match="mujoco: at least 97 % should be kept, but kept"):
        result.assert_kept_at_least(0.97)


def test_a_crash_keeps_nothing(towers: Callable[..., Episodes]) -> None:
    result = stability(towers("Brittle"), {"friction": 0.2}, examples=10)
    assert set(result.kept) == {0.0, 1.0}
    assert "ends in WorkerExited" in result.worst


def test_a_tower_that_stands_keeps_the_displacement(towers: Callable[..., Episodes]) -> None:
    """Nothing slides and nothing falls: a millimetre stays a millimetre."""
    result = sensitivity(towers(margin=0.015), Perturbation("x", 5, "cube_04"))
    assert result.ratio[0.1] == pytest.approx(1.0, abs=0.1)
    assert result.ratio[1.0] == pytest.approx(1.0, abs=0.1)
    assert result.ratio[20.0] is None
    result.assert_below(1.2, until=1.0)


def test_falling_cubes_part(tumbling: Callable[..., Episodes]) -> None:
    result = sensitivity(tumbling(), Perturbation("x", 1, "cube_1"))
    assert result.ratio[0.1] == pytest.approx(1.0, abs=0.3)
    assert result.largest > 3
    with pytest.raises(AssertionError, match="mm per mm after 0.1 mm in x of cube_1.*below 0.5"):
        result.assert_below(0.5, until=1.0)


@dataclass(frozen=True)
class Peeking(Tumbling):
    """Waits as long as it reads off the cube's place: 10 ms more for each 0.1 mm."""

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        for phase in ("look", "fall", "land"):
            with world.phase(phase):
                world.wait(round(0.05 + 100 * (world.pose("cube_1").position[0] - 0.02), 3))
        return Outcome({"left": 0.0})


def test_the_same_commands_are_sent_whatever_the_task_would_plan(
    tumbling: Callable[..., Episodes],
) -> None:
    """Were the waits planned anew, the falling cubes would be 8 mm apart: 80 mm per mm."""
    episodes = first_seed(tumbling().handle, Peeking(), jitter=0.0)
    base, moved = (episodes.run([Perturbation("x", n, "cube_1")] if n else []) for n in (0, 1))
    assert base.tape[1].duration != moved.tape[1].duration
    assert sensitivity(episodes, Perturbation("x", 1, "cube_1")).largest < 1.5


@dataclass(frozen=True)
class Late(Tumbling):
    """The cubes rest for a while before anything is done to them."""

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        bodies = super().scene(seed, jitter).bodies
        return Scene("late", bodies, panda(), room=(100.0, 100.0, 100.0))

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        with world.phase("settle start"):
            world.wait(0.05)
        rows = np.zeros((26, 9))
        start = rows + world.scene.robot.column("initial_position")  # type: ignore[union-attr]
        with world.phase("swing"):
            world.follow(Trajectory(0.004, start, rows, rows))
            world.wait(1.0)
        return Outcome({"left": 0.0})


def test_times_count_from_the_first_motion_of_the_task(tumbling: Callable[..., Episodes]) -> None:
    """Nothing has happened at 0.1 s of a world that rests for 0.05 s first but what is told at
    0.05 s after the task began."""
    episodes = first_seed(tumbling().handle, Late())
    moments = (Moment("at first", "swing"), Moment("swung", "swing", 1), Moment("never", "swim"))
    found = sensitivity(episodes, Perturbation("x", 1, "cube_1"), moments)
    base = episodes.run()
    moved = episodes.run([Perturbation("x", 1, "cube_1")], play=base.tape)
    between = gaps(base.motions, moved.motions)
    expected = between.after(0.05 + 0.1)
    assert expected is not None
    assert found.ratio[0.1] == pytest.approx(expected / 1e-4)
    assert found.until["at first"] == pytest.approx(
        between.largest()[between.time <= 0.051].max() / 1e-4
    )
    assert found.until["swung"] == pytest.approx(
        between.largest()[between.time <= 0.151].max() / 1e-4
    )
    assert found.until["never"] is None
    assert found.largest > found.until["swung"] > found.until["at first"] * 1.001
    with pytest.raises(AssertionError, match="the task never came to never"):
        found.assert_below(10.0, until="never")


def test_a_moment_bounds_what_is_judged() -> None:
    grown = Sensitivity("x", "0.1 mm in x of a", {0.1: 1.0}, 400.0, {"in flight": 30.0})
    grown.assert_below(31.0, until="in flight")
    with pytest.raises(AssertionError, match="30 until in flight.*expected below 30 until in fl"):
        grown.assert_below(30.0, until="in flight")
    with pytest.raises(ValueError, match="no moment is named 'lost'; there are: in flight"):
        grown.assert_below(30.0, until="lost")
    with pytest.raises(AssertionError, match=r"the task never came to 0\.05 s"):
        grown.assert_below(30.0, until=0.05)


def test_later_times_are_not_judged() -> None:
    grown = Sensitivity("x", "0.1 mm in x of a", {0.1: 1.0, 5.0: 400.0, 20.0: None}, 400.0)
    grown.assert_below(2.0, until=1.0)
    with pytest.raises(AssertionError, match="expected below 2 until 5 s"):
        grown.assert_below(2.0, until=5.0)


def test_only_displacements(towers: Callable[..., Episodes]) -> None:
    with pytest.raises(ValueError, match="per millimetre, not for 1 % in the mass of cube_01"):
        sensitivity(towers(), Perturbation("mass", 1, "cube_01"))
