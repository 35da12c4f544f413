"""The first worse release between a good and a bad one, in log2 steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pytest_simbench.measure.comparison import Alternative, MeanDifference, compare_by_seed
from pytest_simbench.measure.limits import CRASHED
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.measure.speed import without_speed
from pytest_simbench.records.metrics import Metric


def first_worse(number: int, is_worse: Callable[[int], bool]) -> int:
    """The place of the first worse one of `number` releases, of which the first is good and the
    last is bad.

    Where it got worse, better and worse again, it is one of the places where it got worse.

    Args:
        number: at least 2.
        is_worse: asked of at most log2(number) places, none of them the ends.
    """
    good, bad = 0, number - 1
    while bad - good > 1:
        middle = (good + bad) // 2
        if is_worse(middle):
            bad = middle
        else:
            good = middle
    return bad


def has_value(metric: Metric, result: ResultSet) -> bool:
    """Whether a repetition has a value."""
    return bool(result.crashed_by_seed() if metric is CRASHED else result.values(metric.name))


def difference(metric: Metric, before: ResultSet, after: ResultSet) -> MeanDifference:
    """Whether the second is worse than the first, one-sided, paired by seed.

    Raises:
        ValueError: a side has no value.
    """
    if metric is CRASHED:
        sides = before.crashed_by_seed(), after.crashed_by_seed()
    else:
        usual = before.by_seed(metric.name), after.by_seed(metric.name)
        sides = without_speed(metric.name, before, after) or usual
    worse: Alternative = "less" if metric.better == "higher" else "greater"
    sole = before.sole(metric.name) and after.sole(metric.name)
    return compare_by_seed(*sides, worse, sole=sole)


def like_the_bad_one(metric: Metric, good: ResultSet, bad: ResultSet, other: ResultSet) -> bool:
    """Whether a release is nearer to the bad one than to the good one; so is one that has no value,
    for instance since it always crashes.

    A test against the good one alone would call every release good that few repetitions cannot
    tell from it.
    """
    if not has_value(metric, other):
        return True
    here = difference(metric, good, other).difference
    there = difference(metric, good, bad).difference
    return here / there > 0.5


def steps(number: int) -> int:
    """Releases that `first_worse` asks for at most, besides the ends."""
    return max(0, (number - 2).bit_length())


def between(releases: Sequence[str], good: str, bad: str) -> list[str]:
    """The releases from the good one to the bad one, both included; backwards where the bad one is
    the older one.

    Raises:
        ValueError: one of them is not among the releases.
    """
    first, last = releases.index(good), releases.index(bad)
    if first <= last:
        return list(releases[first : last + 1])
    return list(releases[last : first + 1])[::-1]
