"""The answer of a whole run in three sentences: what ran, what came of it, what it cost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from pytest_simbench.ground.text import LONGEST_LABEL, in_one_line
from pytest_simbench.records.metrics import COSTS, Metric
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.answer import NAMED, short_labels, standing
from pytest_simbench.report.model.pooling import Spread
from pytest_simbench.report.model.summary import Row, TaskSummary

OUTCOMES = 2
"""Metrics that the second sentence names of a task of which the study has none with a good
direction."""

TOLD_COSTS = ("cpu_cost", "ram")
"""Of the costs those that the third sentence names; they belong to the simulator alone."""


def headline(summaries: Sequence[TaskSummary]) -> list[str]:
    """At most three sentences; they rank only what the corrected tests rank."""
    return [text for text in (_ran(summaries), _outcome(summaries), _cost(summaries)) if text]


def cost_of(row: Row, name: str) -> Spread | None:
    """A row's cost by its metric's name, where all repetitions are pooled to a mean."""
    found = {"rtf": row.real_time_factor, "cpu_cost": row.cpu_cost}
    if name != "ram" or row.rss_mb is None:
        return found.get(name)
    use = row.rss_mb
    return Spread(row.finished, use.mean, use.mean, use.mean, use.std, use.low, use.high)


def _ran(summaries: Sequence[TaskSummary]) -> str:
    rows = [row for summary in summaries for row in summary.rows]
    if not rows:
        return ""
    names = list(dict.fromkeys(row.simulator for row in rows))
    who = _and(names) if len(names) == 1 else f"{len(names)} simulators"
    tasks = _and([summary.task for summary in summaries])
    attempts, failed = (sum(getattr(row, k) for row in rows) for k in ("attempts", "failed"))
    text = f"{who} did {tasks}: {attempts} repetition{'s' * (attempts != 1)}, "
    if failed:
        counts = Counter[str]()
        for row in rows:
            counts[row.simulator] += row.failed
        text += (
            f"{failed} crashed (" + _and([f"{_and([n])} {k}" for n, k in counts.items() if k]) + ")"
        )
    else:
        text += "none crashed"
    cut = sum(row.interrupted for row in rows)
    return text + (f", {cut} cut short" if cut else "") + "."


def _outcome(summaries: Sequence[TaskSummary]) -> str:
    clauses = []
    for summary in summaries:
        found: dict[str, list[str]] = {}
        ranked = [m for m in summary.metrics if m.better]
        shown = [m for m in ranked if m.study] or ranked[:OUTCOMES]
        for metric in [*shown, *(m for m in summary.metrics if m.study and not m.better)]:
            values = [row.metrics.get(metric.name) for row in summary.rows]
            if text := _who(metric, values, summary):
                found.setdefault(text, []).append(metric.title)
        task = _and([summary.task])
        clauses += [f"{task}, {_and(titles)}: {text}" for text, titles in found.items()]
    return f"Outcome: {'; '.join(clauses)}." if clauses else ""


def _cost(summaries: Sequence[TaskSummary]) -> str:
    found: dict[tuple[str, str], list[str]] = {}
    for metric in (cost for name in TOLD_COSTS for cost in COSTS if cost.name == name):
        for summary in summaries:
            values = [cost_of(row, metric.name) for row in summary.rows]
            if text := _who(metric, values, summary):
                found.setdefault((metric.title, text), []).append(summary.task)
    several = len(summaries) > 1
    clauses = [
        f"{title}{f', {_and(tasks)}' * several}: {text}" for (title, text), tasks in found.items()
    ]
    return f"Cost: {'; '.join(clauses)}." if clauses else ""


def _who(metric: Metric, values: Sequence[Spread | None], summary: TaskSummary) -> str:
    """Who is ahead and who behind; of a single row its value."""
    there = [value for value in values if value is not None]
    if len(there) < 2:
        return "".join(cells.mean_in_words(value, metric) for value in there)
    found, names = standing(metric.name, summary), short_labels(summary.rows)
    ahead, behind, apart = (
        _some([names[k] for k in who]) for who in (found.ahead, found.behind, found.apart)
    )
    if found.untold:
        return found.untold
    if apart:
        return f"{apart} differ, and no value is the right one"
    return f"{ahead} ahead (behind: {behind})" if ahead else f"behind: {behind}"


def _some(names: Sequence[str]) -> str:
    """The names, or how many where they are more than a sentence holds."""
    return _and(names) if len(names) <= NAMED else f"{len(names)} others"


def _and(texts: Sequence[str]) -> str:
    texts = [in_one_line(text, LONGEST_LABEL) for text in texts]
    return " and ".join([", ".join(texts[:-1]), texts[-1]]) if len(texts) > 1 else "".join(texts)
