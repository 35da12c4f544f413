"""Numbers as a reader sees them, in plain ASCII: a log's encoding may know nothing else."""

from __future__ import annotations

import math

from pytest_simbench.measure.intervals import proportion
from pytest_simbench.records.metrics import Metric, significant
from pytest_simbench.report.model.document import Cell
from pytest_simbench.report.model.pooling import Spread
from pytest_simbench.report.model.summary import Row

MISSING = "-"


def number(value: float, digits: int = 3) -> str:
    """So many significant digits, zeros kept: 1.35, 0.80, 161."""
    return significant(value, digits, keep_zeros=True)


def two_decimals(value: float) -> str:
    """No minus before a zero, and `MISSING` for what is no number."""
    return MISSING if math.isnan(value) else f"{value:.2f}".replace("-0.00", "0.00")


def metric_value(value: float, metric: Metric) -> str:
    """Without its unit: percent for shares and yes-or-no, else to the millimetre of a metre.

    What is a thousand times smaller than the metric's resolution is rounding, and nothing.
    """
    if metric.bounded:
        shown = f"{100 * value:.0f}"
        if shown in ("0", "100") and 0 < value < 1:  # not quite none or all
            return f"{min(99.9, max(0.1, 100 * value)):.1f}"
        return shown
    if abs(value) < metric.smallest_difference / 1000:
        return "0"
    return significant(value, 4 if abs(value) >= 1 else 2)


def interval(found: Spread, metric: Metric) -> str:
    """The 95 % interval of the mean, for instance `[97, 100]`; nothing where there is none.

    An end that is far nearer to 0 than to the other one is 0: of a single lost cube in twenty
    repetitions the lower end is 0.00004 of a cube.
    """
    if found.low is None or found.high is None:
        return ""
    small = (found.high - found.low) / 1000
    ends = (0.0 if abs(end) < small else end for end in (found.low, found.high))
    shown = (f"{100 * e:.0f}" if metric.bounded else metric_value(e, metric) for e in ends)
    return f"[{', '.join(shown)}]"


def spread(found: Spread | None, metric: Metric) -> Cell:
    """Two lines: min / mean / max (for yes-or-no: how many of how many), and the interval."""
    if found is None:
        return Cell([MISSING])
    if metric.kind == "yes_no":
        yes, share = f"{found.mean * found.count:.0f}", metric_value(found.mean, metric)
        lines = [f"{yes} of {found.count}", f"{share} {interval(found, metric)}".rstrip()]
        return Cell(lines, found.mean)
    parts = (found.min, found.mean, found.max)
    shown = " / ".join(metric_value(part, metric) for part in parts)
    return Cell([shown, interval(found, metric)], found.mean)


def mean_first(found: Spread | None, metric: Metric) -> Cell:
    """Three lines, for the page: mean, interval, smallest and largest; yes-or-no as above."""
    if found is None or metric.kind == "yes_no":
        return spread(found, metric)
    mean, *ends = (metric_value(v, metric) for v in (found.mean, found.min, found.max))
    shown = " to ".join(dict.fromkeys(ends))
    lines = [mean, interval(found, metric), shown if shown != mean else ""]
    return Cell([line for line in lines if line], found.mean)


def mean_interval(found: Spread | None, metric: Metric) -> Cell:
    """Two lines: the mean, and the interval."""
    if found is None:
        return Cell([MISSING])
    return Cell([metric_value(found.mean, metric), interval(found, metric)], found.mean)


def cost(found: Spread | None, digits: int = 2) -> Cell:
    """Two lines: the mean, and the interval."""
    if found is None:
        return Cell([MISSING])
    ends = [] if found.low is None or found.high is None else [found.low, found.high]
    shown = [f"[{', '.join(number(end, digits) for end in ends)}]"] if ends else [""]
    return Cell([number(found.mean, digits), *shown], found.mean)


def sampled(found: Spread | None) -> Cell:
    """Mean +- deviation over all samples, the interval of the mean, the peak where there is one."""
    if found is None:
        return Cell([MISSING])
    lines = [f"{found.mean:.0f} +- {found.std:.0f}"]
    if found.low is not None and found.high is not None:
        lines.append(f"[{found.low:.0f}, {found.high:.0f}]")
    if found.peak is not None:
        lines.append(f"(peak {found.peak:.0f})")
    return Cell(lines, found.mean)


def failures(row: Row) -> Cell:
    """Failed repetitions of those that count, the interval of their share, the interrupted ones."""
    lines, share = [f"{row.failed} of {row.attempts}"], None
    if row.attempts:
        found = proportion(row.failed, row.attempts)
        share = found.mean
        lines.append(f"[{100 * found.low:.0f}, {100 * found.high:.0f}] %")
    if row.interrupted:
        lines.append(f"{row.interrupted} cut")
    return Cell(lines, share)


def unit(metric: Metric) -> str:
    """In which its values are shown: % for shares."""
    return "%" if metric.bounded else metric.unit


def heading(metric: Metric) -> str:
    """Title and unit of a metric."""
    return f"{metric.title} {unit(metric)}".rstrip()


def mean_in_words(found: Spread, metric: Metric) -> str:
    """Mean, unit and interval in one line."""
    text = f"{metric_value(found.mean, metric)} {unit(metric)} {interval(found, metric)}"
    return " ".join(text.split())
