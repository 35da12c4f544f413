"""Laws: the table of phenomena, its sentences and every law's error; over time steps, and over
releases."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from pytest_simbench.measure.sweep import Swept, sweeps
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.notes import Notes
from pytest_simbench.records.phenomena import PHENOMENON
from pytest_simbench.records.readings import Reading as Told
from pytest_simbench.records.record import Record
from pytest_simbench.report.markdown.run import render_run as markdown
from pytest_simbench.report.model import sweep, truth
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.model.summary import TaskSummary, at_own_steps, summarise
from pytest_simbench.report.page.context import page
from pytest_simbench.report.page.render import render
from pytest_simbench.report.terminal.run import render_brief, render_run
from tests.report.samples import METRICS, failed, record, stacking_run, texts

ERROR = (Metric("error", "error", "m", "lower", least=0), Metric("ratio", "ratio", "", "lower"))
LAWS = {"sag": "joints", "creep": "sticking", "stick": "sticking", "fall": "free motion"}
STEPS = (0.002, 0.001, 0.0005)


def law(
    simulator: str, name: str, ratio: float | None, profile: str = "tuned", step: float = 0.001
) -> Record:
    """A record of one law; it failed where there is no ratio. Its tolerance is 10 steps, and its
    profile's own step is 1 ms."""
    settings = {"timestep": step, PHENOMENON: LAWS[name]}
    own = None if step == 0.001 else 0.001
    told = {"simulator": simulator, "task": name, "profile": profile, "settings": settings}
    if ratio is None:
        notes = Notes(own_timestep=own)
        return failed("Diverged", "measure", "it left the room", notes=notes, **told)
    notes = Notes(reading=Told(1.0, 1.0, 10 * step), own_timestep=own)
    stepping = {"cpu": 1e-5 / step, "simulated": 1.0, "steps": 1 / step}
    return record(
        metrics={"error": ratio * 10 * step, "ratio": ratio}, notes=notes, stepping=stepping, **told
    )


def run() -> list[Record]:
    return [
        law("mujoco", "sag", 0.5), law("pybullet", "sag", 968.04),
        law("mujoco", "creep", 0.542), law("pybullet", "creep", 0.0),
        law("mujoco", "stick", 0.0), law("pybullet", "stick", None),
    ]  # fmt: skip


def summaries(records: list[Record]) -> list[TaskSummary]:
    return summarise(at_own_steps(records), {**METRICS, **dict.fromkeys(LAWS, ERROR)})


def test_a_sentence_for_each_phenomenon_and_none_of_a_single_simulator() -> None:
    assert truth.sentences(summaries(run())) == [
        "for sticking: mujoco, which keeps 2 of 2 laws.",
        "for joints: mujoco, which keeps 1 of 1 laws.",
    ]
    assert truth.sentences(summaries(run()[::2])) == []


def test_no_clear_best_and_the_cheapest_of_those_that_nobody_beats() -> None:
    equal = [law("mujoco", "sag", 0.5), law("pybullet", "sag", 0.9)]
    told = "for joints: no clear best; laws kept of 1 by those that nobody beats: mujoco 1 and "
    assert truth.sentences(summaries(equal)) == [f"{told}pybullet 1."]
    equal[1] = replace(equal[1], stepping={**equal[1].stepping, "cpu": 0.004})
    (found,) = truth.sentences(summaries(equal))
    assert found == f"{told}pybullet 1; the cheapest of them: pybullet."


def test_profiles_are_compared_each_by_itself() -> None:
    other = [law("mujoco", "sag", 7.0, "default"), law("pybullet", "sag", 0, "default")]
    assert truth.sentences(summaries([*run()[:2], *other])) == [
        "for joints (default): pybullet, which keeps 1 of 1 laws.",
        "for joints (tuned): mujoco, which keeps 1 of 1 laws.",
    ]


def test_the_table_counts_the_laws_kept_and_every_law_is_told_in_its_own_unit() -> None:
    table = texts(truth.table(summaries(run())))
    assert table["simulator"] == ["mujoco", "pybullet"]
    assert table["sticking"] == ["2/2 0.54x", "1/2 fails"]
    assert table["joints"] == ["1/1 0.5x", "0/1 968x"]
    sticking, joints = (texts(each.columns) for each in truth.details(summaries(run())))
    assert sticking == {
        "law": ["creep", "stick"], "error in": ["m", "m"], "mujoco": ["0.0054", "0"],
        "pybullet": ["0", "fails"],
    }  # fmt: skip
    assert joints["pybullet"] == ["9.7 (968x)"]


def test_laws_come_first_in_every_medium_and_have_no_tables_of_their_own(tmp_path: Path) -> None:
    records = [*stacking_run(), *run()]
    mixed = summaries(records)
    brief = render_brief(mixed, 100)
    assert brief.index("for sticking: mujoco") < brief.index("did stacking")
    assert "creep:" not in brief
    assert "CRASHED stick, pybullet" in brief
    whole = render_run(mixed, 100)
    assert whole.index("laws of sticking") < whole.index("did stacking")
    report = Report(mixed, records)
    written = markdown(report)
    assert written.startswith("## Which simulator is right about what")
    assert written.index("### Laws of joints") < written.index("## stacking")
    shown = page(tmp_path, report)
    assert shown["title"] == "3 laws and stacking"
    assert [part["told"].of for part in shown["tasks"]] == ["stacking"]
    html = render(shown)
    assert html.index('id="laws"') < html.index('id="task-1"')
    assert "1/2 fails" in html
    assert "9.7 (968x)" in html
    plain = summaries(stacking_run())
    assert "laws" not in render_brief(plain, 100) + markdown(Report(plain))


SWEPT = [
    *(law("mujoco", "fall", 0.8, step=h) for h in STEPS),
    law("ode", "fall", None, step=0.002), law("ode", "fall", 2.0),
    law("ode", "fall", 4.0, step=5e-4),
]  # fmt: skip


def swept(records: list[Record] = SWEPT) -> list[Swept]:
    return sweeps(records, {"fall": ERROR})


def test_the_step_to_take_the_order_and_the_cheapest_steps() -> None:
    table = texts(sweep.table(swept()))
    assert table == {"simulator": ["mujoco", "ode"], "free motion": ["1/1 1ms 0.010", "0/1"]}
    order, kept, within, broken, failures = (texts(t.columns) for t in sweep.details(swept()))
    assert order == {"law": ["fall"], "mujoco": ["1.00 [1.00, 1.00]"], "ode": ["0.00"]}
    assert kept == {"law": ["fall"], "mujoco": ["2ms 0.0050"], "ode": ["none"]}
    assert within == {"law": ["fall"], "mujoco": ["1ms 0.010"], "ode": ["none"]}
    assert broken == {"simulator": ["ode"], "laws": ["fall"]}
    assert failures["steps"] == ["2ms"]
    assert failures["message"] == ["it left the room"]
    lost = sweep.details(swept([law("a", "fall", None, step=h) for h in (1e-3, 2e-3)]))
    assert texts(lost[-1].columns)["steps"] == ["2ms, 1ms"]


def test_laws_that_no_step_helps_are_named() -> None:
    """1 ms may cost 0.01 here: one is better at its smallest step, the other at none."""
    records = [*SWEPT, *(law("dart", "fall", 2.0, step=h) for h in STEPS)]
    assert sweep.broken(swept(records)) == [("ode", "fall")]
    assert sweep.BROKEN == "laws that no step keeps with the error that 1 ms may cost"
    fine = sweep.details(swept([law("a", "fall", 0.0, step=h) for h in STEPS]))
    assert sweep.BROKEN not in [table.title for table in fine]
    assert texts(fine[0].columns)["a"] == ["exact"]
    one = [law("a", "fall", ratio, step=h) for ratio, h in ((None, 1e-3), (0.5, 2e-3))]
    assert texts(sweep.details(swept(one))[0].columns)["a"] == ["-"]  # one error has no order


def test_profiles_of_a_sweep_are_told_apart() -> None:
    other = [law("mujoco", "fall", 0.1, "default", h) for h in STEPS]
    names = list(sweep.labels(swept([*SWEPT[:3], *other])).values())
    assert names == ["mujoco (default)", "mujoco (tuned)"]


def test_laws_at_other_steps_are_in_no_other_table_and_other_tasks_are() -> None:
    stacking = record(settings={"timestep": 0.5}, notes=Notes(own_timestep=0.001))
    kept = [(r.simulator, r.settings["timestep"]) for r in at_own_steps([*SWEPT, stacking])]
    assert kept == [("mujoco", 0.001), ("ode", 0.001), ("mujoco", 0.5)]


@pytest.mark.parametrize("records", [SWEPT, SWEPT[0:1] + SWEPT[2:3]])
def test_markdown_and_page_hold_them(tmp_path: Path, records: list[Record]) -> None:
    """Also where no law ran at its profile's own step."""
    report = Report(summaries(records), records, sweeps=swept(records))
    written = markdown(report)
    assert "## The same laws over time steps" in written
    assert "### Free motion: order of convergence" in written
    html = render(page(tmp_path, report))
    assert 'id="steps"' in html
    assert html.count("<svg") == 2
    assert "error over CPU seconds" in html
    own = [r for r in SWEPT if not r.swept]
    assert swept(own) == []
    assert 'id="steps"' not in render(page(tmp_path, Report(summaries(own), own)))
