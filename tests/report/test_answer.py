"""The sentences above a table: right, and no more certain than the intervals."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.metrics import Metric
from pytest_simbench.report.answer import overlaps, sentences, short_labels
from pytest_simbench.report.pooling import Spread
from pytest_simbench.report.summary import Row, TaskSummary, summarise

from .samples import METRICS, stacking_run, throwing_run, two_errors

SCORE = Metric("score", "score", "", "higher", "share", 10, study=True)


def task(
    metric: Metric = SCORE, failed: int = 0, **found: tuple[float, float, float]
) -> TaskSummary:
    """A task whose rows have these means and intervals."""
    rows = tuple(
        Row(
            "t", name, "headless", "tuned", finished=20, failed=failed,
            metrics={"score": Spread(20, low, mean, high, 0.1, low, high)},
        )
        for name, (low, mean, high) in found.items()
    )  # fmt: skip
    return TaskSummary("t", (metric,), rows)


def test_sample_runs() -> None:
    assert sentences(summarise(stacking_run(), METRICS, ends=two_errors)[0]) == [
        "placed: mujoco 99 % [97, 100] is ahead of pybullet 77 % [73, 80].",
        "at the end: mujoco 97 % [94, 99] is ahead of pybullet 90 % [87, 94].",
        "failures: pybullet 3 of 20.",
    ]
    assert sentences(summarise(throwing_run(), METRICS, ends=two_errors)[0]) == [
        "moved: mujoco 42 % [38, 45] and pybullet 39 % [34, 45]; "
        "the intervals overlap: no clear best.",
        "failures: none in 40 repetitions.",
    ]


def test_leaders_that_overlap_are_not_ranked() -> None:
    found = sentences(task(a=(0.1, 0.2, 0.3), b=(0.7, 0.8, 0.9), c=(0.85, 0.9, 0.95)))
    assert found[0] == (
        "score: c 90 % [85, 95] and b 80 % [70, 90] lead with overlapping intervals; "
        "behind: a 20 % [10, 30]."
    )


def test_lower_is_better_where_the_metric_says_so() -> None:
    metric = Metric("score", "error", "m", "lower", study=True)
    found = sentences(task(metric, a=(0.1, 0.2, 0.3), b=(0.01, 0.02, 0.03)))
    assert found[0] == "error: b 0.02 m [0.01, 0.03] is ahead of a 0.2 m [0.1, 0.3]."


def test_many_simulators_are_not_all_named() -> None:
    found = sentences(task(SCORE, 0, **dict.fromkeys("abcdefgh", (0.4, 0.5, 0.6))))
    assert found[0].startswith(
        "score: a 50 % [40, 60], b 50 % [40, 60], c 50 % [40, 60] and 5 more;"
    )


def test_a_metric_without_a_good_direction_is_not_ranked() -> None:
    metric = Metric("score", "landing", "m", None, study=True)
    assert sentences(task(metric, failed=1, a=(1.0, 1.1, 1.2))) == ["failures: a 1 of 21."]


def test_names_say_no_more_than_they_must() -> None:
    records = stacking_run() + stacking_run("gui")
    assert short_labels(summarise(records, METRICS)[0].rows) == [
        "mujoco (headless)",
        "mujoco (gui)",
        "pybullet (headless)",
        "pybullet (gui)",
    ]


ENDS = st.tuples(st.floats(0, 1), st.floats(0, 1)).map(sorted)


@given(ENDS, ENDS)
def test_overlap_is_symmetric_and_means_a_shared_value(a: list[float], b: list[float]) -> None:
    first, second = (Spread(20, 0, 0, 0, 0, low, high) for low, high in (a, b))
    shared = max(a[0], b[0]) <= min(a[1], b[1])
    assert overlaps(first, second) == overlaps(second, first) == shared
