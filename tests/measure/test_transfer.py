"""Do simulators rank policies alike? tau-b and MMRV by their properties, intervals, verdicts and
the ceiling by planted rates."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kendalltau

from pytest_simbench.measure import transfer
from pytest_simbench.measure.transfer import Array, Ceiling, Transfer, mmrv, tau_b, transfers
from pytest_simbench.records.record import Record
from tests.records.build import record

SPREAD = np.linspace(0.6, 0.95, 5)
TWO = st.integers(2, 7).flatmap(
    lambda n: st.tuples(*[st.lists(st.integers(0, 20), min_size=n, max_size=n)] * 2)
).map(lambda sides: tuple(np.array(side) / 20 for side in sides))  # fmt: skip


@given(TWO)
def test_tau_b_is_that_of_scipy_and_knows_no_labels(sides: tuple[Array, Array]) -> None:
    first, second = sides
    found = float(tau_b(first, second))
    known = kendalltau(first, second).statistic
    assert found == pytest.approx(known, nan_ok=True)
    order = np.argsort(second)
    assert float(tau_b(first[order], second[order])) == pytest.approx(found, nan_ok=True)
    assert float(mmrv(first[order], second[order])) == pytest.approx(float(mmrv(first, second)))


@given(st.lists(st.integers(0, 20), min_size=2, max_size=7))
def test_the_same_order_is_1_and_the_reverse_one_is_less_1(successes: list[int]) -> None:
    found, ties = np.array(successes, dtype=float), len(set(successes)) == 1
    assert math.isnan(tau_b(found, found)) == ties
    assert ties or float(tau_b(found, found**2 + 3)) == pytest.approx(1)
    assert ties or float(tau_b(found, -found)) == pytest.approx(-1)


@given(TWO)
def test_mmrv_is_0_where_no_order_of_the_reference_is_violated(sides: tuple[Array, Array]) -> None:
    rates, reference = sides
    many = range(len(rates))
    violated = any(
        (rates[i] > rates[j]) != (reference[i] > reference[j]) and reference[i] != reference[j]
        for i in many
        for j in many
    )
    assert (float(mmrv(rates, reference)) > 0) == violated


def test_mmrv_by_hand() -> None:
    """The first and the second policy are swapped, which costs 0.2 each; the third one nothing."""
    found = mmrv(np.array([0.5, 0.7, 0.1]), np.array([0.9, 0.7, 0.3]))
    assert float(found) == pytest.approx((0.2 + 0.2) / 3)


def runs(rates: Array, seeds: int, many: int = 4000) -> Array:
    """Successes in runs, (many, policies)."""
    return np.random.default_rng(3).binomial(seeds, rates, (many, len(rates))).astype(float)


def test_two_equal_engines_of_20_seeds() -> None:
    """What a perfect simulator is told by chance: 8 policies of 60 to 95 %, and a limp one more,
    of which Pearson's correlation sees nothing but that one."""
    eight = np.linspace(0.6, 0.95, 8)
    for rates, mean, ends in (eight, 0.56, (0.15, 0.89)), (np.r_[0, eight], 0.67, (0.36, 0.91)):
        first, second = np.split(runs(rates, 20), 2)
        tau = tau_b(first, second)
        assert tau.mean() == pytest.approx(mean, abs=0.02)
        assert np.quantile(tau, [0.025, 0.975]) == pytest.approx(ends, abs=0.04)
    linear = [np.corrcoef(*pair)[0, 1] for pair in zip(first, second, strict=True)]
    assert np.mean(linear) == pytest.approx(0.92, abs=0.01)


def outcomes(*rates: Array, seeds: int, draw: int = 0) -> Array:
    """Of simulators, (simulators, policies, seeds)."""
    rng = np.random.default_rng(draw)
    return 1.0 * (rng.random((len(rates), len(rates[0]), seeds)) < np.array(rates)[..., None])


def exactly(rates: Array, seeds: int) -> Ceiling:
    """Of rates that so many seeds have without any noise."""
    first = 1.0 * (np.arange(seeds) < np.rint(seeds * rates)[:, None])
    return Ceiling(np.random.default_rng(1).permuted(first, axis=1))


def compared(found: Array) -> Transfer:
    names = [str(k) for k in range(found.shape[1])]
    return Transfer("pushing", names, [(f"s{k}", "", "") for k in range(len(found))], found)


@pytest.mark.parametrize(
    ("rates", "truth", "off"),
    [
        (SPREAD, 0.65, 0.1),
        (np.r_[0, SPREAD], 0.77, 0.04),
        (np.linspace(0.6, 0.95, 8), 0.56, 0.05),
        (np.linspace(0.7, 0.8, 4), 0.13, 0.1),
    ],
)
def test_the_ceiling_is_that_of_the_true_rates(rates: Array, truth: float, off: float) -> None:
    """Within what the module says, and nearer than the rates as they were seen."""
    means = [Ceiling(outcomes(rates, seeds=20, draw=k)[0]).tau.mean for k in range(60)]
    assert np.nanmean(means) == pytest.approx(truth, abs=off)


def test_how_many_seeds_make_the_ceiling_narrow() -> None:
    """0.2 wide from 137 on by the true rates, narrower from 340 on, where no order is wrong; 80
    seeds that have the rates exactly say about as many."""
    for seeds, worst, enough in (
        (110, 0.79, False),
        (170, 0.79, True),
        (280, 0.81, False),
        (420, 0.81, True),
    ):
        tau = tau_b(*np.split(runs(SPREAD, seeds, 20_000), 2))
        assert ((tau < worst).mean() < 0.025) == enough
    assert 120 < (exactly(SPREAD, 80).needed or 0) < 200
    assert exactly(np.full(5, 0.8), 20).needed is None


def test_intervals_hold_what_so_many_seeds_give(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transfer, "DRAWS", 399)
    found = [compared(outcomes(SPREAD, SPREAD, seeds=20, draw=k)).tau(0, 1) for k in range(200)]
    average = np.mean([one.mean for one in found])
    assert np.mean([average in one for one in found]) > 0.95
    assert np.mean([1.0 in one for one in found]) < 0.5  # not tau-b of the true rates


@pytest.mark.parametrize(
    ("other", "least", "most"),
    [
        (SPREAD, 0, 0.07),
        (SPREAD - 0.3, 0, 0.07),  # less success, the same ranks
        (SPREAD[::-1], 0.95, 1),
        (SPREAD[[0, 1, 4, 3, 2]], 0.4, 1),
    ],
)
def test_how_often_ranks_are_called_different(
    other: Array, least: float, most: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transfer, "DRAWS", 199)
    monkeypatch.setattr(Ceiling, "needed", None)
    verdicts = [
        compared(outcomes(SPREAD, other, seeds=60, draw=k)).verdict(0, 1) for k in range(150)
    ]
    assert least <= verdicts.count("different") / 150 <= most
    assert verdicts.count("alike") < 8  # 60 seeds cannot tell


def test_verdicts() -> None:
    steps = np.linspace(0.05, 0.95, 4)
    same = outcomes(steps, seeds=20)[0]
    ties = np.ones_like(same)
    found = compared(np.array([same, same, same[::-1], ties]))
    assert [found.verdict(0, k) for k in (1, 2, 3)] == ["alike", "different", "undefined"]
    assert found.pairs[0, 2].crossed == (0, 3)
    assert math.isnan(found.tau(3, 3).mean)
    assert found.tau(1, 0) is found.pairs[0, 1].tau
    assert found.mmrv(2, 0).mean == mmrv(same[::-1].mean(1), same.mean(1))
    assert compared(outcomes(SPREAD, SPREAD, seeds=20)).verdict(0, 1) == "open"
    assert compared(outcomes(steps, steps, seeds=300)).verdict(0, 1) == "alike"  # no seed alike
    assert compared(outcomes(SPREAD, SPREAD, seeds=300)).verdict(0, 1) == "alike"  # within ceilings


def tried(simulator: str, policy: str, seed: int, success: bool | None, **more: Any) -> Record:
    """A repetition of a policy; without a result it crashed."""
    told = {"test": f"test_transfer[{simulator}-headless-{policy}]", "simulator": simulator,
            "task": "pushing", "seed": seed, "status": "ok" if success is not None else "failed",
            "settings": {"task.policy": policy, "task.policy_rate": len(policy), **more},
            "metrics": {} if success is None else {"success": success}}  # fmt: skip
    return record(seed, **told)


def whole(**more: Any) -> list[Record]:
    """Policy good succeeds with odd seeds, bad with every third one, on b with one seed fewer."""
    return [
        tried(simulator, policy, seed, seed % every == 1, **more)
        for simulator, seeds in (("a", 12), ("b", 11))
        for policy, every in (("bad", 3), ("good", 2))
        for seed in range(1, seeds + 1)
    ]


def test_records_are_paired_by_seed_and_a_crash_is_no_success() -> None:
    more = [tried("c", "good", seed, True) for seed in range(1, 12)]
    given = [r for r in whole() if (r.simulator, r.seed) != ("a", 1)]
    crashed = [tried("a", policy, 1, None) for policy in ("good", "bad")]
    (found,) = transfers([*given, *crashed, *more])
    assert list(found.policies) == ["good", "bad"]
    assert [who[0] for who in found.simulators] == ["a", "b"]
    assert [who[0] for who in found.left_out] == ["c"]
    assert found.seeds == 11
    assert found.outcomes.sum(2).tolist() == [[5, 3], [6, 4]]
    assert found.mmrv(1, 1) == found.ceilings[1].mmrv
    assert found.mmrv(0, 1).mean == float(mmrv(*found.outcomes.mean(-1)))


def test_what_has_no_like_is_left_out_and_the_others_are_compared() -> None:
    """A policy that one simulator has, and a simulator that was interrupted after two seeds."""
    new = [tried("a", "new", seed, True) for seed in range(1, 13)]
    short = [tried("d", policy, seed, True) for policy in ("good", "bad") for seed in (1, 2)]
    (found,) = transfers([*whole(), *new, *short])
    assert (found.policies, found.lone, found.seeds) == (["good", "bad"], ["new"], 11)
    assert [[who[0] for who in some] for some in (found.simulators, found.left_out)] == [
        ["a", "b"], ["d"]
    ]  # fmt: skip


def test_each_configuration_ranks_policies_by_itself() -> None:
    """And what policies differ in tells no configurations apart."""
    given = [
        replace(r, limits={"timeout": len(r.settings["task.policy"])})
        for r in whole(timestep=0.002)
    ]
    other = [
        replace(r, metrics={"success": r.seed > 9}, settings={**r.settings, "timestep": 0.004})
        for r in given
        if r.simulator == "a"
    ]
    (found,) = transfers([*given, *other])
    assert [(who[0], *who[3:]) for who in found.simulators] == [
        ("a", "timestep=0.002"), ("a", "timestep=0.004"), ("b",)
    ]  # fmt: skip
    assert found.outcomes.sum(2).tolist() == [[6, 4], [2, 2], [6, 4]]


def test_other_work_is_no_transfer() -> None:
    other = [replace(r, robot={"name": "ur5"}) for r in whole()]
    other += [replace(r, jitter=0.1) for r in whole()] + whole(**{"task.seconds": 3})
    assert [found.seeds for found in transfers([*whole(), *other])] == [11] * 4
    alone = [r for r in whole() if r.simulator == "a"]
    few = [r for r in whole() if r.seed < 5]
    single = [r for r in whole() if r.settings["task.policy"] == "bad"]
    assert [transfers(some) for some in (alone, few, single, [record(1)])] == [[], [], [], []]
