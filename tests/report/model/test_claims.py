"""Pass or fail, and why: what every report opens with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.measure.gate import GateReport
from pytest_simbench.records.claims import Claim
from pytest_simbench.records.folder import RunContents
from pytest_simbench.records.record import Failure
from pytest_simbench.report.markdown.run import render_claims
from pytest_simbench.report.model.claims import OPEN, claims_of
from pytest_simbench.report.terminal.parts import claim_lines
from tests.report.samples import METRICS, record

STACK = "suites/test_stacking.py::test_stacking"


def claim(simulator: str = "mujoco", verdict: str = "PASS", **changes: Any) -> Claim:
    given: dict[str, Any] = {
        "test": f"{STACK}[{simulator}-headless]",
        "function": STACK,
        "simulator": simulator,
        "mode": "headless",
        "profile": "tuned",
        "task": "stacking",
        "metric": "placed",
        "relation": "at least",
        "threshold": 0.9,
        "mean": 1.0,
        "n": 20,
    }
    return Claim(verdict=verdict, **{**given, **changes})


def stacked(simulator: str, k: int, placed: float | None) -> Any:
    more: dict[str, Any] = {"test": f"{STACK}[{simulator}-headless]"}
    if placed is None:
        more |= {"status": "failed", "error": Failure("WorkerHung", "silent", "settle")}
    return record(simulator, k, metrics={"placed": placed}, **more)


RECORDS = (
    *(stacked("mujoco", k, 1.0) for k in (1, 2)),
    stacked("drake", 1, 0.8),
    stacked("drake", 2, 0.2),
)
FAILED = claim("drake", "FAIL", mean=0.5, low=0.3, high=0.7, n=2)


def reading(*claims: Claim, records: Any = RECORDS) -> RunContents:
    from pytest_simbench.records.description import TaskDescription

    tasks = {name: TaskDescription(name, metrics) for name, metrics in METRICS.items()}
    return RunContents(records=records, tasks=tasks, claims=claims)


def test_the_first_line_says_pass_or_fail_and_how_many_crashed() -> None:
    undecided = claim("sapien", "UNDECIDED", advice="about 9 more repetitions needed")
    for claims, sentence in (
        ((), "no claim was judged; 0 of 4 repetitions crashed"),
        ((claim(),), "PASS   1 of 1 claims hold; 0 of 4 repetitions crashed"),
        ((claim(), undecided), "UNDECIDED   1 of 2 claims hold, 1 undecided; 0 of 4 repetitions"),
        ((claim(), undecided, FAILED), "FAIL   1 of 3 claims fail, 1 undecided; 0 of 4"),
    ):
        assert claims_of(reading(*claims)).sentence.startswith(sentence)


def test_a_run_that_did_not_pass_does_not_open_with_pass() -> None:
    """A test was lost with its process, or Ctrl-C came before it."""
    for claims, told in (
        ((claim(),), "FAIL   1 of 1 claims hold; tests failed or did not run; 0 of 4 repetitions"),
        ((), "FAIL   no claim was judged; tests failed or did not run; 0 of 4 repetitions"),
        ((FAILED,), "FAIL   1 of 1 claims fail; 0 of 4 repetitions"),
    ):
        found = claims_of(reading(*claims), passed=False)
        assert (found.state, found.sentence.startswith(told)) == ("FAIL", True)


def test_tests_of_one_name_are_told_apart() -> None:
    names = (STACK, STACK.replace("::", "::TestTall::"))
    both = [claim(test=f"{name}[mujoco-headless]", function=name) for name in names]
    column = claims_of(reading(*both)).table.columns[0]
    assert [cell.text for cell in column.cells] == [f"{name}: placed >= 90 %" for name in names]


def test_a_limit_against_the_baseline_that_is_exceeded_is_a_claim_that_fails() -> None:
    gate = GateReport(broken=("test_x: nothing finished",))
    found = claims_of(reading(claim()), gate)
    assert found.state == "FAIL"
    assert found.troubles[0].what == "test_x: nothing finished"


def test_the_table_has_a_column_for_each_simulator_and_a_row_for_each_claim() -> None:
    shown = claim_lines(claims_of(reading(claim(low=0.83, high=1.0), FAILED)), 80)
    assert "those of other tables are wider" in shown
    row = next(line for line in shown.splitlines() if line.startswith("test_stacking"))
    assert row.split("  ") == ["test_stacking: placed >= 90 %", "PASS 100 [83, 100]",
                               "FAIL 50 [30, 70]"]  # fmt: skip


def test_a_claim_that_fails_names_the_worst_repetition_and_how_to_see_it_again() -> None:
    (trouble,) = claims_of(reading(claim(), FAILED)).troubles
    assert trouble.what == (
        "FAIL drake, test_stacking: placed >= 90 % is 50 [30, 70] over 2 repetitions"
    )
    assert trouble.worst == "seed 1002, repetition 2 has 20 %"
    assert "--sim-seed=1002" in trouble.again
    assert "--sim-name=drake" in trouble.again


def test_the_worst_repetition_is_one_of_the_claims_own_task() -> None:
    """Another task of the same test, with other parameters, has a repetition that is worse."""
    other = replace(RECORDS[3], settings={"task.height": 2}, seed=7, metrics={"placed": 0.0})
    mine = replace(FAILED, parameters="{}")
    (trouble,) = claims_of(reading(mine, records=(*RECORDS, other))).troubles
    assert trouble.worst == "seed 1002, repetition 2 has 20 %"


def test_repetitions_without_a_value_are_told() -> None:
    found = claims_of(reading(claim(n=6, without=6), replace(FAILED, without=1)))
    assert found.table.columns[1].cells[0].text == "PASS 100, 6 without a value"
    assert found.troubles[0].what.endswith("over 2 repetitions, 1 without a value")


def test_the_command_is_for_the_folder_that_pytest_was_called_from() -> None:
    found = claims_of(reading(FAILED), GateReport(broken=("x",)))
    assert found.seen_from(Path("/a"), Path("/a")) is found
    none, trouble = found.seen_from(Path("/a/sub"), Path("/a")).troubles
    assert none.again == ""
    assert trouble.again.startswith(f"pytest '../{STACK}[drake-headless]' --sim-name=drake")


def test_a_crash_is_worse_than_any_value() -> None:
    records = (*RECORDS, stacked("drake", 3, None))
    (trouble,) = claims_of(reading(FAILED, records=records)).troubles
    assert trouble.worst == "seed 1003, repetition 3 crashed: WorkerHung in settle"


def test_of_a_claim_that_was_made_again_the_last_verdict_holds() -> None:
    assert claims_of(reading(FAILED, claim("drake"))).state == "PASS"


def test_crashes_of_an_earlier_attempt_count_no_more() -> None:
    """A plugin ran the test again, and nothing crashed: the run passes, and the page said FAIL."""
    first = claim(metric="crashed", relation="at most", threshold=0.0, verdict="FAIL", mean=0.5)
    assert claims_of(reading(first, claim())).sentence.startswith("PASS   1 of 1 claims hold")
    assert claims_of(reading(replace(first, verdict="UNDECIDED"), claim())).state == "UNDECIDED"
    crashed = (*RECORDS, stacked("mujoco", 3, None))
    assert claims_of(reading(first, claim(), records=crashed)).state == "FAIL"


def test_what_failed_before_a_resumed_test_passed_counts_no_more() -> None:
    """Resumed with another limit on crashes, or none, a test makes no such claim again."""
    crashed, first = (*RECORDS, stacked("mujoco", 3, None)), claim(metric="crashed", verdict="FAIL")
    whole = claim(task="", metric="", relation=None, threshold=None, mean=None)
    assert claims_of(reading(first, claim(), whole, records=crashed)).state == "PASS"
    failed = replace(whole, verdict="FAIL", advice="again")
    assert claims_of(reading(whole, first, failed, records=crashed)).state == "FAIL"


def test_a_test_that_failed_as_a_whole_is_told_unless_a_claim_of_it_says_why() -> None:
    whole = claim("drake", "FAIL", task="", metric="", relation=None, threshold=None, mean=None,
                  advice="KeyError: 'x'")  # fmt: skip
    assert "KeyError" in claims_of(reading(claim(), whole)).troubles[0].what
    found = claims_of(reading(whole, FAILED))
    assert [trouble.what for trouble in found.troubles if "KeyError" in trouble.what] == []
    assert found.sentence.startswith("FAIL   1 of 1 claims fail")


def test_many_variants_of_a_test_are_counted_in_one_cell() -> None:
    laws = [claim(test=f"{STACK}[{k}]", variant=f"law{k}") for k in range(9)]
    laws.append(claim(test=f"{STACK}[x]", variant="x", verdict="FAIL"))
    whole = claims_of(reading(claim(function="test_other"), *laws))
    assert "1 FAIL, 9 PASS" in claim_lines(whole, 80)
    assert whole.table.columns[0].cells[0].text.startswith("test_stacking")  # what failed is first


@pytest.mark.parametrize("width", [80, 200])
def test_no_line_of_the_table_is_wider_than_the_terminal(width: int) -> None:
    many = [claim(f"simulator{k}", low=0.83, high=1.0) for k in range(10)]
    shown = claim_lines(claims_of(reading(*many)), width)
    assert all(len(line) <= width for line in shown.splitlines())


def test_markdown_opens_with_the_same() -> None:
    text = render_claims(claims_of(reading(claim(), FAILED)))
    assert text.startswith(
        "**FAIL   1 of 2 claims fail; 0 of 4 repetitions crashed**".replace("   ", " ")
    )
    assert "| claim | mujoco | drake |" in text
    assert "again: `pytest 'suites/test_stacking.py::test_stacking[drake-headless]'" in text


def test_a_claim_that_was_taken_back_stands_open_until_its_test_is_judged_again() -> None:
    """It held no more, so a run that had failed, was resumed and cut short opened with PASS."""
    back = replace(FAILED, verdict="")
    found = claims_of(reading(claim(), FAILED, back))
    assert found.state == "UNDECIDED"
    assert found.troubles[0].what == f"UNDECIDED test_stacking: placed >= 90 %: drake ({OPEN})"
    other = replace(FAILED, metric="placed_strict", verdict="PASS")
    assert claims_of(reading(claim(), FAILED, back, other)).state == "PASS"


def test_a_claim_that_is_not_decided_on_several_simulators_is_told_once() -> None:
    open_ = [
        claim(name, "UNDECIDED", advice="about 9 more repetitions needed", mean=0.9, n=9)
        for name in ("mujoco", "sapien")
    ]
    (trouble,) = claims_of(reading(*open_)).troubles
    assert trouble.what == (
        "UNDECIDED test_stacking: placed >= 90 %: mujoco 90 (about 9 more repetitions needed); "
        "sapien 90 (about 9 more repetitions needed)"
    )


def test_modes_and_missing_values_are_in_what_is_told_of_a_claim() -> None:
    """Both lines said "mujoco", and of repetitions that gave no value that they were too few."""
    open_ = claim(verdict="UNDECIDED", advice="needs 5", mean=0.9, n=3, without=4)
    fail = claim(verdict="FAIL", test="x.py::test_stacking[mujoco-gui]", mode="gui", mean=0.5)
    found = claims_of(reading(open_, fail))
    fails, undecided = (trouble.what for trouble in found.troubles)
    assert fails.startswith("FAIL mujoco gui, test_stacking: ")
    assert undecided.endswith(": mujoco headless 90, 4 without a value (needs 5)")
