"""How often intervals hold the truth and verdicts are right, wherever one is given: planted truths.

Each case draws many experiments from a distribution whose mean is known. A 95 % interval that holds
it in fewer than 94 of 100 is wrong; two standard errors of the count are allowed.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from pytest_simbench.measure.intervals import interval, proportion
from pytest_simbench.measure.verdicts import Verdict, at_least, at_most, confidence, judge
from pytest_simbench.records.metrics import Metric

Draw = Callable[[np.random.Generator, int], NDArray[np.float64]]
SHARE = Metric("placed", "placed", kind="share", of=15)
YES_NO = Metric("hit", "hit", kind="yes_no")
VALUE = Metric("cost", "cost")
COUNT = Metric("picks", "picks", least=0)
EXPERIMENTS = 300

SHARES: dict[str, tuple[Draw, float]] = {
    "15 cubes at 50 %": (lambda r, n: r.binomial(15, 0.5, n) / 15, 0.5),
    "15 cubes at 90 %": (lambda r, n: r.binomial(15, 0.9, n) / 15, 0.9),
    "15 cubes at 99 %": (lambda r, n: r.binomial(15, 0.99, n) / 15, 0.99),
    "6 cubes at 20 %": (lambda r, n: r.binomial(6, 0.2, n) / 6, 0.2),
    "one in twenty loses all": (lambda r, n: 1.0 * (r.random(n) > 0.05), 0.95),
    "one in ten loses half": (lambda r, n: 1 - 0.5 * (r.random(n) < 0.1), 0.95),
    "all or nothing": (lambda r, n: 1.0 * (r.random(n) < 0.5), 0.5),
    "skewed": (lambda r, n: r.beta(8, 0.5, n), 8 / 8.5),
    "rarely anything": (lambda r, n: r.beta(0.2, 4, n), 0.2 / 4.2),
}
VALUES: dict[str, tuple[Draw, float]] = {
    "normal": (lambda r, n: r.normal(2, 3, n), 2.0),
    "uniform": (lambda r, n: r.random(n), 0.5),
    "heavy tails": (lambda r, n: r.standard_t(3, n), 0.0),
    "exponential": (lambda r, n: r.exponential(1, n), 1.0),
    "start and delay": (lambda r, n: 5 + r.gamma(0.5, 2, n), 6.0),
    "lognormal 0.5": (lambda r, n: r.lognormal(0, 0.5, n), math.exp(0.125)),
    "lognormal 1": (lambda r, n: r.lognormal(0, 1, n), math.exp(0.5)),
    "mirrored": (lambda r, n: -r.exponential(1, n), -1.0),
    "counts": (lambda r, n: 1.0 * r.poisson(2, n), 2.0),
}
COUNTS: dict[str, tuple[Draw, float]] = {
    "one in twenty": (lambda r, n: 1.0 * r.poisson(0.05, n), 0.05),
    "one in five": (lambda r, n: 1.0 * r.poisson(0.2, n), 0.2),
    "two": (lambda r, n: 1.0 * r.poisson(2, n), 2.0),
    "geometric": (lambda r, n: r.geometric(0.2, n) - 1.0, 4.0),
    "bursts in one of five": (lambda r, n: 5.0 * (r.random(n) < 0.2) * r.poisson(1, n), 1.0),
    "nearly always six": (lambda r, n: 1.0 * r.binomial(6, 0.95, n), 5.7),
}


def held(draw: Draw, truth: float, n: int, metric: Metric, experiments: int) -> tuple[float, int]:
    """The share of the given intervals that hold the truth, and how many were given."""
    rng = np.random.default_rng(7)
    found = [interval(draw(rng, n), metric) for _ in range(experiments)]
    given = [one for one in found if math.isfinite(one.half_width)]
    return sum(truth in one for one in given) / max(1, len(given)), len(given)


def enough(share: float, experiments: int, least: float = 0.94) -> bool:
    return share >= least - 2 * math.sqrt(least * (1 - least) / experiments)


@pytest.mark.parametrize("n", [1, 2, 3, 5, 10, 20])
@pytest.mark.parametrize("name", SHARES)
def test_shares(name: str, n: int) -> None:
    share, given = held(*SHARES[name], n, SHARE, EXPERIMENTS)
    assert given == EXPERIMENTS  # at any number of repetitions
    assert enough(share, given)


@pytest.mark.parametrize("n", [5, 6, 8, 12, 20, 40])
@pytest.mark.parametrize("name", VALUES)
def test_values(name: str, n: int) -> None:
    share, given = held(*VALUES[name], n, VALUE, 1500)
    assert given > 1400
    assert enough(share, given)


@pytest.mark.parametrize("n", [5, 10, 20])
@pytest.mark.parametrize("name", COUNTS)
def test_counts(name: str, n: int) -> None:
    """Each end errs in 2.5 % at most, and none lies where no count can be."""
    rng = np.random.default_rng(7)
    draw, truth = COUNTS[name]
    found = [interval(draw(rng, n), COUNT) for _ in range(EXPERIMENTS)]
    given = [one for one in found if math.isfinite(one.half_width)]
    assert given
    assert min(one.low for one in given) > 0  # a count above 0 was seen, so the mean is above 0
    assert all(one.low <= one.mean <= one.high for one in given)
    for wrong in (sum(one.low > truth for one in given), sum(one.high < truth for one in given)):
        assert enough(1 - wrong / len(given), len(given), least=0.975)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 10, 20, 60])
def test_proportions_at_every_rate(n: int) -> None:
    """Exact coverage from the binomial distribution itself; each end errs in 2.5 % at most."""
    rates = np.linspace(0.001, 0.999, 999)
    ends = [proportion(k, n) for k in range(n + 1)]
    weights = binom.pmf(np.arange(n + 1), n, rates[:, None])
    for wrong in (
        np.array([found.low for found in ends]) > rates[:, None],
        np.array([found.high for found in ends]) < rates[:, None],
    ):
        assert (weights * wrong).sum(axis=1).max() <= 0.025 + 1e-12


def test_what_no_interval_of_values_holds_is_as_rare_as_the_docs_say() -> None:
    """One value in twenty is ten deviations off: 87 of 100 runs of 20 hold the mean."""
    share, given = held(
        lambda r, n: r.normal(10, 1, n) + 10 * (r.random(n) < 0.05), 10.5, 20, VALUE, 1500
    )
    assert share == pytest.approx(0.87, abs=0.02)
    assert given == 1500


@pytest.mark.parametrize("n", [5, 10, 20])
@pytest.mark.parametrize(
    ("metric", "name"),
    [
        *((SHARE, name) for name in SHARES),
        *((YES_NO, name) for name in ("one in twenty loses all", "all or nothing")),
        *((VALUE, name) for name in ("normal", "exponential", "start and delay", "mirrored")),
    ],
    ids=lambda value: value if isinstance(value, str) else value.kind,
)
def test_a_verdict_errs_in_one_of_twenty_runs(metric: Metric, name: str, n: int) -> None:
    """A claim at the very truth is refuted, and one just beyond it supported, that rarely."""
    draw, truth = (VALUES if metric is VALUE else SHARES)[name]
    rng, level = np.random.default_rng(8), confidence(metric)
    wrong = {"low": 0, "high": 0}
    for _ in range(EXPERIMENTS):
        found = interval(draw(rng, n), metric, level)
        wrong["low"] += judge(at_least(truth), found).verdict is Verdict.REFUTED
        wrong["high"] += judge(at_most(truth), found).verdict is Verdict.REFUTED
        assert judge(at_least(truth + 1e-9), found).verdict is not Verdict.SUPPORTED or (
            truth < found.low
        )
    for count in wrong.values():
        assert enough(1 - count / EXPERIMENTS, EXPERIMENTS, least=0.95)
