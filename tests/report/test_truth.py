"""Laws in the reports: the table of phenomena, its sentences, and every law's error."""

from __future__ import annotations

from pathlib import Path

from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.phenomena import PHENOMENON
from pytest_simbench.records.record import Record
from pytest_simbench.report.markdown import run as markdown
from pytest_simbench.report.model import truth
from pytest_simbench.report.model.summary import TaskSummary, summarise
from pytest_simbench.report.page.context import page
from pytest_simbench.report.page.render import render
from pytest_simbench.report.terminal.brief import render_brief
from pytest_simbench.report.terminal.run import render_run

from .samples import METRICS, failed, record, stacking_run

ERROR = (Metric("error", "error", "m", "lower", least=0), Metric("ratio", "ratio", "", "lower"))
LAWS = {"sag": "joints", "creep": "sticking", "stick": "sticking"}


def law(simulator: str, name: str, ratio: float | None, profile: str = "tuned") -> Record:
    """A record of one law; it failed where there is no ratio."""
    settings = {"timestep": 0.001, PHENOMENON: LAWS[name]}
    told = {"simulator": simulator, "task": name, "profile": profile, "settings": settings}
    if ratio is None:
        return failed("Diverged", "measure", "left the room", **told)
    return record(metrics={"error": ratio / 1000, "ratio": ratio}, **told)


def run() -> list[Record]:
    return [
        law("mujoco", "sag", 0.5), law("pybullet", "sag", 968.04),
        law("mujoco", "creep", 0.542), law("pybullet", "creep", 0.0),
        law("mujoco", "stick", 0.0), law("pybullet", "stick", None),
    ]  # fmt: skip


def summaries(records: list[Record]) -> list[TaskSummary]:
    return summarise(records, {**METRICS, **dict.fromkeys(LAWS, ERROR)})


def test_a_sentence_for_each_phenomenon() -> None:
    assert truth.sentences(summaries(run())) == [
        "for sticking: mujoco, which keeps 2 of 2 laws.",
        "for joints: mujoco, which keeps 1 of 1 laws.",
    ]


def test_no_clear_best_and_the_cheapest_of_those_that_nobody_beats() -> None:
    equal = [law("mujoco", "sag", 0.5), law("pybullet", "sag", 0.9)]
    (told,) = truth.sentences(summaries(equal))
    assert told == (
        "for joints: no clear best; laws kept of 1 by those that nobody beats: mujoco 1 and "
        "pybullet 1."
    )
    equal[1].stepping["cpu"] *= 0.4  # type: ignore[index]
    (told,) = truth.sentences(summaries(equal))
    assert told.endswith("; the cheapest of them: pybullet.")


def test_profiles_are_compared_each_by_itself() -> None:
    records = [
        *run()[:2],
        law("mujoco", "sag", 7.0, "default"),
        law("pybullet", "sag", 0, "default"),
    ]
    assert truth.sentences(summaries(records)) == [
        "for joints (default): pybullet, which keeps 1 of 1 laws.",
        "for joints (tuned): mujoco, which keeps 1 of 1 laws.",
    ]


def test_a_single_simulator_is_not_compared() -> None:
    assert truth.sentences(summaries(run()[::2])) == []


def test_the_table_counts_the_laws_kept_and_tells_the_worst() -> None:
    columns = {column.heading: column.cells for column in truth.table(summaries(run()))}
    assert columns["simulator"] == [["mujoco"], ["pybullet"]]
    assert columns["sticking"] == [["2/2 0.54x"], ["1/2 fails"]]
    assert columns["joints"] == [["1/1 0.5x"], ["0/1 968x"]]


def test_every_law_is_told_in_its_own_unit() -> None:
    found = dict(truth.details(summaries(run())))
    sticking = {column.heading: column.cells for column in found["laws of sticking"]}
    assert sticking["law"] == [["creep"], ["stick"]]
    assert sticking["error in"] == [["m"], ["m"]]
    assert sticking["mujoco"] == [["0.00054"], ["0"]]
    assert sticking["pybullet"] == [["0"], ["fails"]]
    joints = {column.heading: column.cells for column in found["laws of joints"]}
    assert joints["pybullet"] == [["0.97 (968x)"]]


def test_laws_come_first_and_have_no_tables_of_their_own() -> None:
    mixed = summaries([*stacking_run(), *run()])
    brief = render_brief(mixed, 100)
    assert brief.index("for sticking: mujoco") < brief.index("did stacking")
    assert "creep:" not in brief
    assert "CRASHED stick, pybullet" in brief
    whole = render_run(mixed, 100)
    assert whole.index("laws of sticking") < whole.index("did stacking")
    text = markdown.render_run(mixed)
    assert text.startswith("## Which simulator is right about what")
    assert text.index("### Laws of joints") < text.index("## stacking")


def test_without_laws_nothing_is_said_of_them() -> None:
    plain = summaries(stacking_run())
    assert truth.brief(plain, 80) == ""
    assert "laws" not in render_brief(plain, 100) + markdown.render_run(plain)


def test_the_page_holds_them_first(tmp_path: Path) -> None:
    records = [*stacking_run(), *run()]
    shown = page(tmp_path, summaries(records), records)
    assert shown.title == "3 laws and stacking"
    assert [part.title.partition(":")[0] for part in shown.tasks] == ["stacking"]
    html = render(shown)
    assert html.index('id="laws"') < html.index('id="task-1"')
    assert "1/2 fails" in html
    assert "0.97 (968x)" in html
