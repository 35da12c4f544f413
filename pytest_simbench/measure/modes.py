"""Do headless and GUI mode give the same results? Equivalence by two one-sided tests (TOST)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from pytest_simbench.measure.comparison import ALPHA, Equivalence, equivalence
from pytest_simbench.records.configuration import text
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import series, told
from pytest_simbench.tasks.metrics import Metric

MARGIN = 0.05
"""Shares that differ by less than this count as the same: not a whole cube of 15."""


@dataclass(frozen=True)
class ModeComparison:
    """One metric of one simulator in both modes.

    Attributes:
        simulator, profile, test: what ran in both.
        pairs: seeds that both modes finished.
        result: of the tests; None for fewer than two pairs.
    """

    simulator: str
    profile: str
    test: str
    metric: Metric
    pairs: int
    result: Equivalence | None

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        name = f"{self.simulator}, headless and gui, {self.metric.title}"
        if self.result is None:
            return f"{name}: too few common seeds to compare."
        points = 100 * self.result.difference
        found = f"gui {points:+.3g} points, {self.pairs} common seeds"
        if self.result.equivalent(ALPHA):
            return f"{name}: the same within {100 * MARGIN:g} points ({found})."
        return (
            f"{name}: not shown to be the same within {100 * MARGIN:g} points ({found}, "
            f"p = {self.result.p_value:.2g})."
        )


def compare_modes(records: Sequence[Record], metrics: Iterable[Metric]) -> list[ModeComparison]:
    """Every simulator that ran in both modes, at each of the study's shares, paired by seed."""
    shares = [metric for metric in metrics if metric.study and metric.bounded]
    sides: dict[tuple[object, ...], dict[str, dict[int, Record]]] = {}
    named: dict[tuple[object, ...], tuple[str, str, str]] = {}
    for row in series(record for record in records if record.ok):
        of = row.key
        # The two modes of one test and configuration.
        key = (*of._replace(mode=""), text(told(row.records)))
        named[key] = (of.simulator, of.profile, of.function)
        sides.setdefault(key, {})[of.mode] = {record.seed: record for record in row.records}
    found = []
    for side, modes in sides.items():
        simulator, profile, test = named[side]
        if not {"headless", "gui"} <= set(modes):
            continue
        for metric in shares:
            pairs = [
                (first.metrics[metric.name], second.metrics[metric.name])
                for seed, first in sorted(modes["headless"].items())
                if (second := modes["gui"].get(seed)) is not None
                and first.metrics.get(metric.name) is not None
                and second.metrics.get(metric.name) is not None
            ]
            result = None
            if len(pairs) >= 2:
                headless, gui = zip(*pairs, strict=True)
                result = equivalence(headless, gui, MARGIN)
            found.append(ModeComparison(simulator, profile, test, metric, len(pairs), result))
    return found
