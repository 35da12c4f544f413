"""Do headless and GUI mode give the same results? Equivalence by two one-sided tests (TOST)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from pytest_simbench.measure.comparison import (
    ALPHA,
    MARGIN,
    Equivalence,
    equivalence,
    pairs_for_equivalence,
)
from pytest_simbench.records.configuration import text
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import RowKey, series, told


@dataclass(frozen=True)
class ModeComparison:
    """One metric of one simulator in both modes.

    Attributes:
        simulator, profile, test: what ran in both.
        pairs: seeds at which both modes have a value; a crashed one has the worst.
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
        fewest = pairs_for_equivalence(MARGIN)
        if self.pairs < fewest and abs(self.result.difference) < MARGIN:
            return (
                f"{name}: {found}; the same within {100 * MARGIN:g} points takes {fewest} or more."
            )
        return (
            f"{name}: not shown to be the same within {100 * MARGIN:g} points ({found}, "
            f"p = {self.result.p_value:.2g})."
        )


def compare_modes(records: Sequence[Record], metrics: Iterable[Metric]) -> list[ModeComparison]:
    """Every simulator that ran in both modes, at each of the study's shares, paired by seed."""
    shares = [metric for metric in metrics if metric.study and metric.bounded]
    sides: dict[tuple[RowKey, str], dict[str, dict[int, Record]]] = {}
    for row in series(record for record in records if record.status != "interrupted"):
        # The two modes of one test and configuration.
        key = (row.key._replace(mode=""), text(told(row.records)))
        sides.setdefault(key, {})[row.key.mode] = {record.seed: record for record in row.records}
    found = []
    for (of, _), modes in sides.items():
        if not {"headless", "gui"} <= set(modes):
            continue
        for metric in shares:
            pairs = [
                (one, other)
                for seed, first in sorted(modes["headless"].items())
                if (second := modes["gui"].get(seed)) is not None
                and (one := first.value(metric)) is not None
                and (other := second.value(metric)) is not None
            ]
            headless, gui = [one for one, _ in pairs], [other for _, other in pairs]
            result = equivalence(headless, gui, MARGIN) if len(pairs) >= 2 else None
            side = (of.simulator, of.profile, of.function)
            found.append(ModeComparison(*side, metric, len(pairs), result))
    return found
