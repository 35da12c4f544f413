"""What random perturbations leave, and how a displacement grows."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from pytest_simbench.repeatability.episode import Experiment
from pytest_simbench.repeatability.perturbation import Perturbation
from pytest_simbench.repeatability.stability import Sensitivity, sensitivity, stability


def test_within_the_margin_all_is_kept(towers: Callable[..., Experiment]) -> None:
    result = stability(towers(), {"x": 0.001, "mass": 0.05}, examples=8)
    assert list(result.kept) == [1.0] * 8
    assert (result.unchanged, result.worst) == (8, "")
    assert result.sentence == (
        "kept 100 % [68, 100] within 1 mm in x, 5 % in mass; the same outcome in 8 of 8"
    )
    result.assert_kept_at_least(0.9)


def test_beyond_it_towers_fall(towers: Callable[..., Experiment]) -> None:
    result = stability(towers(margin=0.003), {"x": 0.012}, examples=20)
    assert 0 < result.unchanged < 20
    assert min(result.kept) == 0.0
    assert result.worst.endswith("topples tower 1")
    assert result.share.high < 0.9
    with pytest.raises(AssertionError, match="mujoco: at least 90 % should be kept, but kept"):
        result.assert_kept_at_least(0.9)


def test_a_crash_keeps_nothing(towers: Callable[..., Experiment]) -> None:
    result = stability(towers("Brittle"), {"friction": 0.2}, examples=10)
    assert set(result.kept) == {0.0, 1.0}
    assert "ends in WorkerExited" in result.worst


def test_a_tower_that_stands_keeps_the_displacement(towers: Callable[..., Experiment]) -> None:
    """Nothing slides and nothing falls: a millimetre stays a millimetre."""
    result = sensitivity(towers(margin=0.015), Perturbation("x", 5, "cube_04"))
    assert result.ratio[0.1] == pytest.approx(1.0, abs=0.1)
    assert result.ratio[1.0] == pytest.approx(1.0, abs=0.1)
    assert result.ratio[20.0] is None
    result.assert_below(1.2, until=1.0)


def test_falling_cubes_part(tumbling: Callable[..., Experiment]) -> None:
    result = sensitivity(tumbling(), Perturbation("x", 1, "cube_1"))
    assert result.ratio[0.1] == pytest.approx(1.0, abs=0.3)
    assert result.largest > 3
    with pytest.raises(AssertionError, match="mm per mm after 0.1 mm in x of cube_1.*below 0.5"):
        result.assert_below(0.5, until=1.0)


def test_later_times_are_not_judged() -> None:
    grown = Sensitivity("x", "0.1 mm in x of a", {0.1: 1.0, 5.0: 400.0, 20.0: None}, 400.0)
    grown.assert_below(2.0, until=1.0)
    with pytest.raises(AssertionError, match="expected below 2 until 5 s"):
        grown.assert_below(2.0, until=5.0)


def test_only_displacements(towers: Callable[..., Experiment]) -> None:
    with pytest.raises(ValueError, match="per millimetre, not for 1 % in the mass of cube_01"):
        sensitivity(towers(), Perturbation("mass", 1, "cube_01"))
