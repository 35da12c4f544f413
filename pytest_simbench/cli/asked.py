"""What a user's test asks for: its task, how it is run, and what it claims of it.

pytest runs the test once, with an executor that makes up the records. So fixtures, marks and the
ini file count as always, nothing is simulated, and the claims are those that the test comes to."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import pytest

from pytest_simbench.cli.values import BadInput
from pytest_simbench.experiment.executor import Executor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import record_of, settings, versions
from pytest_simbench.experiment.repetition import Ended, Hooks
from pytest_simbench.laws import Law
from pytest_simbench.measure.verdicts import Bound
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.metrics import COSTS
from pytest_simbench.tuning.target import Claims


class Asked(NamedTuple):
    """The task in its case, claims about its metrics, and how the test failed nevertheless, in one
    line, or nothing."""

    experiment: Experiment
    claims: Claims
    failed: str


@dataclass(eq=False)
class _MadeUp:
    """A repetition that is right in all that has a right value."""

    experiment: Experiment
    number: int

    def run(self) -> Ended:
        task, case = self.experiment.task, self.experiment.case
        best = {m.name: 0.0 if m.better == "lower" else 1.0 for m in task.metrics}
        used = {"mean": 1.0, "peak": 1.0}
        record = record_of(
            self.experiment, self.number, status="ok", settings=settings(case),
            versions=versions(case), metrics={**best, **task.references}, seconds={"total": 1.0},
            resources={"cpu_percent": used, "rss_mb": used}, timeline={"start": 1.0, "end": 1.0},
            stepping=dict.fromkeys(("simulated", "wall", "cpu"), 1.0),
        )  # fmt: skip
        return record, None

    def kill(self) -> None:
        """Nothing runs."""


@dataclass(eq=False)
class _Asking(Executor):
    """In the place of the run's executor; also a plugin.

    Attributes:
        ids: what is in the brackets of the test's name, with our own part or without.
    """

    ids: str
    experiments: list[Experiment] = field(default_factory=list)
    told: list[str] = field(default_factory=list)
    jobs: int = 1

    def repetition(
        self, experiment: Experiment, number: int, hooks: Hooks | None = None
    ) -> _MadeUp:
        self.experiments.append(experiment)
        return _MadeUp(experiment, number)

    def pytest_sessionstart(self, session: pytest.Session) -> None:
        session.config.pluginmanager.get_plugin("simbench-session").run.executor = self  # type: ignore[union-attr]

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        names = {item.name: _ids(item) for item in items}
        items[:] = [item for item in items if not self.ids or self.ids in names[item.name]]
        if len(items) != 1 and names:
            found = ", ".join(f"[{ids[-1]}]" if ids[-1] else n for n, ids in names.items())
            self.told.append(f"it is {'several tests' if items else 'none of these'}: {found}")
            items.clear()

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self.told.append(_error(str(report.longrepr), "it cannot be collected"))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed or report.skipped:
            crash = getattr(report.longrepr, "reprcrash", None)
            text = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
            text = crash.message.partition("\n")[0] if crash else str(text)
            self.told.append(_error(text, text))

    def pytest_keyboard_interrupt(self, excinfo: pytest.ExceptionInfo[BaseException]) -> None:
        if not isinstance(excinfo.value, pytest.exit.Exception):
            raise KeyboardInterrupt
        self.told.append(str(excinfo.value))


def asked(test: str, options: Sequence[str]) -> Asked:
    """What the test `FILE.py::TEST` asks for.

    Args:
        test: its node id; behind it may stand the id of one of its parameters, [a].
        options: of pytest, for one simulator and profile.

    Raises:
        BadInput: no such test, it fails before it asks for a task, or asks for none or several.
    """
    name, _, ids = test.partition("[")
    asking, said = _Asking(ids.removesuffix("]")), io.StringIO()
    with TemporaryDirectory() as folder:
        out = Path(folder, "run")
        words = [name, f"--sim-output={out}", "--sim-reps=1", "--sim-headless", *options]
        words += ["-o", "sim_strict=false", "-p", "no:cacheprovider"]
        words += ["-n0"] if find_spec("xdist") else []  # in this process
        words += [f"--benchmark-storage={folder}"] if find_spec("pytest_benchmark") else []
        with redirect_stdout(said), redirect_stderr(said):
            pytest.main(words, plugins=[asking])
        told = asking.told[0] if asking.told else ""
        if not asking.experiments:
            lost = told or _error(said.getvalue(), "it asks for no task: call repeat(task) in it")
            raise BadInput(f"{test}: {' '.join(lost.split())}")
        claims = RunFolder(out).read().claims
    tasks = [experiment.task for experiment in asking.experiments]
    if len(tasks) > 1:
        raise BadInput(f"{test}: it repeats {len(tasks)} tasks; give a test that repeats one")
    if isinstance(tasks[0], Law):
        raise BadInput(f"{test}: it is about a law; tune for laws:{tasks[0].name}")
    known = {metric.name: metric for metric in (*COSTS, *tasks[0].metrics)}
    found: list[Any] = [
        (known[c.metric], Bound(c.relation, c.threshold))
        for c in claims
        if c.metric in known and c.relation and c.threshold is not None
    ]
    return Asked(asking.experiments[0], tuple(found), told)


def _ids(item: pytest.Item) -> tuple[str, ...]:
    """What may stand in the brackets of a test's name: all, and all but the simulator's part."""
    chosen = getattr(item, "callspec", None)
    if chosen is None:
        return ("",)
    variant = chosen.params.get("sim_case")
    own = variant.id_with(1) if variant is not None else ""
    return chosen.id, "-".join(part for part in chosen._idlist if part != own)


def _error(text: str, otherwise: str = "") -> str:
    """The last error in a text of pytest."""
    return str((re.findall(r"^(?:E  |ERROR: ) *(.*)", text, re.M) or [otherwise])[-1])
