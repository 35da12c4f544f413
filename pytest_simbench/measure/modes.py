"""Do headless and GUI mode give the same results? Equivalence by two one-sided tests (TOST)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

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


def compare_modes(records: Sequence[Record], metrics: Iterable[Metric]) -> list[str]:
    """A sentence for each simulator that ran in both modes and each of the study's shares, paired
    by seed; a crashed repetition has the worst value."""
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
            name = f"{of.simulator}, headless and gui, {metric.title}"
            found.append(f"{name}: {_told(result, len(pairs))}.")
    return found


def _told(result: Equivalence | None, pairs: int) -> str:
    """The verdict in words; there is no result of fewer than two pairs."""
    if result is None:
        return "too few common seeds to compare"
    found = f"gui {100 * result.difference:+.3g} points, {pairs} common seeds"
    same = f"the same within {100 * MARGIN:g} points"
    if result.equivalent(ALPHA):
        return f"{same} ({found})"
    fewest = pairs_for_equivalence(MARGIN)
    if pairs < fewest and abs(result.difference) < MARGIN:
        return f"{found}; {same} takes {fewest} or more"
    return f"not shown to be {same} ({found}, p = {result.p_value:.2g})"
