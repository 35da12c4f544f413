"""Scores of throws where the right one is known, and is neither nothing nor everything."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.records.notes import Wait
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.tasks import Jitter, Outcome, Throwing
from pytest_simbench.tasks.throwing import perfect_throw
from tests.tasks.flying import GRAVITY, PROJECTILE, FlyingProcess
from tests.tasks.scripted import Mishap, drop, move, perform, put

EXACT = Jitter(0.0, 0.0)
TASK, IN_FULL = Throwing(settle=3.0), Throwing(full_wait=True)
PERFECT = perfect_throw(panda(), 0.5, True)
NOTHING_MOVED = {"moved": 0.0, "hit": 0.0, "moved_otherwise": 0.0}


def thrown(
    *script: Mishap, task: Throwing = TASK, jitter: Jitter = EXACT, **world: object
) -> tuple[Outcome, FlyingProcess]:
    process = FlyingProcess(**world)
    return perform(task, *script, jitter=jitter, process=process)[0], process


def parabola(position: FloatArray, velocity: FloatArray) -> float:
    """Where a flight crosses z = 0.05, by small steps of Heun's method, linear in the last one."""
    p, v, dt = np.array(position, float), np.array(velocity, float), 1e-3
    while True:
        q, w = p + v * dt + GRAVITY * dt * dt / 2, v + GRAVITY * dt
        if q[2] <= 0.05:
            return float(p[0] + (q[0] - p[0]) * (p[2] - 0.05) / (p[2] - q[2]))
        p, v = q, w


def values(outcome: Outcome, *names: str) -> dict[str, float | None]:
    return {name: outcome.metrics[name] for name in names or NOTHING_MOVED}


def test_a_perfect_throw() -> None:
    """Two of six are pushed away, two by less than 5 cm: every metric of it."""
    outcome, process = thrown(
        pushed={
            "pyramid_4": (0.0, -0.051, 0.0),
            "pyramid_6": (0.10, 0.0, -0.05),
            "pyramid_5": (0.049, 0.049, 0.0),
            "pyramid_2": (-0.049, 0.0, 0.2),
        }
    )
    assert process.touched_at is not None
    assert values(outcome) == {"moved": 2 / 6, "hit": 1.0, "moved_otherwise": 0.0}
    assert outcome.details["moved"] == ["pyramid_4", "pyramid_6"]
    assert process.counts == [(2, 6)]
    settled, *_ = (asked for asked in process.asked if asked.phase == "settle")
    assert process.marks == pytest.approx({"start": 1.0, "end": settled.began})
    metrics = outcome.metrics
    assert metrics["lost_in_transit"] == 0.0
    landing = parabola(PERFECT.position, PERFECT.velocity)
    assert metrics["landing_x"] == pytest.approx(landing, abs=1e-3)
    assert metrics["landing_error"] == pytest.approx(0.0, abs=1e-3)
    assert metrics["flight_error"] == pytest.approx(0.0, abs=1e-9)
    assert metrics["release_speed"] == pytest.approx(np.linalg.norm(PERFECT.velocity), abs=0.01)
    assert metrics["release_velocity_error"] == pytest.approx(0.0, abs=1e-3)
    assert metrics["release_position_error"] == pytest.approx(0.0, abs=2e-3)
    assert metrics["release_time_error"] == pytest.approx(0.0, abs=0.004)
    assert metrics["limits"] == pytest.approx(96.5, abs=0.1)
    assert set(metrics) == {metric.name for metric in TASK.metrics}


@pytest.mark.parametrize(("push", "moved"), [(0.046, 1), (0.044, 0)])
def test_in_a_smaller_scene_all_lengths_are_smaller(push: float, moved: int) -> None:
    """By a tenth: cubes count from 45 mm on, and a flight ends at that height."""
    task = Throwing(settle=3.0)
    vars(task)["scale"] = 0.9
    outcome, process = thrown(
        *(Mishap("settle", 1.0, move(name, y=y)) for name, y in (("pyramid_1", -0.044),
                                                                 ("pyramid_3", 0.046))),
        task=task, scale=0.9, pushed={"pyramid_6": (0.0, push, 0.0)},
        velocity=lambda velocity: 0.93 * velocity,
    )  # fmt: skip
    assert process.touched_at is not None
    assert values(outcome) == {"moved": moved / 6, "hit": moved, "moved_otherwise": 1.0}
    release = outcome.details["release"]
    rise, fall = release["velocity"][2], release["position"][2] - 0.045
    flown = (rise + math.sqrt(rise**2 - 2 * GRAVITY[2] * fall)) / -GRAVITY[2]
    landing = release["position"][0] + release["velocity"][0] * flown
    assert outcome.metrics["landing_x"] == pytest.approx(landing)
    docs = " ".join(metric.doc for metric in task.metrics)
    assert (docs.count("4.5 cm"), docs.count("z = 0.045")) == (2, 2)


def test_the_details_explain_it() -> None:
    """What was released and flew, beside what a perfect follower's throw is."""
    outcome, _ = thrown(pushed={"pyramid_6": (0.10, 0.0, -0.05)}, late=0.1, drop=0.05)
    details = outcome.details
    assert set(details) == {
        "limits", "release", "flight_landing_x", "moved", "moved_otherwise", "projectile_end",
    }  # fmt: skip
    release = dict(details["release"])
    landing = PERFECT.landing(GRAVITY)
    assert release.pop("reference_time") == PERFECT.time
    assert release.pop("reference_landing_x") == pytest.approx(landing)
    assert np.allclose(release.pop("reference_position"), PERFECT.position, atol=1e-12)
    assert np.allclose(release.pop("reference_velocity"), PERFECT.velocity, atol=1e-12)
    assert release.pop("time") == pytest.approx(PERFECT.time + 0.1, abs=0.003)
    position, velocity = release.pop("position"), release.pop("velocity")
    assert not release
    assert parabola(position, velocity) == pytest.approx(outcome.metrics["landing_x"], abs=1e-3)
    assert np.linalg.norm(velocity) == pytest.approx(outcome.metrics["release_speed"])
    limits = details["limits"]
    assert limits["velocity"] == pytest.approx(0.965, abs=0.001)
    assert limits["acceleration"] == pytest.approx(0.68, abs=0.01)
    assert limits["torque"] == pytest.approx(0.8994, abs=0.002)  # with the cube in the hand
    assert details["flight_landing_x"] < outcome.metrics["landing_x"]


def test_a_throw_that_falls_short() -> None:
    outcome, process = thrown(velocity=lambda velocity: 0.8 * velocity)
    assert process.touched_at is None
    assert values(outcome) == NOTHING_MOVED
    short = parabola(PERFECT.position, 0.8 * PERFECT.velocity)
    full = parabola(PERFECT.position, PERFECT.velocity)
    assert outcome.metrics["landing_x"] == pytest.approx(short, abs=2e-3)
    assert outcome.metrics["landing_error"] == pytest.approx(full - short, abs=2e-3)
    assert outcome.metrics["release_velocity_error"] == pytest.approx(
        0.2 * np.linalg.norm(PERFECT.velocity), abs=0.01
    )


def test_the_velocity_error_is_one_of_vectors() -> None:
    """Thrown aside by 30 degrees at the same speed: 2 v sin 15 degrees."""
    c, s = math.cos(math.pi / 6), math.sin(math.pi / 6)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    outcome, _ = thrown(velocity=lambda velocity: turn @ velocity)
    speed = np.linalg.norm(PERFECT.velocity)
    assert outcome.metrics["release_speed"] == pytest.approx(speed, abs=0.01)
    error = 2 * math.hypot(*PERFECT.velocity[:2]) * math.sin(math.pi / 12)
    assert outcome.metrics["release_velocity_error"] == pytest.approx(error, abs=0.01)


@pytest.mark.parametrize("late", [0.02, 0.1])
def test_a_late_release(late: float) -> None:
    outcome, _ = thrown(late=late)
    assert outcome.metrics["release_time_error"] == pytest.approx(late, abs=0.003)
    timed = PERFECT.timed
    row = PERFECT.row + round(late / 0.004)
    model = RobotModel(panda())
    position = np.array(model.tool_pose(timed.position[row]).position)
    velocity = model.tool_velocity(timed.position[row], timed.velocity[row])
    landing = parabola(position, velocity)
    assert outcome.metrics["landing_x"] == pytest.approx(landing, abs=3e-3)
    assert outcome.metrics["landing_error"] == pytest.approx(
        abs(landing - parabola(PERFECT.position, PERFECT.velocity)), abs=3e-3
    )
    assert outcome.metrics["release_position_error"] == pytest.approx(
        np.linalg.norm(position - PERFECT.position), abs=8e-3
    )
    assert outcome.metrics["lost_in_transit"] == 0.0


def test_an_early_release_is_early() -> None:
    """By 20 ms, too little to be lost in transit: the cube is still between the fingers."""
    outcome, _ = thrown(Mishap("throw", PERFECT.time - 0.02, drop))
    assert outcome.metrics["lost_in_transit"] == 0.0
    assert outcome.metrics["landing_error"] > 0.0


def test_lost_while_winding_up() -> None:
    """Whatever then pushes it into the pyramid, the arm for instance, it was not thrown."""
    swept = Mishap("throw", 0.5, lambda process: process.throw(PROJECTILE, [2.66, 0.0, 2.09]))
    pushed = {"pyramid_6": (0.1, 0.0, 0.0)}
    outcome, process = thrown(
        Mishap("wind up", 0.5, drop),
        Mishap("throw", 0.4, put(PROJECTILE, Pose.at(0.0, 0.0, 0.3))),
        swept,
        pushed=pushed,
    )
    assert process.touched_at is not None
    assert outcome.details["lost"] == "was not in the hand when the swing began"
    assert values(outcome) == {"moved": 0.0, "hit": 0.0, "moved_otherwise": 1.0}
    expected = {"lost_in_transit": 1.0, "landing_x": None, "release_time_error": None}
    assert values(outcome, *expected) == expected
    assert "kept" not in outcome.details
    assert outcome.metrics["limits"] == pytest.approx(96.5, abs=0.1)


def test_lost_in_the_swing_and_there_all_the_same() -> None:
    """The cube slips out 0.3 s early but flies to the pyramid: it did hit it. It is said to be lost
    when it is 6 cm away."""
    target = np.array([1.33, 0.0, 0.12])

    def aimed(velocity: FloatArray) -> FloatArray:
        start, t = np.array(process.poses[PROJECTILE].position), 0.5
        return (target - start) / t - GRAVITY * t / 2

    process = FlyingProcess(velocity=aimed, pushed={"pyramid_6": (0.1, 0.0, 0.0)})
    slip = Mishap("throw", PERFECT.time - 0.3, drop)
    outcome, _ = perform(TASK, slip, jitter=EXACT, process=process)
    assert process.touched_at is not None
    assert outcome.metrics["lost_in_transit"] == 1.0
    assert values(outcome) == {"moved": 1 / 6, "hit": 1.0, "moved_otherwise": 0.0}
    assert outcome.metrics["release_time_error"] == pytest.approx(-0.3, abs=0.08)
    left, _, into = outcome.details["lost"].partition(f"{PERFECT.time - 0.3:.1f}")
    assert (left, into[2:]) == ("left the hand ", " s into the throw")
    assert outcome.reasons == (outcome.details["lost"],)


def test_lost_while_picking() -> None:
    outcome, _ = thrown(Mishap("pick", 0.0, move(PROJECTILE, x=0.2)))
    assert outcome.details["lost"] == "projectile is not in the hand"
    expected = {"lost_in_transit": 1.0, "hit": 0.0, "landing_x": None}
    assert values(outcome, *expected) == expected


def test_never_released() -> None:
    outcome, _ = thrown(late=math.inf)
    assert outcome.details["kept"] == "the cube never left the hand"
    assert values(outcome) == NOTHING_MOVED
    expected = {"lost_in_transit": 0.0, "landing_x": None, "release_time_error": None}
    assert values(outcome, *expected) == expected
    assert outcome.metrics["limits"] == pytest.approx(96.5, abs=0.1)


def collapse(*numbers: int) -> list[Mishap]:
    return [Mishap("throw", 0.3, move(f"pyramid_{n}", y=0.1)) for n in numbers]


def creep(by: float) -> list[Mishap]:
    """Within 40 s, in steps."""
    return [Mishap("settle", k / 10, move("pyramid_6", y=by / 399)) for k in range(1, 400)]


LONG, AWAY = replace(IN_FULL, settle=40.0), {"pyramid_6": (0.08, 0.0, 0.0)}
STUDY = replace(TASK.study(), feasible=True)


@pytest.mark.parametrize(
    ("task", "script", "pushed", "moved", "otherwise"),
    [
        (TASK, collapse(6, 5, 3), {}, 0, 3),  # half a second before the cube lands among the rest
        (STUDY, collapse(6, 5, 3), {}, 3, 3),  # which counts them all the same
        (TASK, collapse(3), AWAY, 1, 1),  # one falls by itself, one is pushed by the thrown cube
        *((TASK, [Mishap(phase, 0.1, move("pyramid_1", y=-0.1))], {}, 0, 1)  # by the arm
          for phase in ("pick", "wind up", "settle")),
        # pushed a little, and creeps on to 6 cm: the throw's doing where that is most of the way
        *((LONG, creep(0.06 - push), {"pyramid_6": (0.0, push, 0.0)}, moved, 1 - moved)
          for push, moved in ((0.02, 0), (0.028, 0), (0.032, 1), (0.049, 1))),
        (LONG, creep(0.04), {"pyramid_6": (0.0, 0.02, 0.0), "pyramid_4": (0.0, -0.1, 0.0)}, 1, 1),
        (LONG, creep(0.2), {"pyramid_6": (0.0, 0.06, 0.0)}, 1, 0),  # pushed away, and creeps on
        (LONG, creep(0.07), {"pyramid_6": (0.0, 0.01, 0.06)}, 0, 1),  # lifted, and creeps away
        (TASK, [Mishap("settle", 2.0, move("pyramid_6", x=-0.08))], AWAY, 0, 0),  # and back
        (Throwing(settle=0.01), [], AWAY, 1, 0),  # at once, after a wait too short for a sample
        (TASK, [Mishap("settle start", 0.9, move("pyramid_1", y=-0.2))], {}, 0, 0),  # it settles
    ],
)  # fmt: skip
def test_which_cubes_count(
    task: Throwing, script: list[Mishap], pushed: dict[str, Any], moved: int, otherwise: int
) -> None:
    outcome, _ = thrown(*script, task=task, pushed=pushed)
    hit = float(moved > 0)
    assert values(outcome) == {"moved": moved / 6, "hit": hit, "moved_otherwise": otherwise}


def test_it_is_counted_a_minute_after() -> None:
    outcome, process = thrown(Mishap("settle", 59.9, move("pyramid_1", y=-0.1)), task=IN_FULL)
    assert outcome.metrics["moved_otherwise"] == 1.0
    assert outcome.details["moved_otherwise"] == ["pyramid_1"]
    settle = [asked for asked in process.asked if asked.phase == "settle"]
    assert sum(asked.duration for asked in settle) == pytest.approx(60.0)


def test_the_wait_ends_when_no_count_can_change_any_more() -> None:
    """Not while what the throw pushed creeps on: in the end it came farther by itself."""
    outcome, _ = thrown(task=Throwing(), pushed=AWAY)
    assert outcome.wait == Wait(2.0, 60.0, "support of projectile", 1e-6, pytest.approx(0.002))
    creeping = [Mishap("settle", k / 4, move("pyramid_6", y=0.0003)) for k in range(200)]
    pushed = {"pyramid_6": (0.055, 0.04, 0.0)}
    for task, push in product((Throwing(), IN_FULL), ({"pyramid_6": (0.0, 0.028, 0.0)}, pushed)):
        outcome, _ = thrown(*creeping, task=task, pushed=push)
        assert outcome.metrics["moved"] == (1 / 6 if push is pushed else 0.0)
        assert outcome.metrics["moved_otherwise"] == (0.0 if push is pushed else 1.0)
        assert getattr(outcome.wait, "seconds", 0.0) > 50.0


def test_the_integrators_part_is_apart() -> None:
    """Euler's steps make a flight fall g dt / 2 per second too far; the release is as it was."""
    exact, _ = thrown(late=0.04)
    outcome, _ = thrown(late=0.04, drop=9.80665 * 0.004 / 2)
    for name in ("landing_x", "landing_error"):
        assert outcome.metrics[name] == pytest.approx(exact.metrics[name], abs=1e-9)
    flown = outcome.details["flight_landing_x"]
    assert outcome.metrics["flight_error"] == pytest.approx(
        abs(flown - outcome.metrics["landing_x"]), abs=1e-12
    )
    # 0.46 s of flight: 9 mm too low, at 4.9 m/s down and 2.7 m/s forwards 5 mm too short
    assert flown - outcome.metrics["landing_x"] == pytest.approx(-0.0051, abs=0.0006)
