"""What `--sim-compare-fail="placed:5%,ram:10%,rtf:20%"` says: how much worse is too much.

And whether a threshold of a claim makes sense: a gate that cannot fail is worse than none.
"""

from __future__ import annotations

import math
import re
from collections.abc import Container, Iterable
from dataclasses import dataclass
from numbers import Real

from pytest_simbench.records.metrics import COSTS, CRASHED, Metric, UnknownMetric, significant

ALIASES = {"failures": CRASHED.name}
"""Names of before, which users may still type."""


def named(name: str, known: Container[str] = ()) -> str:
    """The name of a metric that a user typed; one that is known by it is not renamed."""
    return name if name in known else ALIASES.get(name, name)


class LimitError(ValueError):
    """A limit that cannot be understood; the message says why and shows a right one."""


@dataclass(frozen=True)
class Limit:
    """How much a metric may get worse.

    Attributes:
        amount: above or equal 0; a share (0.05) where `percent`, else in the metric's unit.
        percent: of the baseline's mean for values; percentage points for shares and yes-or-no
            metrics, which are shown in percent anyway.
    """

    metric: str
    amount: float
    percent: bool

    def loss(self, metric: Metric, before: float, after: float) -> float:
        """How much worse `after` is than `before`, in the limit's own terms; below 0: better."""
        loss = before - after if metric.better == "higher" else after - before
        if not self.percent or metric.bounded:
            return loss
        if before:
            return loss / abs(before)
        return math.copysign(math.inf, loss) if loss else 0.0

    def __str__(self) -> str:
        """As it is typed: `placed:5%`."""
        amount = significant(self.amount * (100 if self.percent else 1))
        return f"{self.metric}:{amount}{'%' if self.percent else ''}"

    def vain(self, metric: Metric) -> str:
        """Why no run could ever exceed it, in a sentence; empty when one could."""
        text = str(self)
        if metric.bounded and self.amount >= 1:
            hint = "" if self.percent else f"; did you mean {text}%?"
            return f"{text} can never be exceeded: {self.metric} lies between 0 and 100 %{hint}"
        if self.percent and metric.better == "higher" and self.amount >= 1:
            return f"{text} can never be exceeded: {self.metric} cannot fall by more than 100 %"
        return ""

    def describe(self, metric: Metric, amount: float) -> str:
        """An amount in the limit's terms: `5 points`, `20 %`, `0.01 m`."""
        if metric.bounded:
            return f"{significant(100 * amount)} points"
        if self.percent:
            return f"{significant(100 * amount)} %"
        return metric.format(amount)


def parse_limits(text: str, metrics: Iterable[Metric]) -> tuple[Limit, ...]:
    """The limits in `name:amount[,name:amount...]`.

    An amount with % is relative (points for shares); one without is in the metric's own unit. The
    costs and `crashed` are known besides the metrics of all tasks.

    Raises:
        LimitError: an item that is not of that form, is there twice, names a metric of which
            neither direction is better, or a limit that no run could exceed.
        UnknownMetric: no such metric; the message lists the valid names.
    """
    known = {metric.name: metric for metric in (*COSTS, CRASHED, *metrics)}
    usable = [name for name, metric in known.items() if metric.better]
    found: dict[str, Limit] = {}
    for item in (part.strip() for part in text.split(",")):
        match = re.fullmatch(r"(\w+)\s*:\s*(\d+(?:\.\d*)?|\.\d+)\s*(%?)", item)
        if match is None:
            raise LimitError(f"{item!r} is not a limit like placed:5% or landing_error:0.01")
        name, number, percent = match.groups()
        name = named(name, known)
        if name not in known:
            raise UnknownMetric(name, usable)
        if name not in usable:
            raise LimitError(
                f"{name} can be neither better nor worse, so it has no limit; "
                f"valid names: {', '.join(sorted(usable))}"
            )
        if name in found:
            raise LimitError(f"{name} has two limits; give it one")
        limit = Limit(name, float(number) / (100 if percent else 1), bool(percent))
        if vain := limit.vain(known[name]):
            raise LimitError(vain)
        found[name] = limit
    return tuple(found.values())


def check_threshold(metric: Metric, value: float) -> None:
    """Whether claims about a metric can have that threshold.

    Raises:
        LimitError: it is no finite number, or lies outside what the metric can be.
    """
    __tracebackhide__ = True
    if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
        raise LimitError(f"a threshold of {metric.name} is a finite number, not {value!r:.80}")
    if metric.bounded and not 0 <= value <= 1:
        hint = f"; did you mean {significant(value / 100)}?" if 1 < value <= 100 else ""
        raise LimitError(
            f"{metric.name} is a share, so its threshold lies between 0 and 1, not at "
            f"{significant(value)}{hint}"
        )


def check_gate(metric: Metric, value: float) -> None:
    """Whether a threshold that a user sets leaves a claim that can fail.

    Raises:
        LimitError: it cannot, or `check_threshold` refuses it.
    """
    check_threshold(metric, value)
    always = {"higher": value <= 0, "lower": metric.bounded and value >= 1, None: False}
    if always[metric.better] and (metric.bounded or metric in COSTS):
        relation = "at least" if metric.better == "higher" else "at most"
        raise LimitError(
            f"{metric.name} is always {relation} {significant(value)}, so that this threshold can "
            "never fail"
        )
    if metric.better == "lower" and value < 0 and metric in COSTS:
        raise LimitError(
            f"{metric.name} is never below 0, so a threshold of {value:g} always fails"
        )
