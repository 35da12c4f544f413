"""Headless against GUI: equivalence is claimed when the data show it, and only then."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_simbench.measure.modes import MARGIN, ModeComparison, compare_modes
from pytest_simbench.records.record import Record
from pytest_simbench.tasks.metrics import Metric

PLACED = Metric("placed", "placed", kind="share", of=15, better="higher", study=True)


def record(mode: str, seed: int, placed: float) -> Record:
    return Record(
        test=f"suites/test_stacking.py::test_stacking[mujoco-{mode}]",
        task="stacking",
        simulator="mujoco",
        mode=mode,
        profile="tuned",
        repetition=seed,
        seed=seed,
        status="ok",
        metrics={"placed": placed},
    )


def compared(headless: list[float], gui: list[float]) -> ModeComparison:
    records = [record("headless", k, value) for k, value in enumerate(headless)]
    records += [record("gui", k, value) for k, value in enumerate(gui)]
    (found,) = compare_modes(records, [PLACED])
    return found


def test_bit_identical_modes_are_the_same() -> None:
    found = compared([1.0, 0.8, 1.0], [1.0, 0.8, 1.0])
    assert "the same within 5 points (gui +0 points, 3 common seeds)" in found.sentence


def test_a_clear_difference_is_not_called_the_same() -> None:
    found = compared([1.0, 0.9, 1.0, 0.95] * 5, [0.8, 0.7, 0.8, 0.75] * 5)
    assert "not shown to be the same within 5 points (gui -20 points" in found.sentence


def test_one_common_seed_is_too_few() -> None:
    assert "too few common seeds" in compared([1.0], [1.0, 0.9]).sentence


def test_a_single_mode_is_not_compared() -> None:
    assert compare_modes([record("headless", k, 1.0) for k in range(5)], [PLACED]) == []


@pytest.mark.parametrize(("true", "low", "high"), [(0.0, 0.8, 1.0), (MARGIN, 0.0, 0.09)])
def test_error_rates(true: float, low: float, high: float) -> None:
    """Equal modes are mostly found equal; modes that differ by the margin at most once in 20."""
    rng = np.random.default_rng(7)
    claims = 0
    for _ in range(300):
        headless = rng.normal(0.8, 0.05, 20)
        result = compared(list(headless), list(headless - true + rng.normal(0, 0.05, 20))).result
        assert result is not None
        claims += result.equivalent()
    assert low <= claims / 300 <= high
