"""The result of a task in plain words, which claims no more than the tests between rows support."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pytest_simbench.measure.intervals import FEWEST
from pytest_simbench.records.metrics import Metric
from pytest_simbench.report import cells
from pytest_simbench.report.summary import Row, TaskSummary

NAMED = 3
"""How many simulators a sentence names; the table below has them all."""


def sentences(summary: TaskSummary) -> list[str]:
    """One sentence for each of the study's metrics that has a good direction, and the failures."""
    names = short_labels(summary.rows)
    found = [
        _compare(metric, summary, names) for metric in summary.study if metric.better is not None
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


@dataclass(frozen=True)
class Standing:
    """What the corrected tests say of the rows at one metric, by the rows' places.

    Attributes:
        ahead: who beats another and is beaten by nobody.
        behind: who is beaten.
        level: who was compared, and is neither.
    """

    ahead: tuple[int, ...] = ()
    behind: tuple[int, ...] = ()
    level: tuple[int, ...] = ()


def standing(name: str, counts: Sequence[int], summary: TaskSummary) -> Standing:
    """Who is ahead at a metric; nobody where fewer than two rows have enough repetitions.

    Args:
        name: of the metric.
        counts: for each row the repetitions that have the metric.
        summary: with its wins.
    """
    compared = [place for place, count in enumerate(counts) if count >= FEWEST]
    if len(compared) < 2:
        return Standing()
    wins = [win for win in summary.wins if win.metric.name == name]
    behind = {win.loser for win in wins}
    ahead = {win.winner for win in wins} - behind
    level = [place for place in compared if place not in ahead | behind]
    return Standing(tuple(sorted(ahead)), tuple(sorted(behind)), tuple(level))


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
    """Who is ahead at one metric: only what the corrected tests between the rows support.

    Ahead is who beats another and is beaten by nobody, behind who is beaten; a mean alone puts
    nobody anywhere.
    """
    sign = -1 if metric.better == "higher" else 1
    values = {
        place: value
        for place, row in enumerate(summary.rows)
        if (value := row.metrics.get(metric.name)) is not None
    }
    texts = {
        place: f"{names[place]} {cells.mean_in_words(value, metric)}"
        for place, value in sorted(values.items(), key=lambda item: sign * item[1].mean)
    }
    if len(texts) < 2:
        return "".join(f"{metric.title}: {text}." for text in texts.values())
    everybody = list(texts.values())
    found = standing(
        metric.name,
        [0 if (v := values.get(place)) is None else v.count for place in range(len(names))],
        summary,
    )
    if found == Standing():
        return f"{metric.title}: {_list(everybody)}; too few repetitions to compare."
    wins = [win for win in summary.wins if win.metric.name == metric.name]
    losers, winners = set(found.behind), set(found.ahead)
    ahead = [text for place, text in texts.items() if place in winners]
    behind = [text for place, text in texts.items() if place in losers]
    others = [text for place, text in texts.items() if place not in winners | losers]
    if not ahead:
        return f"{metric.title}: {_list(everybody)}; no difference is shown."
    verb = "is" if len(ahead) == 1 else "are"
    # "of" only where it is true of each: one row that beats every one that is behind.
    beaten = {win.loser for win in wins if win.winner in winners}
    of_each = len(ahead) == 1 and beaten == losers
    over = f" of {_list(behind)}" if of_each else f"; behind: {_list(behind)}"
    rest = f"; not told apart: {_list(others)}" if others else ""
    return f"{metric.title}: {_list(ahead)} {verb} ahead{over}{rest}."


def _list(texts: Sequence[str]) -> str:
    shown = list(texts) if len(texts) <= NAMED + 1 else list(texts[:NAMED])
    if len(texts) > len(shown):
        return ", ".join(shown) + f" and {len(texts) - len(shown)} more"
    return " and ".join([", ".join(shown[:-1]), shown[-1]]) if len(shown) > 1 else shown[0]
