"""The first worse release between a good and a bad one, in log2 steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pytest_simbench.measure.results import ResultSet
from pytest_simbench.measure.speed import compared
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


def like_the_bad_one(metric: Metric, good: ResultSet, bad: ResultSet, other: ResultSet) -> bool:
    """Whether a release is nearer to the bad one than to the good one; so is one that has no value,
    for instance since it always crashes.

    A test against the good one alone would call every release good that few repetitions cannot
    tell from it.
    """
    if not other.values(metric):
        return True
    here, there = (compared(metric, good, one)[0].difference for one in (other, bad))
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
