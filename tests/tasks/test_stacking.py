"""Scores of stacking where the right one is known: neither nothing nor all."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any
from unittest.mock import ANY

import numpy as np
import pytest

from pytest_simbench.client.errors import Diverged, RepetitionTimeout
from pytest_simbench.records.notes import Wait
from pytest_simbench.scene import Pose
from pytest_simbench.tasks import Jitter, Stacking
from pytest_simbench.tasks.stacking import Place, _placed, _strict, _strictly
from tests.tasks.scripted import (
    Mishap,
    ScriptedProcess,
    drop,
    fail,
    move,
    perform,
    put,
    stacked,
    untouched,
)

ONE = Stacking(towers=1, levels=1)
ONE_IN_FULL = replace(ONE, full_wait=True)
SCORES = (
    *("placed", "at_end", "placed_strict", "at_end_strict"),
    *("towers", "untouched_moved", "failed_picks"),
)
PLACE, AXES = Place(0, 1, Pose()), np.eye(3)


def sized(task: Stacking, scale: float) -> Stacking:
    """The task in a scene of another size, which a smaller arm would have."""
    vars(task)["scale"] = scale
    return task


def score(task: Stacking, *script: Mishap, **options: Any) -> dict[str, float | None]:
    return perform(task, *script, **options)[0].metrics


@pytest.mark.parametrize("scale", [1.0, 0.9])
def test_every_score_of_a_world_with_one_of_everything(scale: float) -> None:
    """No two scores are the same, so none can stand for another. So it is in a smaller scene."""
    s = scale
    outcome, process = perform(
        sized(Stacking(towers=2, levels=3, full_wait=True), s),
        Mishap("pick cube 2 of 6", 2.6, drop),  # lost while it is lifted
        Mishap("check cube 4 of 6", 0.05, move(stacked(5), x=0.012 * s)),  # in place, not strictly
        Mishap("check cube 6 of 6", 0.05, move(stacked(7), y=0.06 * s, z=-0.1 * s)),  # fallen
        Mishap("settle", 30.0, move(stacked(6), x=0.1 * s, z=-0.025 * s, tilt=0.05)),  # later
        Mishap("settle", 59.9, move(untouched(1), x=-0.008 * s, y=-0.008 * s)),  # by 11 mm
        Mishap("settle", 59.9, move(untouched(2), x=-0.009 * s)),
        Mishap("settle", 59.9, move(untouched(3), z=0.0105 * s)),
        process=ScriptedProcess(scale=s),
    )
    assert outcome.metrics == {
        "placed": 5 / 6,
        "at_end": 4 / 6,
        "placed_strict": 4 / 6,
        "at_end_strict": 3 / 6,
        "towers": 1 / 2,
        "untouched_moved": 2.0,
        "failed_picks": 1.0,
    }
    order = [name for name, _ in process.released]
    lost = order.pop(1)
    picks = outcome.details["picks"]
    assert [(pick["cube"], pick["tower"], pick["level"]) for pick in picks] == [
        *((order[0], 0, 0), (order[1], 0, 1), (order[2], 0, 2)),
        *((order[3], 1, 0), (order[4], 1, 1), (order[5], 1, 2)),
    ]
    assert picks[3]["placed_error"] == pytest.approx([0.012 * s, 0, 0, 0], abs=1e-5)
    assert picks[3]["end_error"] == picks[3]["placed_error"]
    assert picks[4]["placed_error"] == pytest.approx([0, 0, 0, 0], abs=1e-5)
    assert picks[4]["end_error"] == pytest.approx([0.1 * s, 0, -0.025 * s, 0.05], abs=1e-5)
    assert picks[5]["placed_error"] == pytest.approx([0, 0.06 * s, -0.1 * s, 0], abs=1e-5)
    assert outcome.details["failed_picks"] == [
        {"cube": lost, "tower": 0, "level": 1, "reason": f"{lost} is not in the hand"}
    ]
    knocked, lifted = untouched(1)(process), untouched(3)(process)
    assert outcome.details["untouched_moved"] == pytest.approx(
        {knocked: 0.008 * s * math.sqrt(2), lifted: 0.0105 * s}
    )
    assert outcome.details["notes"] == []
    assert process.counts == [(number, 6) for number in range(1, 7)]


@pytest.mark.parametrize(
    ("task", "phase", "after", "placed"),
    [
        (ONE, "check cube 1 of 1", 0.12, 0.0),  # 0.496 s after the release
        (ONE, "retreat cube 1 of 1", 0.004, 1.0),
        (ONE, "go home", 0.1, 1.0),
        (ONE_IN_FULL, "settle", 59.99, 1.0),
        (ONE.study(), "retreat cube 1 of 1", 0.3, 0.0),  # the study counts after the retreat
        (ONE.study(), "check cube 1 of 1", 0.49, 0.0),
        (ONE.study(), "go home", 0.0, 1.0),
    ],
)
def test_placed_is_counted_half_a_second_after_the_release_and_the_end_at_the_end(
    task: Stacking, phase: str, after: float, placed: float
) -> None:
    found = score(task, Mishap(phase, after, move(stacked(1), x=0.2)))
    assert (found["placed"], found["placed_strict"]) == (placed, placed)
    assert (found["at_end"], found["at_end_strict"], found["towers"]) == (0.0,) * 3


def test_a_cube_that_comes_back_is_counted_where_it_was_and_where_it_is() -> None:
    found = score(
        ONE,
        Mishap("check cube 1 of 1", 0.1, move(stacked(1), x=0.2)),
        Mishap("settle", 1.0, move(stacked(1), x=-0.2)),
    )
    assert [found[name] for name in SCORES[:5]] == [0.0, 1.0, 0.0, 1.0, 1.0]


def test_the_shares_are_of_all_places_also_of_those_never_filled() -> None:
    """With 19 of 21 cubes out of reach, two are stacked and two places stay empty."""
    away = [
        Mishap("settle start", 0.1, put(f"cube_{k:02d}", Pose.at(-2.0, 0.15 * k, 0.025)))
        for k in range(1, 20)
    ]
    outcome, process = perform(Stacking(towers=2, levels=2), *away)
    assert [outcome.metrics[name] for name in SCORES] == [0.5, 0.5, 0.5, 0.5, 0.5, 0.0, 19.0]
    assert {pick["cube"] for pick in outcome.details["picks"]} == {"cube_20", "cube_21"}
    failed = outcome.details["failed_picks"]
    assert {pick["cube"] for pick in failed} == {f"cube_{k:02d}" for k in range(1, 20)}
    assert all(pick["reason"].startswith("unreachable: tool at (-2.000") for pick in failed)
    assert process.counts[-1] == (2, 4)


def test_a_tower_is_complete_with_all_of_its_cubes_strictly_in_place() -> None:
    for number, by, complete in ((1, 0.009, 1.0), (1, 0.011, 0.5), (4, -0.011, 0.5)):
        task, off = Stacking(towers=2, levels=2), move(stacked(number), x=by)
        found = score(task, Mishap("settle", 1.0, off))
        assert (found["towers"], found["at_end"]) == (complete, 1.0)


@pytest.mark.parametrize(
    ("pose", "placed", "strict"),
    [
        (Pose.at(0.01, -0.01, 0.01), True, True),  # the bounds belong to it
        *((Pose.at(*at), True, False) for at in (*0.0101 * AXES, *-0.0101 * AXES)),
        (Pose.at(0.05, -0.05, 0.0), True, False),
        *((Pose.at(*at), False, False) for at in (*0.0501 * AXES[:2], *-0.0501 * AXES[:2])),
        (Pose.at(0.0, 0.0, -0.3), True, False),
        *((Pose(quaternion=q), True, s) for q, s in (
            ((math.cos(math.radians(2.45)), math.sin(math.radians(2.45)), 0.0, 0.0), True),
            ((math.cos(math.radians(2.55)), math.sin(math.radians(2.55)), 0.0, 0.0), False),
            ((math.cos(math.radians(2.55)), 0.0, -math.sin(math.radians(2.55)), 0.0), False),
            ((math.cos(math.radians(45)), math.sin(math.radians(45)), 0.0, 0.0), True),
            ((math.cos(math.radians(20)), 0.0, 0.0, math.sin(math.radians(20))), True),
        )),
    ],
)  # fmt: skip
def test_in_its_place_and_strictly_so(pose: Pose, placed: bool, strict: bool) -> None:
    """5 cm in x and in y; 1 cm in x, y and z and 5 degrees, whatever face it lies on."""
    assert (_placed(PLACE, pose), _strict(PLACE, pose)) == (placed, strict)


def test_how_far_a_corner_is_from_leaving_what_is_strictly_the_place() -> None:
    """By a shift, or by one of the 5 degrees, half a space diagonal from the middle."""
    half = math.radians(4) / 2
    leaning = Pose((0.001, 0.0, 0.0), (math.cos(half), math.sin(half), 0.0, 0.0))
    for scale in (1.0, 0.5):
        found = _strictly(PLACE, leaning, scale)
        assert found == pytest.approx(math.radians(1) * math.sqrt(3) * 0.025 * scale)
        assert _strictly(PLACE, Pose.at(0.0, 0.004, 0.0), scale) == pytest.approx(
            min(0.01 * scale - 0.004, math.radians(5) * math.sqrt(3) * 0.025 * scale)
        )


def test_the_wait_ends_when_no_count_can_change_any_more() -> None:
    """What creeps towards the end of its place keeps it running, as does an untouched cube."""
    outcome, _ = perform(ONE)
    assert outcome.wait == Wait(2.0, 60.0, "support of cube_01", 1e-6, pytest.approx(0.002))
    for cube in (stacked(1), untouched(1)):
        creep = [Mishap("settle", k / 4, move(cube, x=0.00008)) for k in range(200)]
        short, full = (perform(task, *creep)[0] for task in (ONE, ONE_IN_FULL))
        assert short.metrics == full.metrics != outcome.metrics
        assert short.wait == Wait(pytest.approx(51.0), 60.0, ANY, ANY, ANY)
        assert full.wait == Wait(pytest.approx(60.0), 60.0)


@pytest.mark.parametrize(
    ("offset", "moved"),
    [
        ({"x": 0.0099}, 0.0), ({"x": -0.0101}, 1.0), ({"y": 0.0101}, 1.0), ({"z": 0.0101}, 1.0),
        ({"x": 0.006, "y": 0.006, "z": 0.006}, 1.0), ({"x": 0.005, "y": 0.005, "z": 0.005}, 0.0),
        ({"y": 0.01}, 0.0), ({"y": math.nextafter(0.01, 1.0)}, 1.0),
    ],
)  # fmt: skip
def test_untouched_cubes_moved_by_more_than_1_cm(offset: dict[str, float], moved: float) -> None:
    knock = Mishap("settle", 1.0, move("cube_18", **offset))  # which stands at y = 0
    outcome, _ = perform(ONE, knock, jitter=Jitter(0.0, 0.0))
    assert outcome.metrics["untouched_moved"] == moved
    assert outcome.metrics["placed"] == outcome.metrics["at_end"] == 1.0
    assert set(outcome.details["untouched_moved"]) == ({"cube_18"} if moved else set())


def test_untouched_is_measured_from_when_the_cubes_had_settled() -> None:
    early = Mishap("settle start", 0.19, move("cube_01", x=-0.02))
    assert score(ONE, early)["untouched_moved"] == 0.0
    assert score(ONE, early, Mishap("go home", 0.0, move("cube_02", y=0.02))) == {
        **score(ONE), "untouched_moved": 1.0
    }  # fmt: skip


def test_a_cube_that_was_handled_is_not_untouched() -> None:
    """Lost while lifted, lost on the way, put in its place: wherever they end, a hand was there."""
    outcome, process = perform(
        Stacking(towers=1, levels=1),
        Mishap("pick cube 1 of 1", 2.5, drop),
        Mishap("recover from cube 1 of 1", 0.0, move(stacked(1), x=-0.02)),
        Mishap("settle", 1.0, move(stacked(2), z=0.02)),
    )
    assert len(process.released) == 2
    assert [outcome.metrics[name] for name in ("untouched_moved", "failed_picks")] == [0.0, 1.0]
    on_the_way, process = perform(ONE, Mishap("place cube 1 of 1", 0.7, drop))
    assert [on_the_way.metrics[name] for name in ("untouched_moved", "failed_picks")] == [0.0, 1.0]
    lost = process.released[0][0]
    assert on_the_way.details["failed_picks"][0]["reason"] == f"{lost} is not in the hand"
    assert on_the_way.metrics["placed"] == 1.0  # by the next cube


def test_a_cube_that_the_hand_cannot_lift_was_handled() -> None:
    """Something comes to hang over the closed hand, which puts the cube back."""
    first = perform(ONE, says=False)[1].released[0][0]
    above = ONE.scene(1, Jitter()).body(first).pose.translated(z=0.195)
    outcome, _ = perform(
        ONE,
        Mishap("pick cube 1 of 1", 2.0, put("cube_21", above)),
        Mishap("recover from cube 1 of 1", 0.0, put("cube_21", Pose.at(0.8, 0.3, 0.325))),
        Mishap("settle", 1.0, move(first, x=-0.02)),
        says=False,
    )
    assert "blocked" in outcome.reasons[0]
    assert set(outcome.details["untouched_moved"]) == {"cube_21"}


def test_a_cube_out_of_reach_stays_untouched() -> None:
    """Nobody handled it, so it counts when it moves."""
    first = perform(ONE)[1].released[0][0]
    outcome, _ = perform(
        ONE,
        Mishap("settle start", 0.1, put(first, Pose.at(-2.0, 0.0, 0.025))),
        Mishap("settle", 1.0, move(first, x=0.02)),
    )
    assert [pick["cube"] for pick in outcome.details["failed_picks"]] == [first]
    assert outcome.details["untouched_moved"] == pytest.approx({first: 0.02})


def test_a_cube_that_cannot_be_placed_is_put_back() -> None:
    """Its place is blocked: it goes back where it came from, and the next cube is taken."""
    blocked = put("cube_21", Pose.at(0.5, -0.2, 0.326))
    first = perform(ONE)[1].released[0][0]
    assert first != "cube_21"
    outcome, process = perform(
        ONE,
        Mishap("pick cube 1 of 1", 2.6, blocked),
        Mishap("recover from cube 1 of 1", 0.1, put("cube_21", Pose.at(0.8, 0.3, 0.325))),
    )
    assert process.released[0][0] == first
    (failed,) = outcome.details["failed_picks"]
    assert (failed["cube"], failed["tower"], failed["level"]) == (first, 0, 0)
    assert failed["reason"].startswith("in collision: ")
    assert outcome.metrics["failed_picks"] == 1.0
    assert outcome.metrics["placed"] == 1.0
    assert outcome.metrics["untouched_moved"] == 1.0  # the one that blocked
    origin = ONE.scene(1, Jitter()).body(first).pose
    let_go, back = process.released[0][1], process.poses[first]
    assert np.subtract(let_go.position, origin.position) == pytest.approx([0, 0, 0.005], abs=1e-5)
    assert np.subtract(back.position, origin.position) == pytest.approx([0, 0, 0], abs=1e-5)


def test_what_could_not_be_done_on_the_way_is_noted() -> None:
    """Something hangs over the hand: no retreat, no way home; the score is the cubes'."""
    above = put("cube_01", Pose.at(0.5, -0.2, 0.52))
    outcome, _ = perform(ONE, Mishap("check cube 1 of 1", 0.1, above), seed=1)
    assert [note.split(":")[0] for note in outcome.details["notes"]] == [
        "could not retreat", "could not go home",
    ]  # fmt: skip
    assert outcome.metrics["placed"] == 1.0


@pytest.mark.parametrize("error", [RepetitionTimeout, Diverged])
@pytest.mark.parametrize("phase", ["settle start", "pick cube 2 of 2", "settle"])
def test_a_world_that_fails_has_no_score(error: type[Exception], phase: str) -> None:
    with pytest.raises(error):
        perform(Stacking(towers=1, levels=2), Mishap(phase, 0.1, fail(error)))
