"""Policies on several simulators, as every medium tells of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.cli.runs import sections
from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.folder import RunContents
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record
from pytest_simbench.report.markdown.run import render_run as markdown
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.model.transfer import section
from pytest_simbench.report.page.context import page
from pytest_simbench.report.page.render import render
from tests.report.samples import record, texts

POLICIES = {"limp": 1, "slow": 10, "quick": 18}
"""Of 20 seeds so many are a success."""

OTHERS = {"a": POLICIES, "b": POLICIES, "c": {"limp": 18, "slow": 10, "quick": 1},
          "d": dict.fromkeys(POLICIES, 20)}  # fmt: skip


def run(**simulators: dict[str, int]) -> list[Record]:
    return [
        record(
            simulator, seed, "pushing", metrics={"success": seed <= successes},
            settings={"task.policy": policy}, test=f"test_transfer[{simulator}-headless-{policy}]",
        )
        for simulator, policies in simulators.items()
        for policy, successes in policies.items()
        for seed in range(1, 21)
    ]  # fmt: skip


def report(records: list[Record]) -> Report:
    told = TaskDescription("pushing", (Metric("success", "success", kind="yes_no"),))
    return Report.of(RunContents("run", tuple(records), {"pushing": told}))


@pytest.fixture(scope="module")
def four() -> Report:
    return report(run(**OTHERS))


def test_the_sentences_tell_who_ranks_alike(four: Report) -> None:
    (found,) = four.transfers
    assert section(found).sentences == [
        "Ranks differ by more than the noise: a and c (tau-b -1.00 [-1.00, -1.00], ceilings 1.00 "
        "and 1.00) and b and c (tau-b -1.00 [-1.00, -1.00], ceilings 1.00 and 1.00).",
        "As alike as two runs of one engine: a and b (tau-b 1.00 [1.00, 1.00], ceilings 1.00 and "
        "1.00).",
        "quick and limp succeed in 90 and 5 % on a but in 5 and 90 % on c.",
        "There is no tau-b of d, where all policies succeed as often.",
    ]


def test_the_tables(four: Report) -> None:
    success, ranks, violations = (
        texts(table.columns) for table in section(four.transfers[0]).tables
    )
    assert list(success) == ["simulator", "quick %", "slow %", "limp %"]
    assert success["quick %"] == ["90 [68, 99]", "90 [68, 99]", "5 [0, 25]", "100 [83, 100]"]
    assert ranks["a"] == ["1.00 [1.00, 1.00]", "1.00 [1.00, 1.00]", "-1.00 [-1.00, -1.00]", "-"]
    assert violations["by a"][1] == "0.00 [0.00, 0.00]"
    assert violations["by a"][2].startswith("0.72 ")  # 0.85, 0.45 and 0.85
    assert violations["seeds"] == ["20", "20", "20", "-"]


def test_what_cannot_be_told_says_how_many_seeds_it_needs() -> None:
    near, mixed = {"limp": 11, "slow": 13, "quick": 16}, {"limp": 12, "slow": 11, "quick": 12}
    assert section(report(run(a=near, b=mixed)).transfers[0]).sentences == [
        "Cannot be told with 20 seeds; on b policies succeed too equally for any number: a and b "
        "(tau-b 0.00 [-0.50, 0.00], ceilings 0.95 and 0.01)."
    ]
    near, swapped = ({"limp": k, "slow": 25 - k, "quick": 15} for k in (12, 13))
    told = section(report(run(a=near, b=swapped)).transfers[0]).sentences
    assert told[0].startswith("Cannot be told with 20 seeds, about 120 are needed: a and b (tau-b")


def test_who_lacks_a_policy_is_named() -> None:
    told = section(report(run(a={**POLICIES, "new": 3}, b=POLICIES, e={"limp": 1})).transfers[0])
    assert told.notes == [
        "not compared, since a policy is missing there: e",
        "not compared, since too few simulators have it: new",
    ]


def test_terminal_markdown_and_page_tell_it_first(four: Report, tmp_path: Path) -> None:
    answer = section(four.transfers[0]).sentences
    title, text = next(sections(four, 100, False))
    assert title == "transfer of pushing"
    assert "5 [0, 25]" in text
    assert "MMRV" not in text
    assert "by a" in next(sections(four, 100, True))[1]
    written = markdown(four)
    assert written.index("## Transfer of pushing") < written.index("## pushing")
    assert answer[2] in written
    shown = render(page(tmp_path, four))
    assert f'<p class="answer">{answer[2]}</p>' in shown
    assert shown.index('id="transfer"') < shown.index('id="task-1"')


def test_without_policies_there_is_none(tmp_path: Path) -> None:
    plain = report([record("a", 1, "pushing", metrics={"success": 1.0})])
    assert plain.transfers == []
    assert 'id="transfer"' not in render(page(tmp_path, plain))
