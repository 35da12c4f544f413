"""Whole runs of pytest in this process, whose repetitions are made up."""

from __future__ import annotations

import io
import re
import shlex
import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.records.record import Failure
from tests.approval import in_words
from tests.made_up import MadeUp

PYTESTS = re.compile(
    r"^[.Fxs]+(?=test_|$| +\[)( +\[100%\])?\n?|^[-=!]+ (gen|Keyb|stop).*\n"
    r"|(?<= in )[\d.]+s.*|^.*Keyb.*\n",
    re.M,
)
"""What pytest itself says."""


class Runs:
    """A plugin: how many landed follows from the test and the repetition's number.

    Attributes:
        landed: share from the second repetition on.
        cut: Ctrl-C comes in the repetition of this number of `test_claims`.
    """

    def __init__(self, landed: float, cut: int) -> None:
        self.landed, self.cut = landed, cut

    def pytest_sessionstart(self, session: pytest.Session) -> None:
        ours: Any = session.config.pluginmanager.get_plugin("simbench-session")
        ours.run.executor = MadeUp(1, self.end)
        self.run = ours.run

    def end(self, experiment: Experiment, number: int) -> tuple[dict[str, Any], None]:
        if number == self.cut:
            raise KeyboardInterrupt
        case = experiment.case
        early = self.run.expected() if not Path("cases").exists() else ()
        with Path("cases").open("a") as file:
            file.writelines(f"{e.task.name} may begin before {e.case.test}\n" for e in early)
            told = replace(case, robot=case.robot and case.robot.name)
            file.write(f"{in_words(told)}\n" * (number == 1))
        used = {"rss_mb": {"mean": 200.0 + number, "peak": 300.0}, "cpu_percent": {"mean": 50.0}}
        found = {
            "resources": used, "timeline": {"start": 1.0, "end": 1.0 + 0.1 * number},
            "stepping": {"simulated": 0.6, "wall": 0.1 * number, "cpu": 0.1},
        }  # fmt: skip
        if "crash" in experiment.case.test and number == 2:
            error = Failure("WorkerDied", "the worker died", "fall", "its last words")
            return {**found, "status": "failed", "error": error}, None
        landed = 1.0 if number == 1 else self.landed
        return {**found, "status": "ok", "metrics": {"landed": landed}}, None


def prepare(folder: Path, monkeypatch: pytest.MonkeyPatch, tests: str) -> None:
    """Make this the folder of the runs, with these tests."""
    pytest.importorskip("mujoco")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "summary.md")
    monkeypatch.delitem(sys.modules, "test_runs", raising=False)
    for name in ("matplotlib", "trimesh"):  # nothing is drawn
        monkeypatch.setitem(sys.modules, name, None)
    Path("test_runs.py").write_text(tests)
    Path("pytest.ini").write_text("[pytest]\nreps = 8\njunit_family = xunit1\n")


def run(words: str, landed: float = 0.5, cut: int = 99) -> str:
    """What was printed, the exit code, the badge, and JUnit's messages and properties."""
    said = io.StringIO()
    plain = "--sim=mujoco -q --tb=no -rN -n0 -p no:warnings --color=no --sim-badge=b.json"
    with redirect_stdout(said), redirect_stderr(said):
        code = pytest.main(
            [*plain.split(), "--junitxml=j.xml", *shlex.split(words)], plugins=[Runs(landed, cut)]
        )
    told = [f"$ pytest {words}", PYTESTS.sub("", said.getvalue()), f"exit code {int(code)}"]
    told += [Path("b.json").read_text()] if Path("b.json").exists() else []
    ran = Path("j.xml").exists()
    for case in ElementTree.parse("j.xml").iter("testcase") if ran else ():
        properties = [f"{p.get('name')}={p.get('value')}" for p in case.iter("property")]
        lost = [(e.get("message") or "").partition("\n")[0] for e in case if e.get("message")]
        lost += [f"text: {e.text}" for e in case if "Failed: " in (e.get("message") or "")]
        told += [f"{case.get('name')}: {', '.join([*lost, *properties])}"]
    text = "\n".join([*told, ""]).replace(f"{Path.cwd()}/", "DIR/")
    return re.sub(r"\n  (?=\S)", " ", text)  # where lines break the folder's length decides
