"""Strip plots: for each metric a line for each row, on it one dot for each repetition.

Drawn by the template as SVG whose lengths are shares of its width, so that it fits any screen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from pytest_simbench.ground.text import for_figure
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record, Who
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.pooling import COST, spread
from pytest_simbench.report.model.summary import Row, TaskSummary

HEIGHT = 36
"""Of a line [px]."""

COLUMN = 5
"""Dots above each other; more of one value stand side by side."""

STEP = 6.5
"""Between two of them [px]."""

LEFT, RIGHT = 2.0, 91.0
"""Where the smallest and the largest value lie [% of the width]."""

LOST = 96.5
"""Where repetitions without a value lie [% of the width]."""

NEAR = 1.2
"""Dots that are closer than this [% of the width] are moved apart, up and down."""

LOGARITHMIC = 20
"""Costs that differ by more than this factor are drawn on a logarithmic scale."""

MOST = 200
"""Dots of a line; of more repetitions some are drawn: the ends, and others at equal steps. Ten
thousand would make a page of 17 MB, and nobody can press one of them."""

SHOWN_COSTS = ("cpu_cost", "rtf", "ram", "start", "end")


@dataclass(frozen=True)
class Dot:
    """One repetition.

    Attributes:
        number: its place among all repetitions of the page.
        x: where it lies [% of the width].
        aside, y: moved to the right of there, and down from the line's top [px].
        value: in words.
    """

    number: int
    x: float
    aside: float
    y: float
    value: str


@dataclass(frozen=True)
class StripLine:
    """One row: its repetitions with a value, those without, mean and interval [% of the width],
    which are of all repetitions; and what is not drawn, if anything is not, in words."""

    label: str
    of: Who
    dots: Sequence[Dot]
    lost: Sequence[Dot]
    mean: float | None
    low: float | None
    high: float | None
    left_out: str


@dataclass(frozen=True)
class Strip:
    """The plot of one metric.

    Attributes:
        ticks: place [% of the width] and text.
        reference: where a perfect run would lie [% of the width].
        study: whether it is shown at once, not only when it is opened.
    """

    title: str
    doc: str
    lines: Sequence[StripLine]
    ticks: Sequence[tuple[float, str]]
    reference: float | None
    study: bool
    logarithmic: bool

    @property
    def lost(self) -> bool:
        return any(line.lost for line in self.lines)


def strips(summary: TaskSummary, number: Callable[[Record], int]) -> list[Strip]:
    """A plot for each metric and cost that any repetition has; records have numbers on the page."""
    own = {metric.name for metric in summary.metrics}
    costs = [COST[name] for name in SHOWN_COSTS if name not in own]
    plots = [_strip(metric, summary, number) for metric in (*summary.metrics, *costs)]
    return [plot for plot in plots if plot is not None]


def _strip(metric: Metric, summary: TaskSummary, number: Callable[[Record], int]) -> Strip | None:
    cost = metric not in summary.metrics
    known = [
        [(r, _finite(r, r.cost(metric.name) if cost else r.metrics.get(metric.name)))
         for r in row.records]
        for row in summary.rows
    ]  # fmt: skip
    every = [v for row in known for _, v in row if v is not None]
    reference = None if cost else summary.references.get(metric.name)
    if not every:
        return None
    low, high = min(every), max(every)
    if metric.bounded and low >= 0 and high <= 1:
        low, high = 0.0, 1.0
    elif reference is not None and math.isfinite(reference):
        low, high = min(low, reference), max(high, reference)
    if low < high:  # what means nothing is not drawn as wide as what does
        high = max(high, low + metric.smallest_difference)
    log = cost and low > 0 and high / low > LOGARITHMIC
    scale = _scale(low, high, log)

    def line(row: Row, label: str, found: Sequence[tuple[Record, float | None]]) -> StripLine:
        there = [(r, v) for r, v in found if v is not None]
        drawn = _some(there, by=lambda item: item[1])
        lost = _some([r for r, v in found if v is None])
        pooled = None if cost else row.metrics.get(metric.name)  # with crashes, as in the tables
        pooled = pooled or spread([v for _, v in there])
        ends = (pooled.mean, pooled.low, pooled.high) if pooled else (None, None, None)
        bar, low_end, high_end = (None if end is None else scale(end) for end in ends)
        count = len(drawn) + len(lost)
        return StripLine(
            for_figure(label),
            row.of,
            _swarm([(number(r), scale(v), _text(v, metric)) for r, v in drawn]),
            _swarm([(number(r), LOST, "") for r in lost]),
            bar,
            low_end,
            high_end,
            f"{count} of {len(found)} repetitions drawn" if count < len(found) else "",
        )

    return Strip(
        for_figure(cells.heading(metric)),
        metric.doc,
        [line(*each) for each in zip(summary.rows, summary.names, known, strict=True)],
        [(scale(v), cells.metric_value(v, metric)) for v in _ticks(low, high, log)],
        None if reference is None or not math.isfinite(reference) else scale(reference),
        metric.study and not cost,
        log,
    )


T = TypeVar("T")


def _some(found: Sequence[T], by: Callable[[T], float] = lambda item: 0.0) -> Sequence[T]:
    """At most `MOST` of them: those at both ends, and others at equal steps, in their order."""
    if len(found) <= MOST:
        return found
    places = {k * len(found) // (MOST - 2) for k in range(MOST - 2)}
    values = [by(item) for item in found]
    places |= {values.index(min(values)), values.index(max(values))}
    return [found[k] for k in sorted(places)]


def _scale(low: float, high: float, log: bool) -> Callable[[float], float]:
    """From values to shares of the width [%]."""
    if high <= low:
        return lambda value: (LEFT + RIGHT) / 2
    of = math.log10 if log else float
    ends = of(low), of(high)
    return lambda value: round(float(np.interp(of(value), ends, (LEFT, RIGHT))), 2)


def _ticks(low: float, high: float, log: bool) -> list[float]:
    """Both ends and what lies between them."""
    if log:
        return [low, math.sqrt(low * high), high]
    return [low + (high - low) * k / 4 for k in range(5)] if low < high else [low]


def _swarm(found: Sequence[tuple[int, float, str]]) -> list[Dot]:
    """Dots that lie on each other are moved apart: up and down, many of them also aside."""
    piles: list[list[tuple[int, float, str]]] = []
    for item in sorted(found, key=lambda dot: (dot[1], dot[0])):
        if piles and item[1] - piles[-1][0][1] < NEAR:
            piles[-1].append(item)
        else:
            piles.append([item])
    dots = []
    for pile in piles:
        columns = -(-len(pile) // COLUMN)
        tall = -(-len(pile) // columns)
        for place, (number, x, value) in enumerate(pile):
            column, k = divmod(place, tall)
            high = min(tall, len(pile) - column * tall)
            aside = STEP * (column - (columns - 1) / 2)
            y = HEIGHT / 2 + STEP * (k - (high - 1) / 2)
            dots.append(Dot(number, x, round(aside, 1), round(y, 1), value))
    return dots


def _text(value: float, metric: Metric) -> str:
    return f"{cells.metric_value(value, metric)} {cells.unit(metric)}".rstrip()


def _finite(record: Record, value: float | None) -> float | None:
    """The value of a repetition that was finished; none of one that failed, as in the tables."""
    return float(value) if record.ok and value is not None and math.isfinite(value) else None
