"""Do headless and GUI mode give the same results?"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from pytest_simbench.measure.comparison import MARGIN, FloatArray, alike, fewest_alike
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
            name = f"{of.simulator}, headless and gui, {metric.title}"
            found.append(f"{name}: {_told(np.array(pairs), metric.kind == 'yes_no')}.")
    return found


def _told(pairs: FloatArray, yes_no: bool) -> str:
    """The verdict in words, of pairs (n, 2)."""
    if len(pairs) < 2:
        return "too few common seeds to compare"
    headless, gui = pairs.T
    difference, fewest = (gui - headless).mean(), fewest_alike(MARGIN, yes_no=yes_no)
    found = f"gui {100 * difference:+.3g} points, {len(pairs)} common seeds"
    same = f"the same within {100 * MARGIN:g} points"
    if alike(headless, gui, MARGIN, yes_no=yes_no):
        return f"{same} ({found})"
    if len(pairs) < fewest and abs(difference) < MARGIN:
        return f"{found}; {same} takes {fewest} or more"
    return f"not shown to be {same} ({found})"
