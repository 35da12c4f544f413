"""The runs of a bisection: each a pytest run of its own, all in one folder."""

from __future__ import annotations

import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from pytest_simbench.cli.values import BadInput, refusing, shown
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.measure.limits import named
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.metrics import COSTS, CRASHED, Metric, UnknownMetric
from pytest_simbench.records.series import series


@dataclass(frozen=True)
class Search:
    """The runs of a bisection.

    Attributes:
        simulator: whose releases are compared.
        metric_name: what is looked at.
        releases: from the good one to the bad one.
        folder: of all runs.
        arguments: tests and options of each run.
        ran: tests of these runs, as JUnit names them (the folder holds others too), and why one
            repeated no task, or "".
    """

    simulator: str
    metric_name: str
    releases: Sequence[str]
    folder: Path
    arguments: Sequence[str]
    ran: dict[str, str] = field(default_factory=dict)

    def run(self, *places: int) -> None:
        """Run the tests on some of the releases, unless the folder holds that.

        Raises:
            BadInput: the run ends with an error, or the folder holds repetitions that are not
                comparable with those of now.
        """
        names = ",".join(self.named(place) for place in places)
        keep = "--sim-resume" if RunFolder(self.folder).holds_run else "--sim-output"
        with TemporaryDirectory() as own:
            judged = Path(own, "tests.xml")
            command = [
                *(sys.executable, "-m", "pytest", *self.arguments, f"{keep}={self.folder}"),
                *(f"--sim-name={names}", "--sim-install-missing", "-q", f"--junitxml={judged}"),
                "--junitprefix=",
            ]
            done = subprocess.run(
                command, text=True, errors="replace", stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
            )  # fmt: skip
            tests = [*ET.parse(judged).iter("testcase")] if judged.exists() else []
        if done.returncode not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
            lines = [line for line in done.stdout.splitlines() if line.strip()]
            raise BadInput(
                f"the run on {names} ended with exit code {done.returncode}: "
                f"{for_terminal(' '.join(lines[-3:]))[:600]}"
            )
        for test in tests:
            name = f"{test.get('classname')}.{test.get('name')}"
            why = "".join(part.get("message", "") for part in test).partition("\n")[0]
            if " is not resumed, " in why:
                told = for_terminal(why.removeprefix("Failed: "))
                raise BadInput(f"{told}; remove that folder to run all anew")
            repeated = any("repetitions" in p.get("name", "") for p in test.iter("property"))
            self.ran[name] = "" if repeated else why or "it repeats no task"

    def metric(self) -> Metric:
        """What is looked at.

        Raises:
            BadInput: no test has it, or several have, or neither direction is worse.
        """
        name, result = self.metric_name, self.result(0)
        if named(name, result.known) == CRASHED.name:
            return CRASHED
        with refusing(UnknownMetric):
            metric = result.metric(name)
        if metric.better is None:
            raise BadInput(f"{name} can be neither better nor worse")
        return metric

    def result(self, place: int) -> ResultSet:
        """What a release scored.

        Raises:
            BadInput: the folder holds nothing of it, several tests, or several tasks of one.
        """
        reading = RunFolder(self.folder).read()
        rows = [
            row
            for task in reading.metrics
            for row in series(r for r in reading.records if r.task == task)
            if row.key.simulator == self.named(place)
            and self.ran.get(_in_junit(row.records[0].test)) == ""
        ]
        every, name = (*COSTS, CRASHED), named(self.metric_name)
        names = {task: {m.name for m in (*own, *every)} for task, own in reading.metrics.items()}
        if len(rows) > 1 or any(name in known for known in names.values()):
            rows = [r for r in rows if name in names[r.records[0].task]]
        if len(rows) != 1:
            what = "more than one test" if rows else "no test"
            how = "choose one test, with its file or with -k"
            if len({row.records[0].test for row in rows}) == 1:
                what, how = "more than one task of a test", "repeat each in a test of its own"
            whys = [why for test, why in self.ran.items() if why and self.named(place) in test]
            told = f" ({for_terminal(whys[0])})" if whys and not rows else ""
            raise BadInput(
                f"{what} with {shown(self.metric_name)} has run on {self.named(place)}{told}; {how}"
            )
        records = rows[0].records
        return ResultSet(records, reading.metrics[records[0].task])

    def describe(self, place: int) -> str:
        """What a release scored, in words."""
        name, result = self.metric_name, self.result(place)
        crashed = f", {len(result.crashed)} crashed" if result.crashed else ""
        if name in result.known:
            mean = result.metric(name).format(result.interval(name).mean)
            mean = mean if result.values(name) else "is not there"
            return f"{self.releases[place]} {name} {mean}{crashed}"
        return f"{self.releases[place]} {len(result.crashed)} of {len(result)} crashed"

    def named(self, place: int) -> str:
        """A release as a simulator's name."""
        return f"{self.simulator}=={self.releases[place]}"


def _in_junit(test: str) -> str:
    """A test's id as JUnit names its class and itself together."""
    name, bracket, rest = test.partition("[")
    return name.replace("/", ".").replace(".py::", ".").replace("::", ".") + bracket + rest
