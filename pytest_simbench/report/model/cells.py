"""Numbers as a reader sees them, in plain ASCII: a log's encoding may know nothing else."""

from __future__ import annotations

from pytest_simbench.measure.intervals import proportion
from pytest_simbench.records.metrics import Metric, significant
from pytest_simbench.report.model.pooling import Sampled, Spread
from pytest_simbench.report.model.summary import Row

MISSING = "-"


def number(value: float, digits: int = 3) -> str:
    """So many significant digits, zeros kept: 1.35, 0.80, 161."""
    return significant(value, digits, keep_zeros=True)


def metric_value(value: float, metric: Metric) -> str:
    """Without its unit: percent for shares and yes-or-no, else to the millimetre of a metre.

    What is a thousand times smaller than the metric's resolution is rounding, and nothing.
    """
    if metric.bounded:
        return f"{100 * value:.0f}"
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
    return f"[{', '.join(metric_value(end, metric) for end in ends)}]"


def spread(found: Spread | None, metric: Metric) -> list[str]:
    """Two lines: min / mean / max (for yes-or-no: how many of how many), and the interval."""
    if found is None:
        return [MISSING]
    if metric.kind == "yes_no":
        yes = round(found.mean * found.count)
        return [
            f"{yes} of {found.count}",
            f"{metric_value(found.mean, metric)} {interval(found, metric)}".rstrip(),
        ]
    parts = (found.min, found.mean, found.max)
    return [" / ".join(metric_value(part, metric) for part in parts), interval(found, metric)]


def mean_interval(found: Spread | None, metric: Metric) -> list[str]:
    """Two lines: the mean, and the interval."""
    if found is None:
        return [MISSING]
    return [metric_value(found.mean, metric), interval(found, metric)]


def cost(found: Spread | None, digits: int = 2) -> list[str]:
    """Two lines: the mean, and the interval."""
    if found is None:
        return [MISSING]
    return [number(found.mean, digits), _ends(found, digits)]


def _ends(found: Spread | Sampled, digits: int) -> str:
    if found.low is None or found.high is None:
        return ""
    return f"[{number(found.low, digits)}, {number(found.high, digits)}]"


def sampled(found: Sampled | None) -> list[str]:
    """Mean +- deviation over all samples, the interval of the mean, the peak where there is one."""
    if found is None:
        return [MISSING]
    lines = [f"{found.mean:.0f} +- {found.std:.0f}"]
    if found.low is not None and found.high is not None:
        lines.append(f"[{found.low:.0f}, {found.high:.0f}]")
    if found.peak is not None:
        lines.append(f"(peak {found.peak:.0f})")
    return lines


def failures(row: Row) -> list[str]:
    """Failed repetitions of those that count, the interval of their share, the interrupted ones."""
    lines = [f"{row.failed} of {row.attempts}"]
    if row.attempts:
        found = proportion(row.failed, row.attempts)
        lines.append(f"[{100 * found.low:.0f}, {100 * found.high:.0f}] %")
    if row.interrupted:
        lines.append(f"{row.interrupted} cut")
    return lines


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
