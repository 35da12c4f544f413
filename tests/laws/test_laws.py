"""Every law can be kept, and a planted fault breaks it; on a real engine."""

from __future__ import annotations

import csv
import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.client.environments import missing
from pytest_simbench.laws import LAWS, Law, Reading
from pytest_simbench.laws.base import Watched
from pytest_simbench.laws.hands import PushTurns
from pytest_simbench.laws.impact import RADIUS, BounceHeight
from pytest_simbench.laws.mechanisms import MOUNT, Part, mechanism
from pytest_simbench.laws.sticking import fan
from pytest_simbench.measure.phenomena import BROKEN, KEPT
from pytest_simbench.records.phenomena import PHENOMENA, PHENOMENON
from pytest_simbench.scene import Scene
from pytest_simbench.simulator import PreparedRobot
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks.base import Jitter, Outcome
from pytest_simbench.testing.subject import Subject
from tests.approval import assert_approved_line

from .faults import FAULTS

ELSEWHERE = {
    **dict.fromkeys(
        (
            "carried", "slide_x", "slide_y", "slide_diagonal", "slide_straight", "belt",
            "push_tips",
        ),
        "pybullet",
    ),
    **dict.fromkeys(("dead_collision", "push_force"), "ode"),
    "push_turns": "dart",
    **dict.fromkeys(("grip_holds", "heavy_on_top"), "ode"),
    **dict.fromkeys(("bounce_height", "oblique_bounce_slip", "oblique_bounce_stick"), "ode"),
}  # fmt: skip
"""Laws that tuned MuJoCo does not keep, and who does."""

BY_NAME = {law.name: law for law in LAWS}

TRUTH = Path(__file__).parents[2] / "docs" / "data" / "truth.csv"

with TRUTH.open(encoding="utf-8") as file:
    PUBLISHED = {
        (row["law"], row["simulator"]): float(row["tolerance"])
        for row in csv.DictReader(file)
        if row["profile"] == "tuned" and row["tolerance"]
    }
"""What each law allows each engine at its time step, as docs/truth.md tells."""

SHORT = {
    "tumble_energy_drift": 0.2867,
    "tumble_momentum_drift": 0.2864,
    "pendulum_energy_drift": 0.00924,
}
"""The same of the short versions, at 1 ms."""


def outcome(law: Law, scene: Scene) -> Outcome:
    engine = adapter(ELSEWHERE.get(law.name, "mujoco"))
    if absent := missing(engine.info):
        pytest.skip(absent)
    subject = Subject(engine)
    with subject.world(scene) as world:
        return law.smoke().perform(world, 0, lambda done, total: None)


@pytest.mark.parametrize("name", BY_NAME)
def test_a_law_is_kept_and_a_planted_fault_breaks_it(name: str) -> None:
    law = BY_NAME[name]
    kept = outcome(law, law.build())
    broken = outcome(law, FAULTS[name](law.build()))
    assert kept.reading is not None
    assert kept.metrics["ratio"] <= KEPT, kept.reading
    assert broken.metrics["ratio"] > BROKEN, broken.reading
    allowed = SHORT.get(name) or PUBLISHED[name, ELSEWHERE.get(name, "mujoco")]
    assert kept.reading.tolerance == pytest.approx(allowed, rel=0.01)
    exact = round(kept.reading.exact, 6) + 0.0
    assert_approved_line("exact", f"{name}: {exact:.4g} {law.unit}")


def test_there_are_enough_and_each_phenomenon_has_one() -> None:
    assert len(LAWS) >= 30
    assert len(BY_NAME) == len(LAWS)
    assert {law.phenomenon for law in LAWS} == set(PHENOMENA)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_a_law_says_where_it_comes_from_and_what_it_allows(law: Law) -> None:
    told = type(law).__doc__ or ""
    assert "Tolerance" in told or re.search(r"The same", told)
    assert law.scene(1, Jitter()) == law.scene(2, Jitter(0.0, 0.0))
    assert law.parameters()[PHENOMENON] == law.phenomenon
    assert {f"task.{item.name}" for item in fields(law)} < law.parameters().keys()  # type: ignore[arg-type]


def test_columns_are_read_between_samples() -> None:
    t, none = np.array([0.1, 0.2]), np.empty((2, 0))
    seen = Watched(0.1, t, none, none, none)
    values = np.array([[0.0, 10.0], [1.0, 30.0]])
    assert seen.at(0.15, values) == pytest.approx([0.5, 20.0])
    assert seen.at(0.15, values[:, 1]) == pytest.approx(20.0)


def test_a_level_is_crossed_upwards_once_where_a_sample_lies_on_it() -> None:
    t, none = np.array([1.0, 2.0, 4.0, 5.0, 7.0, 8.0]), np.empty((6, 0))
    values = np.array([1.0, 5.0, 6.0, 2.0, 10.0, 3.0])
    seen = Watched(1.0, t, none, none, none)
    assert seen.crossings(values, 5.0).tolist() == [2.0, 5.75]


@pytest.mark.parametrize(
    ("heights", "found"), [((9, 1, 7, 3, 2), (7, 3)), ((9, 1, 2, 8, 4), (2, 8))]
)
def test_each_bounce_is_looked_for_in_its_time(
    heights: tuple[float, ...], found: tuple[float, float]
) -> None:
    """The first one from the landing on, for a time of two e of the fall, which is one here."""
    law, bodies = BounceHeight(restitution=0.5, height=0.2), np.zeros((5, 1, 13))
    bodies[:, 0, 2] = np.array(heights) / 10 + RADIUS
    t = law.fall * np.array([0.99, 1.01, 1.99, 2.01, 3.5])
    seen = Watched(0.1, t, np.empty((5, 0)), bodies, bodies[0])
    assert law.rises(seen) == pytest.approx(np.divide(found, 10))


def test_a_reading_is_an_error_and_its_ratio_to_the_tolerance() -> None:
    reading = Reading(value=1.2, exact=1.0, tolerance=0.1)
    assert reading.error == pytest.approx(0.2)
    assert reading.ratio == pytest.approx(2.0)


@pytest.mark.parametrize(
    "numbers", [(float("nan"), 0.0, 1.0), (0.0, float("inf"), 1.0), (0.0, 0.0, 0.0)]
)
def test_what_cannot_be_read_is_an_error(numbers: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="nothing can be read"):
        Reading(*numbers)


Y = (0.0, 1.0, 0.0)


def test_parts_hang_on_the_one_before_or_on_a_named_one() -> None:
    parts = Part("a", Y), Part("b", Y), Part("c", Y, on="a"), Part("d", Y, on=MOUNT)
    joints = PreparedRobot(mechanism("tree", *parts)).joints
    above = {joint.name: joint.parent for joint in joints}
    assert above == {"a": "base", "b": "a link", "c": "a link", "d": "base"}


def test_a_part_that_hangs_on_none_there_is_is_refused() -> None:
    with pytest.raises(ValueError, match="'a' hangs on 'b'; choose from mount"):
        mechanism("tree", Part("a", Y, on="b"), Part("b", Y))


def test_a_pushed_prism_turns_as_its_acceleration_says() -> None:
    """Rate and acceleration are the derivatives of the angle."""
    seconds = PushTurns().seconds
    angle, rate, pulled = PushTurns().exact(seconds)
    times = np.linspace(0.0, seconds, angle.size)
    for value, change in ((angle, rate), (rate, pulled)):
        off = np.abs(np.gradient(value, times) - change)[1:-1]
        assert off.max() < 0.02 * np.abs(change).max()


def test_a_short_run_of_a_long_pendulum_has_four_periods() -> None:
    law = BY_NAME["pendulum_energy_drift"]
    assert law.smoke().seconds == pytest.approx(law.seconds / 25)


@pytest.mark.parametrize(
    ("moved", "found"),
    [("000111", 1.0), ("000000", 1.08), ("111111", 0.92), ("011111", 0.94),
     ("001011", 0.97), ("011011", 0.94), ("000101", 1.06), ("101111", 0.92)],
)  # fmt: skip
def test_a_fan_whose_cases_contradict_each_other_is_off(moved: str, found: float) -> None:
    reading = fan(2.0, [case == "1" for case in moved])
    assert reading.value == pytest.approx(2 * found)
