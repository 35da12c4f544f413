"""Where two episodes part."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.client.motion import Motion
from pytest_simbench.records.repeatability import StateDifference
from pytest_simbench.repeatability.motions import _first_difference, difference, gaps

NAMES = ("a", "b")


def circling(step: float, operations: tuple[float, ...] = (0.5, 0.7), radius: float = 0.3):
    """Two cubes going round, sampled at `step` [s]; operations last a whole number of steps."""

    def motion(time: np.ndarray) -> Motion:
        bodies = np.zeros((len(time), 2, 13))
        for body, speed in enumerate((1.0, 4.0)):
            angle = speed * time
            bodies[:, body, 0], bodies[:, body, 1] = radius * np.cos(angle), radius * np.sin(angle)
            bodies[:, body, 3] = 1.0
            bodies[:, body, 7] = -radius * speed * np.sin(angle)
            bodies[:, body, 8] = radius * speed * np.cos(angle)
        return Motion(time, np.zeros((len(time), 2, 3)), bodies)

    motions, start = [motion(np.zeros(1))], 0.0
    for duration in operations:
        steps = round(duration / step)
        motions.append(motion(start + step * np.arange(1, steps + 1)))
        start += steps * step
    return motions


def test_equal_episodes_do_not_differ() -> None:
    assert difference(circling(0.02), circling(0.02), NAMES) == StateDifference()
    assert gaps(circling(0.02), circling(0.02)).largest().max() == 0


@given(
    operation=st.integers(0, 2),
    sample=st.integers(0, 30),
    body=st.integers(0, 1),
    column=st.integers(0, 12),
)
def test_the_last_bit_of_any_sample_is_found(
    operation: int, sample: int, body: int, column: int
) -> None:
    first, second = circling(0.02), circling(0.02)
    sample = min(sample, len(second[operation]) - 1)
    values = second[operation].bodies
    values[sample, body, column] = np.nextafter(values[sample, body, column], math.inf)
    found = difference(first, second, NAMES)
    assert found.first == first[operation].time[sample]
    assert found.body == NAMES[body]
    assert found.largest < 1e-12


@pytest.mark.parametrize("bit", [1e-300, -0.0])
def test_a_joint_that_differs_is_the_robots(bit: float) -> None:
    second = circling(0.02)
    second[1].joints[0, 0, 1] = bit
    found = difference(circling(0.02), second, NAMES)
    assert (found.first, found.body, found.largest) == (pytest.approx(0.02), "", 0.0)


def test_growth_is_told_from_the_first_difference_on() -> None:
    first, second = (circling(0.02, (2.0, 20.0)) for _ in range(2))
    second[2].bodies[:, 1, 2] += 0.001 * (second[2].time - 2.0)  # 1 mm for each second
    found = difference(first, second, NAMES)
    assert found.first == pytest.approx(2.02)
    assert found.growth == {"1": pytest.approx(0.00102), "5": pytest.approx(0.00502), "20": None}
    assert found.largest == pytest.approx(0.02)


@given(step=st.floats(0.001, 0.025))
def test_other_steps_make_no_gap(step: float) -> None:
    """The same motion in another simulator: samples at other times, operations that last up to
    half a step longer or shorter. Each operation has its own clock, but a circle goes on, so
    what remains of that is speed times half a step."""
    between = gaps(circling(0.002, (0.5,)), circling(step, (0.5,)))
    assert between.largest().max() < 1e-5
    assert len(between.time) >= 0.5 / 0.002 - step / 0.002


def test_where_an_episode_ends_or_changes_its_cubes() -> None:
    """Told by the time of the last sample that both have."""
    long, short = circling(0.1, (0.5, 0.7, 0.2)), circling(0.1, (0.5, 0.7))
    for first, second in ((long, short), (short, long)):
        found = difference(first, second, NAMES)
        assert (found.first, found.body) == (pytest.approx(1.2), "")
    other = circling(0.1)
    other[2] = Motion(other[2].time, other[2].joints, other[2].bodies[:, :1])
    assert _first_difference(circling(0.1), other) == (pytest.approx(0.5), None)
    other[0] = Motion(other[0].time, other[0].joints, other[0].bodies[:, :1])
    assert _first_difference(circling(0.1), other) == (0.0, None)
