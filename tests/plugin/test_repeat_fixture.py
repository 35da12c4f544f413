"""What a run folder keeps of a test's claims, and of a test that failed as a whole."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock, call

import pytest

from pytest_simbench.experiment.variants import Variant
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.plugin.marks import describe_failure
from pytest_simbench.plugin.repeat_fixture import RepeatFixture, claim_of
from pytest_simbench.records.claims import Claim
from tests.records.build import METRICS, failed, records

TEST: dict[str, Any] = {"simulator": "engine", "mode": "gui", "profile": "real",
                        "function": "t.py::test_it", "variant": "a-b"}  # fmt: skip


@pytest.mark.parametrize(
    ("threshold", "verdict", "advice"),
    [(0.6, "FAIL", ""), (0.1, "PASS", ""), (0.5, "UNDECIDED", "about 295 more repetitions needed")],
)
def test_all_that_is_kept_of_a_claim(threshold: float, verdict: Any, advice: str) -> None:
    rows = [*records("placed", [0.45, 0.55] * 10), *records("hit", [1.0]), failed(30)]
    result = ResultSet(rows, METRICS)
    result.strict = result.warns = False
    with suppress(AssertionError):
        result.assert_at_least("placed", threshold)
    ((metric, judgement),) = result.judged
    case: Any = SimpleNamespace(**TEST, test="t.py::test_it[engine-gui-a-b]")
    bounds = judgement.interval
    assert claim_of(case, result, metric, judgement) == Claim(
        **TEST, test=case.test, task="stacking", metric="placed", relation="at least",
        threshold=threshold, verdict=verdict, mean=bounds.mean, low=bounds.low, high=bounds.high,
        n=21, crashed=1, without=1, advice=advice, parameters="{}",
    )  # fmt: skip


def test_an_attempt_that_is_taken_back_claims_and_tells_no_more() -> None:
    node: Any = SimpleNamespace(user_properties=[("own", 1), ("crashed", 2)])
    kept, case = Mock(), Mock()
    fixture = RepeatFixture(node, case, SimpleNamespace(folder=SimpleNamespace(claim=kept)))
    whole = Claim(**TEST, test="t.py::test_it", verdict="PASS", metric="placed")
    fixture.claims, fixture.properties = [whole], [("crashed", 2)]
    fixture.take_back()
    assert node.user_properties == [("own", 1)]
    assert kept.call_args_list == [call(replace(whole, verdict=""))]


def test_all_that_is_kept_of_a_test_that_failed() -> None:
    variant = Variant("engine", "gui", "real")
    chosen = SimpleNamespace(params={"sim_case": variant}, id="a-engine-gui-real-b",
                             _idlist=["a", "engine-gui-real", "b"])  # fmt: skip
    item: Any = SimpleNamespace(nodeid="t.py::test_it[a-engine-gui-real-b]", callspec=chosen)
    crash = SimpleNamespace(reprcrash=SimpleNamespace(message="assert 1 == 2\nmore"))
    for told, advice in ((crash, "assert 1 == 2"), ("file t.py\nno fixture", "file t.py")):
        report: Any = SimpleNamespace(longrepr=told)
        kept = describe_failure(item, report, 2)
        assert Claim(**kept) == Claim(**TEST, test=item.nodeid, verdict="FAIL", advice=advice)
