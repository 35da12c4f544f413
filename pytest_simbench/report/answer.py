"""The result of a task in plain words, which claims no more than the intervals allow."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_simbench.measure.metrics import Metric
from pytest_simbench.report import cells
from pytest_simbench.report.pooling import Spread
from pytest_simbench.report.summary import Row, TaskSummary

NAMED = 3
"""How many simulators a sentence names; the table below has them all."""


def sentences(summary: TaskSummary) -> list[str]:
    """One sentence for each of the study's metrics that has a good direction, and the failures."""
    names = short_labels(summary.rows)
    found = [
        _compare(
            metric,
            [
                (name, row.metrics.get(metric.name))
                for name, row in zip(names, summary.rows, strict=True)
            ],
        )
        for metric in summary.study
        if metric.better is not None
    ]
    failed = [
        f"{name} {row.failed} of {row.attempts}"
        for name, row in zip(names, summary.rows, strict=True)
        if row.failed
    ]
    attempts = sum(row.attempts for row in summary.rows)
    if failed:
        found.append(f"failures: {', '.join(failed)}.")
    elif attempts:
        found.append(f"failures: none in {attempts} repetitions.")
    return [sentence for sentence in [*found, *summary.modes] if sentence]


def short_labels(rows: Sequence[Row]) -> list[str]:
    """Names that tell the rows apart: mode, profile and test only where they differ."""
    modes = len({row.mode for row in rows}) > 1
    profiles = len({row.profile for row in rows}) > 1
    labels = []
    for row in rows:
        parts = [row.mode] * modes + [row.profile] * profiles + [row.test] * bool(row.test)
        labels.append(f"{row.simulator} ({', '.join(parts)})" if parts else row.simulator)
    return labels


def _compare(metric: Metric, found: Sequence[tuple[str, Spread | None]]) -> str:
    """Who is best at one metric, and whether the intervals tell it apart from the others."""
    sign = -1 if metric.better == "higher" else 1
    ranked = sorted(
        ((name, value) for name, value in found if value is not None),
        key=lambda item: sign * item[1].mean,
    )
    if not ranked:
        return ""
    texts = [f"{name} {_value(value, metric)}" for name, value in ranked]
    best = ranked[0][1]
    if len(ranked) == 1:
        return f"{metric.title}: {texts[0]}."
    if any(value.low is None for _, value in ranked):
        return f"{metric.title}: {_list(texts)}; too few repetitions to compare."
    equal = [overlaps(best, value) for _, value in ranked]
    if all(equal):
        return f"{metric.title}: {_list(texts)}; the intervals overlap: no clear best."
    if not any(equal[1:]):
        return f"{metric.title}: {texts[0]} is ahead of {_list(texts[1:])}."
    near = [text for text, same in zip(texts, equal, strict=True) if same]
    behind = [text for text, same in zip(texts, equal, strict=True) if not same]
    return (
        f"{metric.title}: {_list(near)} lead with overlapping intervals; behind: {_list(behind)}."
    )


def overlaps(a: Spread, b: Spread) -> bool:
    """Whether the two intervals share a value."""
    if a.low is None or a.high is None or b.low is None or b.high is None:
        return True
    return a.low <= b.high and b.low <= a.high


def _value(found: Spread, metric: Metric) -> str:
    unit = "%" if metric.bounded else metric.unit
    text = f"{cells.metric_value(found.mean, metric)} {unit} {cells.interval(found, metric)}"
    return " ".join(text.split())


def _list(texts: Sequence[str]) -> str:
    shown = list(texts) if len(texts) <= NAMED + 1 else list(texts[:NAMED])
    if len(texts) > len(shown):
        return ", ".join(shown) + f" and {len(texts) - len(shown)} more"
    return " and ".join([", ".join(shown[:-1]), shown[-1]]) if len(shown) > 1 else shown[0]
