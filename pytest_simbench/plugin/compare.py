"""The comparison with a baseline: `--sim-baseline`, `--benchmark-compare`, `--sim-compare-fail`."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.ground.text import for_terminal
from pytest_simbench.ground.versions import base_name
from pytest_simbench.measure.gate import gate_runs
from pytest_simbench.measure.limits import Limit, LimitError, parse_limits
from pytest_simbench.plugin import options
from pytest_simbench.records.baseline import FORMS, BaselineError, from_benchmarks, read_baseline
from pytest_simbench.records.folder import RunContents
from pytest_simbench.records.metrics import Metric, UnknownMetric
from pytest_simbench.records.series import short, side_by_side
from pytest_simbench.report.markdown.run import render_section
from pytest_simbench.report.model import changes
from pytest_simbench.report.model.outcome import Compared
from pytest_simbench.report.terminal.parts import render_changes as render_terminal

Beside = tuple[str, Sequence[str]]
"""A simulator, and others that are compared with it."""


@dataclass(eq=False)
class Comparison:
    """This run against a baseline: made when all tests have ended, shown in the summary.

    Attributes:
        baseline: the run to compare with.
        limits: how much worse each metric may get; without any, crashes alone can fail the run.
        typed: whether the limits are for this very run: one that compares nothing fails it.
        beside: a simulator of this very run, and its other versions, that are compared with it.
        found: name of the baseline and what differs from it; None when nothing was compared.
    """

    baseline: RunContents
    limits: Sequence[Limit]
    beside: Beside | None = None
    typed: bool = False
    found: Compared | None = field(default=None, init=False)

    def make(self, run: RunContents, skipped: Collection[str] = ()) -> None:
        """Compare with this run, which says what the metrics mean. Tests that it skipped give no
        result any more where the baseline has one: typed limits fail for that."""
        baseline = self.baseline
        if self.beside is not None:
            before, now = side_by_side(run.records, *self.beside)
            baseline, run = replace(baseline, records=before), replace(run, records=now)
        found = gate_runs(baseline, run, self.limits, typed=self.typed)
        gone = {*map(short, skipped)} - {short(r.test) for r in run.records}
        had = {r.name: None for r in baseline.records if r.ok and short(r.test) in gone}
        lost = [f"{name} is in the baseline, and was skipped" for name in had]
        if self.typed and lost:
            found = replace(found, broken=(*found.broken, *lost))
        self.found = baseline.name, found

    @property
    def failed(self) -> bool:
        """Whether a limit was exceeded or compared nothing, more repetitions crashed, or a test
        gives nothing any more."""
        return self.found is not None and bool(self.found[1].failures)

    def text(self, width: int) -> str:
        """For the terminal."""
        parts = [f"baseline: {self.baseline.name}", *self.baseline.problems]
        if self.found is None:
            parts.append("nothing was compared: no repetition was recorded")
        else:
            parts.append(render_terminal(self.found[1], width, bool(self.limits)))
        return for_terminal("\n".join(parts))

    def markdown(self) -> str:
        """For the page of a CI job."""
        if self.found is None:
            return ""
        told = changes.section(*self.found, bool(self.limits))
        return render_section(told) + "\n"


def prepare(
    config: pytest.Config, saved: list[dict[str, Any]], simulators: Sequence[str]
) -> Comparison | None:
    """The comparison that the options ask for; None when nothing is to be compared with.

    Limits in the ini file hold whenever there is a baseline and wait for one otherwise; limits on
    the command line need one. `saved` are the contents of the pytest-benchmark files that
    `--benchmark-compare` chose; of the run's simulators `--sim-baseline` may name one.

    Raises:
        pytest.UsageError: no baseline, a malformed one, a malformed limit, an unknown metric.
    """
    text = options.value(config, "sim_compare_fail")
    typed = options.given(config, "sim_compare_fail")
    beside = _beside(config, simulators)
    if beside is not None:
        here = RunContents(f"{beside[0]} in this run")
        return Comparison(here, _limits(text, here, typed=False), beside, typed)
    with options.refusing(BaselineError):
        baseline = _baseline(config, saved, needed=typed)
    limits = _limits(text, baseline, typed=typed) if baseline else ()
    return Comparison(baseline, limits, typed=typed) if baseline else None


def _beside(config: pytest.Config, names: Sequence[str]) -> Beside | None:
    """The simulator of this run that `--sim-baseline` names, if it names one.

    Raises:
        pytest.UsageError: no other version of it is in the run.
    """
    given = options.value(config, "sim_baseline")
    if given not in names:
        return None
    base = base_name(given)
    others = [name for name in names if base_name(name) == base and name != given]
    if not others:
        raise pytest.UsageError(
            f"--sim-baseline={given}: the run has no other version of {base} to compare with it; "
            f"write --sim={given},{base}==VERSION"
        )
    return given, others


def _baseline(
    config: pytest.Config, saved: list[dict[str, Any]], needed: bool
) -> RunContents | None:
    given = options.value(config, "sim_baseline")
    if given:
        return read_baseline(Path(config.invocation_params.dir, given))
    if saved:
        try:
            return from_benchmarks(saved[-1], _name(saved[-1]))
        except BaselineError:
            if needed:
                raise
            return None  # a run of other benchmarks: pytest-benchmark compares them
    if needed:
        raise BaselineError(
            "--sim-compare-fail needs a run to compare with: give --sim-baseline PATH "
            f"({FORMS}), or --benchmark-compare with a run that was saved"
        )
    return None


def _name(saved: Mapping[str, Any]) -> str:
    """A saved run, as the user reads it: when it was made and of which commit."""
    when = str(saved.get("datetime", ""))[:19].replace("T", " ")
    info = saved.get("commit_info")
    commit = str(info.get("id") or "")[:10] if isinstance(info, Mapping) else ""
    commit = "" if commit == "unversioned"[:10] else commit
    return f"the run saved {when} UTC" + (f", commit {commit}" if commit else "")


def _limits(text: str | None, baseline: RunContents, *, typed: bool) -> tuple[Limit, ...]:
    """The limits, each on a metric that the baseline has; none without a text.

    The ini file's hold for other runs too: what this baseline does not have is not compared, and
    the summary says so.

    Raises:
        pytest.UsageError: a malformed limit, an unknown metric.
    """
    if text is None:
        return ()
    metrics = {metric.name: metric for found in baseline.metrics.values() for metric in found}
    names = [name for record in baseline.records for name in record.metrics]
    if not typed:
        names += [part.partition(":")[0].strip() for part in text.split(",")]
    for name in dict.fromkeys(names):  # an older run does not say what kind of number it is
        metrics.setdefault(name, Metric(name, name, better="lower"))
    with options.refusing((LimitError, UnknownMetric), "--sim-compare-fail"):
        try:
            limits = parse_limits(text, metrics.values())
        except UnknownMetric as error:
            raise UnknownMetric(error.name, error.valid, " in the baseline") from None
    return limits
