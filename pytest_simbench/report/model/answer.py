"""The result of a task in plain words, which claims no more than the tests between rows support."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pytest_simbench.measure.comparison import MARGIN
from pytest_simbench.measure.differences import Difference
from pytest_simbench.records.metrics import Metric, significant
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.summary import Row, TaskSummary

NAMED = 3
"""How many simulators a sentence names; the table below has them all."""


def sentences(summary: TaskSummary) -> list[str]:
    """One sentence for each of the study's metrics, and the failures."""
    names = short_labels(summary.rows)
    found = [_compare(metric, summary, names) for metric in summary.study]
    failed = [
        f"{name} {row.failed} of {row.attempts}"
        for name, row in zip(names, summary.rows, strict=True)
        if row.failed
    ]
    attempts = sum(row.attempts for row in summary.rows)
    if failed:
        found.append(f"crashes: {', '.join(failed)}.")
    elif attempts:
        found.append(f"crashes: none in {attempts} repetitions.")
    return [sentence for sentence in [*found, *summary.modes] if sentence]


@dataclass(frozen=True)
class Standing:
    """What the differences at one metric make of the rows, by their places.

    Attributes:
        ahead: who beats another and is beaten by nobody.
        behind: who is beaten.
        apart: who differs from another at a metric of which no direction is right.
        same: who is equivalent to all others.
        open: who was compared, and is none of these.
        untold: why nobody is told apart, in words; empty where somebody is.
    """

    ahead: tuple[int, ...] = ()
    behind: tuple[int, ...] = ()
    apart: tuple[int, ...] = ()
    same: tuple[int, ...] = ()
    open: tuple[int, ...] = ()
    untold: str = "not compared"

    @property
    def by_place(self) -> dict[int, str]:
        """What each row is."""
        kinds = ("ahead", "behind", "apart", "same", "open")
        return {place: kind for kind in kinds for place in getattr(self, kind)}


def standing(name: str, summary: TaskSummary) -> Standing:
    """Who is ahead at the metric of that name, and whether anything can be told yet."""
    found = [d for d in summary.differences if d.metric.name == name]
    if not found:
        return Standing()
    rows = {place for d in found for place in (d.a, d.b)}
    behind = {d.loser for d in found} - {None}
    ahead = {d.winner for d in found} - {None} - behind
    apart = {place for d in found if d.verdict == "different" for place in (d.a, d.b)}
    unlike = {place for d in found if d.verdict != "equivalent" for place in (d.a, d.b)}
    same = rows - unlike
    left = rows - ahead - behind - apart - same
    untold = ""
    if not (ahead or behind or apart):
        untold = _untold(found) if left else f"the same within {100 * MARGIN:g} points"
    groups = [tuple(sorted(group)) for group in (ahead, behind, apart, same, left)]
    return Standing(groups[0], groups[1], groups[2], groups[3], groups[4], untold)


def _untold(found: Sequence[Difference]) -> str:
    undecided = [d for d in found if d.verdict == "undecided"]
    if not all(d.needs for d in undecided):
        return "not told apart"
    needs, differ = min(d.needs for d in undecided), max(d.differ for d in undecided)
    return f"a difference needs at least {needs} pairs that differ; so far {differ or 'none'}"


def short_labels(rows: Sequence[Row]) -> list[str]:
    """Names that tell the rows apart: mode, profile and test only where they differ."""
    modes = len({row.mode for row in rows}) > 1
    profiles = len({row.profile for row in rows}) > 1
    labels = []
    for row in rows:
        parts = [row.mode] * modes + [row.profile] * profiles + [row.test] * bool(row.test)
        labels.append(f"{row.simulator} ({', '.join(parts)})" if parts else row.simulator)
    return labels


def _compare(metric: Metric, summary: TaskSummary, names: Sequence[str]) -> str:
    """Who is ahead at one metric: only what the tests between the rows support.

    Ahead is who beats another and is beaten by nobody, behind who is beaten; a mean alone puts
    nobody anywhere.
    """
    sign = 1 if metric.better == "lower" else -1
    values = {
        place: value
        for place, row in enumerate(summary.rows)
        if (value := row.metrics.get(metric.name)) is not None
    }
    texts = {
        place: f"{names[place]} {cells.mean_in_words(value, metric)}"
        + _finished(value.count, summary.rows[place])
        for place, value in sorted(values.items(), key=lambda item: sign * item[1].mean)
    }
    if len(texts) < 2:
        return "".join(f"{metric.title}: {text}." for text in texts.values())
    found = standing(metric.name, summary)
    if found.untold:
        return f"{metric.title}: {_list([*texts.values()])}; {found.untold}."
    if found.apart:
        told = [d for d in summary.differences if d.metric.name == metric.name]
        count = sum(d.verdict == "different" for d in told)
        many = f"{count} of {len(told)} pairs differ" if len(told) > 1 else "they differ"
        return f"{metric.title}: {_list([*texts.values()])}; {many}, and no value is the right one."
    ahead = [text for place, text in texts.items() if place in found.ahead]
    behind = [text for place, text in texts.items() if place in found.behind]
    others = [text for place, text in texts.items() if place not in {*found.ahead, *found.behind}]
    verb = "is" if len(ahead) == 1 else "are"
    # "of" only where it is true of each: one row that beats every one that is behind.
    won = [d for d in summary.differences if d.metric.name == metric.name and d.winner is not None]
    beaten = {d.loser for d in won if d.winner in found.ahead}
    of_each = len(ahead) == 1 and beaten == set(found.behind)
    over = f" of {_list(behind)}" if of_each else f"; behind: {_list(behind)}"
    by = f", by {_amount(won[0])}" if len(won) == 1 else ""
    rest = f"; not told apart: {_list(others)}" if others else ""
    return f"{metric.title}: {_list(ahead)} {verb} ahead{over}{by}{rest}."


def _finished(count: int, row: Row) -> str:
    """Of how many repetitions a value is that a crashed one does not have."""
    return f" (of {count} that finished)" if row.failed and count < row.attempts else ""


def _amount(found: Difference) -> str:
    """How large a difference is, with its interval: `22 points [15, 29]`."""
    scale, unit = (100.0, "points") if found.metric.bounded else (1.0, found.metric.unit)
    ends = [] if found.low is None or found.high is None else [found.low, found.high]
    size, *told = (scale * abs(x) for x in (found.second - found.first, *ends))
    text = f"{significant(size)} {unit}".rstrip()
    return f"{text} [{', '.join(map(significant, sorted(told)))}]" if told else text


def _list(texts: Sequence[str]) -> str:
    shown = list(texts) if len(texts) <= NAMED + 1 else list(texts[:NAMED])
    if len(texts) > len(shown):
        return ", ".join(shown) + f" and {len(texts) - len(shown)} more"
    return " and ".join([", ".join(shown[:-1]), shown[-1]]) if len(shown) > 1 else shown[0]
