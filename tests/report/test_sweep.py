"""Laws over time steps in the reports."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.measure.sweep import Swept, sweeps
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.notes import Notes
from pytest_simbench.records.phenomena import PHENOMENON
from pytest_simbench.records.readings import Reading
from pytest_simbench.records.record import Record
from pytest_simbench.report.markdown import run as markdown
from pytest_simbench.report.model import sweep
from pytest_simbench.report.model.summary import at_own_steps, summarise
from pytest_simbench.report.page.context import page
from pytest_simbench.report.page.render import render

from .samples import failed, record

METRICS = {"fall": (Metric("error", "error", "m", "lower", least=0),)}
STEPS = (0.002, 0.001, 0.0005)


def law(simulator: str, step: float, error: float | None, profile: str = "tuned") -> Record:
    settings = {"timestep": step, PHENOMENON: "free motion"}
    own = None if step == 0.001 else 0.001
    told = {"simulator": simulator, "task": "fall", "profile": profile, "settings": settings}
    if error is None:
        noted = Notes(own_timestep=own)
        return failed("Diverged", "measure", "it left the room", notes=noted, **told)
    notes = Notes(reading=Reading(1.0, 1.0, 10 * step), own_timestep=own)
    stepping = {"cpu": 1e-5 / step, "simulated": 1.0, "steps": 1 / step}
    metrics = {"error": error, "ratio": error / (10 * step)}
    return record(metrics=metrics, notes=notes, stepping=stepping, **told)


RECORDS = [
    *(law("mujoco", h, 8 * h) for h in STEPS),
    law("ode", 0.002, None), law("ode", 0.001, 0.02), law("ode", 0.0005, 0.02),
]  # fmt: skip


def found(records: list[Record] = RECORDS) -> list[Swept]:
    return sweeps(records, METRICS)


def test_the_table_tells_the_step_to_take() -> None:
    columns = {column.heading: column.cells for column in sweep.table(found())}
    assert columns["simulator"] == [["mujoco"], ["ode"]]
    assert columns["free motion"] == [["1/1 1ms", "0.010"], ["0/1"]]


def test_every_law_has_its_order_and_its_cheapest_steps() -> None:
    tables = dict(sweep.details(found()))
    order, kept, within, broken, failures = tables.values()
    assert [c.cells for c in order] == [[["fall"]], [["1.00 [1.00, 1.00]"]], [["0.00"]]]
    assert [c.cells for c in kept] == [[["fall"]], [["2ms", "0.0050"]], [["none"]]]
    assert [c.cells for c in within] == [[["fall"]], [["1ms", "0.010"]], [["none"]]]
    assert [c.cells for c in broken] == [[["ode"]], [["fall"]]]
    assert [c.cells for c in failures] == [
        [["ode"]], [["fall"]], [["2ms"]], [["it left the room"]]
    ]  # fmt: skip


def test_laws_that_no_step_helps_are_named() -> None:
    """1 ms may cost 0.01 here: one is better at its smallest step, the other at none."""
    records = [*RECORDS, *(law("dart", h, 0.02 * h / 0.001) for h in STEPS)]
    assert sweep.broken(found(records)) == [("ode", "fall")]
    assert sweep.BROKEN == "laws that no step keeps with the error that 1 ms may cost"
    assert sweep.BROKEN in dict(sweep.details(found(records)))
    assert sweep.BROKEN not in dict(sweep.details(found([law("a", h, 0.0) for h in STEPS])))


def test_profiles_are_told_apart() -> None:
    other = [law("mujoco", h, h, "default") for h in STEPS]
    assert list(sweep.labels(found([*RECORDS[:3], *other])).values()) == [
        "mujoco (default)",
        "mujoco (tuned)",
    ]


def test_the_terminal_tells_the_table_and_what_failed() -> None:
    lines = "\n".join(sweep.brief(found(), 80))
    assert "mujoco     1/1 1ms 0.010" in lines
    assert "ode fails fall at 2ms: it left the room" in lines
    assert "order of convergence" not in lines
    assert "order of convergence" in "\n".join(sweep.whole(found(), 80))


def test_laws_at_other_steps_are_in_no_other_table_and_other_tasks_are() -> None:
    stacking = record(settings={"timestep": 0.5}, notes=Notes(own_timestep=0.001))
    kept = at_own_steps([*RECORDS, stacking])
    assert [(r.simulator, r.settings["timestep"]) for r in kept] == [
        ("mujoco", 0.001), ("ode", 0.001), ("mujoco", 0.5)
    ]  # fmt: skip


@pytest.mark.parametrize("records", [RECORDS, RECORDS[0:1] + RECORDS[2:3]])
def test_markdown_and_page_hold_them(tmp_path: Path, records: list[Record]) -> None:
    """Also where no law ran at its profile's own step."""
    summaries = summarise(at_own_steps(records), METRICS)
    text = markdown.render_run(summaries, sweeps=found(records))
    assert "## The same laws over time steps" in text
    assert "### Free motion: order of convergence" in text
    html = render(page(tmp_path, summaries, records, sweeps=found(records)))
    assert 'id="steps"' in html
    assert html.count("<svg") == 2
    assert "error over CPU seconds" in html


def test_a_run_without_a_sweep_says_nothing_of_it(tmp_path: Path) -> None:
    own = [r for r in RECORDS if not r.swept]
    assert found(own) == []
    html = render(page(tmp_path, summarise(own, METRICS), own))
    assert 'id="steps"' not in html


def test_pictures_lie_in_the_run_folder(tmp_path: Path) -> None:
    paths = sweep.write_pictures(tmp_path, found())
    assert [path.name for path in paths] == [
        "sweep_free_motion_step.png",
        "sweep_free_motion_cost.png",
    ]
    assert all(path.stat().st_size > 5000 for path in paths)


@pytest.mark.parametrize("error", [0.0, None])
def test_a_law_without_an_error_to_draw_has_its_panel(tmp_path: Path, error: float | None) -> None:
    """One simulator that is exact, or fails, at every step."""
    paths = sweep.write_pictures(tmp_path, found([law("a", h, error) for h in (1e-3, 2e-3)]))
    assert [path.stat().st_size > 1000 for path in paths] == [True, True]
