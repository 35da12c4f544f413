"""The result in plain words, which claim no more than the tests between rows support."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pytest_simbench.ground.text import LONGEST_LABEL, in_one_line
from pytest_simbench.measure.comparison import MARGIN
from pytest_simbench.measure.differences import Difference
from pytest_simbench.records.metrics import Metric, significant
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.document import listed
from pytest_simbench.report.model.pooling import COST, Spread
from pytest_simbench.report.model.summary import Row, TaskSummary

NAMED = 3
"""How many simulators a sentence names; the table below has them all."""

OUTCOMES = 2
"""Metrics that the headline names of a task of which the study has none with a good direction."""

TOLD_COSTS = ("cpu_cost", "ram")
"""Of the costs those that the headline names; they belong to the simulator alone."""


@dataclass(frozen=True)
class Standing:
    """What the differences at one metric make of the rows.

    Attributes:
        verdicts: of rows that were compared, by place. `ahead`: it beats another and is beaten by
            none; a mean alone puts nobody anywhere. `behind`: it is beaten. `apart`: it differs
            from another, and no direction is right. `same`: it is equivalent to all others.
            `open`: none of these.
        untold: why nobody is told apart, in words; empty where somebody is.
    """

    verdicts: Mapping[int, str]
    untold: str

    def who(self, verdict: str) -> list[int]:
        """The places of those that are this."""
        return [place for place, found in self.verdicts.items() if found == verdict]


def standing(name: str, summary: TaskSummary) -> Standing:
    """Who is ahead at the metric of that name, and whether anything can be told yet."""
    found = [d for d in summary.differences if d.metric.name == name]
    if not found:
        return Standing({}, "not compared")
    behind, ahead = ({getattr(d, side) for d in found} for side in ("loser", "winner"))
    verdicts = {}
    for place in sorted({place for d in found for place in (d.a, d.b)}):
        own = {d.verdict for d in found if place in (d.a, d.b)}
        verdicts[place] = (
            "behind" if place in behind
            else "ahead" if place in ahead
            else "apart" if "different" in own
            else "same" if own == {"equivalent"}
            else "open"
        )  # fmt: skip
    untold = ""
    if not {"behind", "apart"} & {*verdicts.values()}:  # who is ahead has somebody behind
        same = f"the same within {100 * MARGIN:g} points"
        untold = _untold(found) if "open" in verdicts.values() else same
    return Standing(verdicts, untold)


def _untold(found: Sequence[Difference]) -> str:
    undecided = [d for d in found if d.verdict == "undecided"]
    if not all(d.needs for d in undecided):
        return "not told apart"
    near = min(undecided, key=lambda d: d.needs - d.differ)  # both numbers of one pair of rows
    told = f"a difference needs at least {near.needs} pairs that differ"
    return f"{told}; so far {near.differ or 'none'}"


def sentences(summary: TaskSummary) -> list[str]:
    """One sentence for each of the study's metrics, and the failures."""
    found = [_compare(metric, summary) for metric in summary.study]
    failed = [
        f"{name} {row.failed} of {row.attempts}"
        for name, row in zip(summary.names, summary.rows, strict=True)
        if row.failed
    ]
    attempts = sum(row.attempts for row in summary.rows)
    if failed:
        found.append(f"crashes: {', '.join(failed)}.")
    elif attempts:
        found.append(f"crashes: none in {attempts} repetitions.")
    return [sentence for sentence in [*found, *summary.modes] if sentence]


def _compare(metric: Metric, summary: TaskSummary) -> str:
    """Who is ahead at one metric: only what the tests between the rows support."""
    texts = _values(metric, summary)
    if len(texts) < 2:
        return "".join(f"{metric.title}: {text}." for text in texts.values())
    found, every = standing(metric.name, summary), listed([*texts.values()], NAMED)
    if found.untold:
        return f"{metric.title}: {every}; {found.untold}."
    told = [d for d in summary.differences if d.metric.name == metric.name]
    if found.who("apart"):
        count = sum(d.verdict == "different" for d in told)
        many = f"{count} of {len(told)} pairs differ" if len(told) > 1 else "they differ"
        return f"{metric.title}: {every}; {many}, and no value is the right one."

    def those(*verdicts: str | None) -> list[str]:
        return [text for k, text in texts.items() if found.verdicts.get(k) in verdicts]

    ahead, behind, others = those("ahead"), those("behind"), those("same", "open", None)
    verb = "is" if len(ahead) == 1 else "are"
    leads = f"{listed(ahead, NAMED)} {verb} ahead" if ahead else "none is ahead"  # three in a ring
    # "of" only where it is true of each: one row that beats every one that is behind.
    won = [d for d in told if d.winner is not None]
    beaten = {d.loser for d in won if d.winner in found.who("ahead")}
    of_each = len(ahead) == 1 and beaten == set(found.who("behind"))
    over = f" of {listed(behind, NAMED)}" if of_each else f"; behind: {listed(behind, NAMED)}"
    by = f", by {_amount(won[0])}" if len(won) == 1 else ""
    rest = f"; not told apart: {listed(others, NAMED)}" if others else ""
    return f"{metric.title}: {leads}{over}{by}{rest}."


def _values(metric: Metric, summary: TaskSummary) -> Mapping[int, str]:
    """Name and value of each row that has one, by its place; the better ones first."""
    sign = 1 if metric.better == "lower" else -1
    known = [
        (place, value, summary.rows[place])
        for place, row in enumerate(summary.rows)
        if (value := row.metrics.get(metric.name)) is not None
    ]
    return {
        place: f"{summary.names[place]} {cells.mean_in_words(value, metric)}"
        + _finished(value.count, row)
        for place, value, row in sorted(known, key=lambda item: sign * item[1].mean)
    }


def _finished(count: int, row: Row) -> str:
    """Of how many repetitions a value is that not all have."""
    if row.failed and count == row.attempts - row.failed:
        return f" (of {count} that finished)"
    return f" ({count} of {row.attempts} repetitions)" if count < row.attempts else ""


def _amount(found: Difference) -> str:
    """How large a difference is, with its interval: `22 points [15, 29]`."""
    scale, unit = (100.0, "points") if found.metric.bounded else (1.0, found.metric.unit)
    ends = [] if found.low is None or found.high is None else [found.low, found.high]
    size, *told = (scale * abs(x) for x in (found.second - found.first, *ends))
    text = f"{significant(size)} {unit}".rstrip()
    return f"{text} [{', '.join(map(significant, sorted(told)))}]" if told else text


def headline(summaries: Sequence[TaskSummary]) -> list[str]:
    """A whole run in at most three sentences: what ran, what came of it, what it cost; they rank
    only what the corrected tests rank."""
    return [text for text in (_ran(summaries), _outcome(summaries), _cost(summaries)) if text]


def _ran(summaries: Sequence[TaskSummary]) -> str:
    rows = [row for summary in summaries for row in summary.rows]
    if not rows:
        return ""
    who = list(dict.fromkeys(row.simulator for row in rows))
    tasks = _and([summary.task for summary in summaries])
    attempts, failed = (sum(getattr(row, k) for row in rows) for k in ("attempts", "failed"))
    text = f"{_and(who) if len(who) == 1 else f'{len(who)} simulators'} did {tasks}: "
    text += f"{attempts} repetition{'s' * (attempts != 1)}, "
    if failed:
        counts = Counter[str]()
        for row in rows:
            counts[row.simulator] += row.failed
        told = _and([f"{_and([n])} {k}" for n, k in counts.items() if k])
        text += f"{failed} crashed ({told})"
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
    for metric in (COST[name] for name in TOLD_COSTS):
        for summary in summaries:
            values = [row.costs.get(metric.name) for row in summary.rows]
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
    found = standing(metric.name, summary)
    ahead, behind, apart = (
        _some([summary.names[place] for place in found.who(verdict)])
        for verdict in ("ahead", "behind", "apart")
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
    return listed([in_one_line(text, LONGEST_LABEL) for text in texts])
