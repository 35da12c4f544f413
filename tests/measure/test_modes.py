"""Headless against GUI: equivalence is claimed when the data show it, and only then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pytest_simbench.measure.modes import MARGIN, compare_modes
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record
from tests.records import build

PLACED = Metric("placed", "placed", kind="share", of=15, better="higher", study=True)


def record(mode: str, seed: int, placed: float) -> Record:
    test = f"suites/test_stacking.py::test_stacking[mujoco-{mode}]"
    given = {"test": test, "simulator": "mujoco", "mode": mode, "seed": seed}
    return build.record(seed, metrics={"placed": placed}, **given)


def compared(headless: list[float], gui: list[float]) -> str:
    records = [record("headless", k, value) for k, value in enumerate(headless)]
    records += [record("gui", k, value) for k, value in enumerate(gui)]
    (found,) = compare_modes(records, [PLACED])
    return found


def test_bit_identical_modes_are_the_same() -> None:
    """As many as bound a loss that was never seen below the margin."""
    found = compared([1.0, 0.8, 1.0] * 24, [1.0, 0.8, 1.0] * 24)
    assert "the same within 5 points (gui +0 points, 72 common seeds)" in found


def test_a_single_mode_is_not_compared() -> None:
    assert compare_modes([record("headless", k, 1.0) for k in range(5)], [PLACED]) == []


@pytest.mark.parametrize(("true", "low", "high"), [(0.0, 0.8, 1.0), (MARGIN, 0.0, 0.09)])
def test_error_rates(true: float, low: float, high: float) -> None:
    """Equal modes are mostly found equal; modes that differ by the margin at most once in 20."""
    rng = np.random.default_rng(7)
    claims = 0
    for _ in range(300):
        headless = rng.normal(0.8, 0.05, 200)
        told = compared(list(headless), list(headless - true + rng.normal(0, 0.05, 200)))
        claims += ": the same within 5 points (" in told
    assert low <= claims / 300 <= high


def test_each_sentence_word_by_word() -> None:
    name = "mujoco, headless and gui, placed"
    assert compared([1.0, 0.8, 1.0], [1.0, 0.8, 1.0]) == (
        f"{name}: gui +0 points, 3 common seeds; the same within 5 points takes 72 or more."
    )
    headless, gui = [1.0, 0.5, 0.75, 0.5], [0.75, 0.5, 0.5, 0.25]
    assert compared(headless, gui) == (
        f"{name}: not shown to be the same within 5 points (gui -18.8 points, 4 common seeds)."
    )
    assert compared([1.0], [1.0]) == f"{name}: too few common seeds to compare."


def test_two_common_seeds_are_paired_by_seed() -> None:
    """Not by their place: gui ran the seeds the other way round, and one more."""
    records = [record("headless", k, value) for k, value in enumerate([1.0, 0.5])]
    records += [record("gui", k, value) for k, value in ((7, 0.2), (1, 0.5), (0, 1.0))]
    (found,) = compare_modes(records, [PLACED])
    assert "placed: gui +0 points, 2 common seeds;" in found


def test_only_the_studys_shares_are_compared_and_a_crash_counts() -> None:
    metrics = [
        replace(PLACED, title="a", name="a", study=False),
        Metric("b", "b", study=True),
        replace(PLACED, title="c", name="c"),
    ]
    values = {"a": 1.0, "b": 1.0, "c": None, "placed": 1.0}
    records = [
        replace(record(mode, k, 1.0), metrics=values)
        for mode in ("headless", "gui")
        for k in (0, 1)
    ]
    failed = replace(record("gui", 5, 0.0), status="failed")
    found = compare_modes([*records, failed, record("headless", 5, 0.0)], [*metrics, PLACED])
    first, second = (sentence.partition("gui, ")[2] for sentence in found)
    assert first == "c: too few common seeds to compare."
    assert second.startswith("placed: gui +0 points, 3 common seeds;")
