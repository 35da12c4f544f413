"""`simbench bisect NAME:GOOD..BAD METRIC`: the first release in which a metric is worse.

Each step is a pytest run of its own, with the same tests and options, on one more release. All of
them lie in one folder, that of `--sim-history` with the same settings: what is recorded there is
not run again.

Which folder that is depends on all options, and on the ini file. So the command starts pytest,
whose plugin knows them and calls `bisect`.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from pytest_simbench.cli.values import BadInput, Span, shown
from pytest_simbench.client import package_index
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.measure.bisection import (
    between,
    difference,
    first_worse,
    like_the_bad_one,
    steps,
)
from pytest_simbench.measure.limits import CRASHED, named
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.metrics import Metric, UnknownMetric
from pytest_simbench.records.series import series
from pytest_simbench.simulator.registry import adapter


def bisect(wanted: Span, metric_name: str, folder: Path, arguments: Sequence[str]) -> int:
    """Find it, say so, and return the exit code: 1 where the bad release is not worse. See `Search`
    for the arguments.

    Raises:
        BadInput: no such simulator, release or metric; a run that ends with an error.
        SimulatorError: no such simulator, or no package index answers.
    """
    releases = _releases(wanted)
    search = Search(wanted.name, metric_name, releases, folder, arguments)
    last = len(releases) - 1
    print(
        f"bisecting {len(releases)} releases of {wanted.name}: {steps(len(releases))} steps, and "
        "the ends"
    )
    search.run(0, last)
    metric = search.metric()
    good, bad = search.result(0), search.result(last)
    for end, place in ((good, 0), (bad, last)):
        if not (end.values(metric.name) if metric.name in end.known else len(end)):
            raise BadInput(f"{search.describe(place)}, so nothing tells worse")
    found = difference(metric, good, bad)
    if not found.significant():
        print(
            f"{search.describe(0)}, {search.describe(last)}: these repetitions do not show that it "
            f"is worse (p = {found.p_value:.2g}), so there is nothing to find; try more of them, "
            "--reps 40 for instance"
        )
        return 1

    def is_worse(place: int) -> bool:
        search.run(place)
        worse = like_the_bad_one(metric, good, bad, search.result(place))
        print(f"{search.describe(place)}: {'worse' if worse else 'good'}", flush=True)
        return worse

    place = first_worse(len(releases), is_worse)
    before = search.result(place - 1)
    p_value = difference(metric, before, search.result(place)).p_value if before.ok else 1.0
    print(
        f"the first worse release is {releases[place]}: {search.describe(place - 1)}, "
        f"{search.describe(place)} (p = {p_value:.2g})"
    )
    print(f"results: {search.folder}")
    return 0


def start(span: Span, metric: str, arguments: Sequence[str]) -> int:
    """Have the plugin of pytest call `bisect` for these tests and options; pytest's exit code."""
    releases = f"{span.name}:{span.good}..{span.bad}"
    own = [sys.modules[__name__]]  # tells the plugin who asks
    return int(pytest.main([*arguments, "--sim-bisect", releases, metric], plugins=own))


def _releases(wanted: Span) -> list[str]:
    """The releases from the good one to the bad one.

    Raises:
        BadInput: no such simulator or release; one sentence.
    """
    info = adapter(wanted.name).info
    known = package_index.releases(info.distribution)
    for version in (wanted.good, wanted.bad):
        problem = package_index.unreleased(info.distribution, version, known)
        if problem or version not in known:
            raise BadInput(problem or f"write {version} in full")
        if refused := info.refused(version):
            raise BadInput(refused)
    return between(known, wanted.good, wanted.bad)


@dataclass(frozen=True)
class Search:
    """The runs of a bisection.

    Attributes:
        simulator: whose releases are compared.
        metric_name: what is looked at.
        releases: from the good one to the bad one.
        folder: of all runs.
        arguments: tests and options of each run.
    """

    simulator: str
    metric_name: str
    releases: Sequence[str]
    folder: Path
    arguments: Sequence[str]

    def run(self, *places: int) -> None:
        """Run the tests on some of the releases, unless the folder holds that."""
        names = ",".join(self._name(place) for place in places)
        keep = "--sim-resume" if RunFolder(self.folder).holds_run else "--sim-output"
        command = [
            *(sys.executable, "-m", "pytest", *self.arguments, f"{keep}={self.folder}"),
            *(f"--sim-name={names}", "--sim-install-missing", "-q"),
        ]
        done = subprocess.run(
            command, text=True, errors="replace",
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
        )  # fmt: skip
        if done.returncode not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
            lines = [line for line in done.stdout.splitlines() if line.strip()]
            raise BadInput(
                f"the run on {names} ended with exit code {done.returncode}: "
                f"{for_terminal(' '.join(lines[-3:]))[:600]}"
            )

    def metric(self) -> Metric:
        """What is looked at.

        Raises:
            BadInput: no test has it, or several have, or neither direction is worse.
        """
        name, result = self.metric_name, self.result(0)
        if named(name, result.known) == CRASHED.name:
            return CRASHED
        try:
            metric = result.metric(name)
        except UnknownMetric as error:
            raise BadInput(str(error)) from None
        if metric.better is None:
            raise BadInput(f"{name} can be neither better nor worse")
        return metric

    def result(self, place: int) -> ResultSet:
        """What a release scored.

        Raises:
            BadInput: the folder holds nothing of it, or several tests.
        """
        reading = RunFolder(self.folder).read()
        rows = [
            row
            for task in reading.metrics
            for row in series(r for r in reading.records if r.task == task)
            if row.key.simulator == self._name(place)
        ]
        if len(rows) > 1:
            names = {task: [m.name for m in known] for task, known in reading.metrics.items()}
            rows = [r for r in rows if self.metric_name in names[r.records[0].task]]
        if len(rows) != 1:
            what = "no test" if not rows else "more than one test"
            raise BadInput(
                f"{what} with {shown(self.metric_name)} has run on "
                f"{self._name(place)}; choose one test, with its file or with -k"
            )
        records = rows[0].records
        return ResultSet(records, reading.metrics[records[0].task])

    def describe(self, place: int) -> str:
        """What a release scored, in words."""
        name, result = self.metric_name, self.result(place)
        crashed = f", {len(result.crashed)} crashed" if result.crashed else ""
        if name in result.known and result.values(name):
            mean = result.metric(name).format(result.interval(name).mean)
            return f"{self.releases[place]} {name} {mean}{crashed}"
        return f"{self.releases[place]} {len(result.crashed)} of {len(result)} crashed"

    def _name(self, place: int) -> str:
        return f"{self.simulator}=={self.releases[place]}"
