"""Whole reports, word for word, of made-up runs that hold a bit of everything."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, is_dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.description.carried import Carried, keep
from pytest_simbench.measure.gate import run_gate
from pytest_simbench.measure.limits import parse_limits
from pytest_simbench.measure.watching import Step
from pytest_simbench.records import repeatability
from pytest_simbench.records.claims import Claim
from pytest_simbench.records.description import TaskDescription, Threshold
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.notes import Notes, Wait
from pytest_simbench.records.tuned_on import Seen
from pytest_simbench.report.files import write_files, write_outcome, write_tables
from pytest_simbench.report.markdown.github import badge
from pytest_simbench.report.markdown.run import render_section as markdown
from pytest_simbench.report.model import watched
from pytest_simbench.report.model.outcome import RunOutcome
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.page.context import page
from pytest_simbench.report.terminal import parts
from pytest_simbench.report.terminal.run import render_brief, render_run, render_section
from tests.approval import assert_approved
from tests.measure.test_history import release
from tests.measure.test_law_history import row
from tests.measure.test_settling import end
from tests.records.test_repeatability import LINE, REPLAY
from tests.report.model.test_claims import FAILED, claim
from tests.report.model.test_laws import ERROR, LAWS, STEPS, law
from tests.report.model.test_laws import run as run_of_laws
from tests.report.model.test_transfer import OTHERS
from tests.report.model.test_transfer import run as run_of_policies
from tests.report.samples import METRICS, REFERENCES, STACKING, record, stacking_run, throwing_run

FLAT = re.compile(r"(?<=[{\[])\n\s+[^{}\[\]]*(?=[}\]])")
"""What holds nothing but numbers and texts in indented JSON."""


def tasks(folder: RunFolder) -> RunOutcome:
    """Two tasks, one also with a window: crashes, claims, thresholds, notes, and a comparison."""
    notes = Notes(
        log="logs/a.log", untested="seeds 1 to 9", filmed=True,
        chosen_on=(Seen(1001, 1002, task="stacking"),),
        wait=Wait(2.0, 60.0, "support of a", 1e-6, 0.002),
    )  # fmt: skip
    now = [r for r in (*stacking_run(), *throwing_run()) if r.repetition < 6]
    now += [replace(r, notes=notes, jitter=0.5) for r in stacking_run("gui") if r.repetition < 4]
    now.append(replace(record("mujoco", 10), status="interrupted"))
    now = [replace(r, settings={"timestep": 0.002, "task.settle": 60.0}) for r in now]
    used = {"cpu_percent": {"mean": 90.0}, "rss_mb": {"mean": 200.0}, "samples": 5}
    phases = {**now[0].resources, "phases": {"pick": used, "place": used}}
    now[0] = replace(now[0], resources=phases, reasons=("cube_07 slipped at 3.2 s",))
    for one in now:
        folder.append(one)
    folder.ask(Threshold(now[0].test, "placed", 0.5))
    undecided = claim("mujoco", "UNDECIDED", mean=0.95, low=0.8, n=9, advice="needs 3 more")
    for told in (claim("pybullet", crashed=3), FAILED, undecided):
        folder.claim(told)
    whole = Claim(now[0].test, "test_stacking", "mujoco", "headless", "tuned", "FAIL", advice="x")
    folder.claim(whole)
    better = [
        replace(r, metrics={**r.metrics, "placed": 1.0}, robot={"name": "panda"})
        for r in stacking_run()
        if r.ok
    ]
    better += [replace(r, robot={"name": "ur5"}, test="test_of_an_arm") for r in better[:2]]
    limits = parse_limits("placed:5%,ram:10%", STACKING)
    return RunOutcome(False, ("runs/before", run_gate(better, now, limits, METRICS)), looks=2)


def laws(folder: RunFolder) -> RunOutcome:
    """Laws on two simulators, one of them over time steps; and what is repeatable."""
    swept = [law("mujoco", "fall", 0.1 / h, step=h) for h in STEPS]
    swept += [law("drake", name, 9.0, step=h) for name in ("sag", "creep") for h in STEPS]
    swept += [law("ode", "fall", None if h == 0.002 else 2e-3 / h, step=h) for h in STEPS]
    for one in (*run_of_laws(), *swept, law("pybullet", "fall", 3.0, "default")):
        folder.append(one)
    for line in (LINE, REPLAY):
        repeatability.append(folder.path, line)
    return RunOutcome(True)


def releases(folder: RunFolder) -> RunOutcome:
    """A task and laws on several releases of an engine."""
    placed = {"1.10": 0.6, "1.2": 1.0, "1.9": 1.0, "1.11": 0.6}
    for version, share in placed.items():
        for one in release(version, share, ram=200 if version == "1.11" else 160, n=5):
            folder.append(one)
    for one in (*row("sag", 0.5, 0.5, 4.0, 4.0), *row("fall", 0.1, 0.1, None, 0.1)):
        folder.append(one)
    return RunOutcome()


def scene(folder: RunFolder) -> RunOutcome:
    """A user's scene that ends in two ways, also with moved starts and finer steps."""
    for one in (
        *(end(who, x) for who, x in (("a", 0.0), ("b", 0.9), ("c", 25.0))),
        *(end("a", x, moved=1e-4, seed=k) for k, x in ((1, 0.0), (2, 0.2))),
        *(end(who, x, step=0.0005) for who, x in (("a", 0.0), ("b", 0.1))),
    ):
        folder.append(replace(one, stepping={"cpu": 0.1, "simulated": 2.5, "wall": 0.1}))
    told = (
        Carried("geom size", "carried", ""),
        Carried("option wind", "not carried", "none", "all"),
    )
    keep(folder.path, Path("a.xml"), told)
    return RunOutcome(None)


def policies(folder: RunFolder) -> RunOutcome:
    """Three policies that four simulators rank differently."""
    for one in run_of_policies(**OTHERS):
        if one.repetition <= 6:
            folder.append(one)
    folder.describe(TaskDescription("pushing", (Metric("success", "success", kind="yes_no"),)))
    return RunOutcome(True)


RUNS = (tasks, laws, releases, scene, policies)


def plain(value: Any) -> Any:
    """For JSON."""
    return asdict(value) if is_dataclass(value) and not isinstance(value, type) else str(value)


def terminal(report: Report, folder: Path, width: int) -> Sequence[str]:
    """All that the terminal may show."""
    comparison = report.comparison
    tables, problems = write_tables(folder, None)
    return [
        parts.claim_lines(report.claims, width) if report.claims else "",
        render_brief(report.summaries, width),
        render_run(report.summaries, width),
        *(render_section(section, width) for section in report.sections),
        parts.render_histories(report.histories, width),
        *(
            line
            for whole in (False, True)
            for line in parts.sweep_lines(report.sweeps, width, whole)
        ),
        parts.render_changes(comparison[1], width, True) if comparison else "",
        parts.render_tables(tables, width),
        *problems,
    ]


@pytest.mark.parametrize("run", RUNS, ids=lambda run: run.__name__)
def test_a_whole_report(
    run: Callable[[RunFolder], RunOutcome], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)  # its drawings differ by its release
    folder = RunFolder(tmp_path)
    for name, metrics in {**METRICS, **dict.fromkeys(LAWS, ERROR)}.items():
        folder.describe(TaskDescription(name, metrics, REFERENCES.get(name, {})))
    outcome = run(folder)
    write_outcome(tmp_path, outcome)
    folder.close()
    reading = RunFolder(tmp_path).read()
    report = Report.of(reading, outcome)
    written = write_files(tmp_path, report)
    shown = json.dumps(page(tmp_path, report), indent=1, default=plain, ensure_ascii=False)
    known = [
        *(difference for summary in report.summaries for difference in summary.differences),
        *(pair for found in report.transfers for pair in (*found.pairs.values(), found.mmrv(0, 1))),
        *(vars(found).get("courses", found) for found in report.histories),
        *report.sweeps, *report.settled,
    ]  # fmt: skip
    texts = [
        *map(str, known),
        *written.problems,
        *((tmp_path / name).read_text() for name in ("report.md", "report.csv", "outcome.json")),
        *terminal(report, tmp_path, 80), *terminal(report, tmp_path, 130),
        badge(report.records, outcome.passed, reading.claims),
        FLAT.sub(lambda m: " ".join(m[0].split()), shown),
    ]  # fmt: skip
    assert_approved(f"report-{run.__name__}", "\n".join(texts).replace(str(tmp_path), "RUN"))


def test_a_watch() -> None:
    steps = [
        Step("mujoco", "3.3", "3.4", ("placed fell",) * 9, ("RAM rose",) * 12, day="2026-11-01"),
        Step("drake", "1.40", "1.41", (), (), day="2026-11-02"),
    ]
    told = watched.section(steps, ["mujoco 3.4 changed something."])
    assert_approved("report-watch", f"{markdown(told)}\n\n{render_section(told, 100)}")
