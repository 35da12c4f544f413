"""Numbers as a reader sees them, and what columns are sorted by."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest

from pytest_simbench.records.metrics import Metric
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.document import Cell
from pytest_simbench.report.model.pooling import Spread

LATE = Metric("late", "late", unit="s")
FOUND = Spread(9, 1.0, 2.468, 4.0, 3.21, 1.5, 3.04, peak=17.6)
ONE = Spread(1, 2.0, 2.0, 2.0, 0.0, None, None)


@pytest.mark.parametrize(
    ("made", "of_many", "of_one"),
    [
        (lambda of: cells.spread(of, LATE), ["1 / 2.468 / 4", "[1.5, 3.04]"], ["2 / 2 / 2", ""]),
        (lambda of: cells.mean_first(of, LATE), ["2.468", "[1.5, 3.04]", "1 to 4"], ["2"]),
        (lambda of: cells.mean_interval(of, LATE), ["2.468", "[1.5, 3.04]"], ["2", ""]),
        (cells.cost, ["2.5", "[1.5, 3.0]"], ["2.0", ""]),
        (lambda of: cells.cost(of, 3), ["2.47", "[1.50, 3.04]"], ["2.00", ""]),
        (cells.sampled, ["2 +- 3", "[2, 3]", "(peak 18)"], ["2 +- 0"]),
    ],
)  # fmt: skip
def test_cells_of_a_mean(
    made: Callable[[Spread | None], Cell], of_many: Sequence[str], of_one: Sequence[str]
) -> None:
    assert made(FOUND) == Cell(of_many, 2.468)
    assert made(ONE) == Cell(of_one, 2.0)
    assert made(None) == Cell(["-"])
