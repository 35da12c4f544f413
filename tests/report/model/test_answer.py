"""The sentences above a table: right, and no more certain than the tests between the rows."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.differences import Difference, Verdict
from pytest_simbench.records.metrics import Metric
from pytest_simbench.report.model import tables
from pytest_simbench.report.model.answer import headline, sentences
from pytest_simbench.report.model.pooling import Spread
from pytest_simbench.report.model.summary import Row, TaskSummary, summarise
from tests.report.samples import METRICS, record, stacking_run, throwing_run

SCORE = Metric("score", "score", "", "higher", "share", 10, study=True)


def task(
    found: dict[str, float],
    beats: tuple[str, ...] = (),
    metric: Metric = SCORE,
    count: int = 20,
    failed: int = 0,
) -> TaskSummary:
    """A task whose rows have these means, and wins like `a>b`."""
    rows = tuple(
        Row(
            "t", name, "headless", "tuned", finished=count, failed=failed,
            metrics={"score": Spread(count, mean, mean, mean, 0.1, mean - 0.1, mean + 0.1)},
        )
        for name, mean in found.items()
    )  # fmt: skip
    return TaskSummary("t", (metric,), rows, differences=told(list(found), beats, metric, count))


def told(
    names: list[str], beats: tuple[str, ...], metric: Metric, count: int = 20, needs: int = 0
) -> tuple[Difference, ...]:
    """Of each pair of rows what `beats` says: `a>b`, `a~b` equivalent, `a!b` different."""
    verdicts: dict[str, tuple[Verdict, Verdict]] = {
        ">": ("better", "worse"), "~": ("equivalent",) * 2, "!": ("different",) * 2,
    }  # fmt: skip
    said = {frozenset((text[0], text[2])): text for text in beats}
    found = []
    for a, b in combinations(names, 2):
        text = said.get(frozenset((a, b)))
        verdict = verdicts[text[1]][a != text[0]] if text else "undecided"
        places = names.index(a), names.index(b)
        found.append(
            Difference(
                *places, metric, "outcome", verdict, 0.0, 0.5, 0.4, 0.6, 0.001, count, count,
                count, needs,
            )
        )  # fmt: skip
    return tuple(found)


def test_a_task_that_is_not_told_apart_says_what_it_takes() -> None:
    """Of the other sample, and the headline of both: the stored texts in test_terminal."""
    (throwing,) = summarise(throwing_run(), METRICS)
    assert sentences(throwing) == [
        "moved: mujoco 42 % [33, 54] and pybullet 39 % [27, 52]; a difference needs at least 6 "
        "pairs that differ; so far 1.",
        "crashes: none in 40 repetitions.",
    ]
    assert headline([]) == []


def test_what_it_takes_and_what_there_is_are_of_the_same_rows() -> None:
    """ "needs at least 6; so far 6", it said, of rows that crashed often beside others."""
    found = task({"a": 0.2, "b": 0.8, "c": 0.9})
    first, *others = found.differences
    rare = [replace(other, differ=3, needs=6) for other in others]
    found = replace(found, differences=(replace(first, differ=6, needs=7), *rare))
    assert sentences(found)[0].endswith("needs at least 7 pairs that differ; so far 6.")


def test_without_differences_there_is_no_matrix() -> None:
    same = [record(name, k, metrics={"placed": 1.0}) for name in ("a", "b") for k in range(20)]
    assert tables.matrix(summarise(same, METRICS)[0]) == []


def test_modes_are_not_set_against_each_other() -> None:
    good = [record("mujoco", k, metrics={"placed": 1.0}) for k in range(20)]
    poor = [record("mujoco", k, mode="gui", metrics={"placed": 0.2}) for k in range(20)]
    assert summarise([*good, *poor], METRICS)[0].differences == ()


def test_who_is_ahead_colours_the_cells() -> None:
    (found,) = summarise(stacking_run(), METRICS)
    verdicts = {c.heading: [cell.verdict for cell in c.cells] for c in tables.study(found)}
    assert verdicts["placed %"] == verdicts["at the end %"] == ["ahead", "behind"]
    assert verdicts["crashed"] == verdicts["RAM MB"] == ["open", "open"]
    for heading in ("x real time", "CPU s/sim s", "CPU %", "start s", "simulator"):
        assert verdicts[heading] == ["", ""]  # no control was recorded


@pytest.mark.parametrize(
    ("beats", "sentence"),
    [
        (
            ("c>a",),
            "c 90 % [80, 100] is ahead of a 20 % [10, 30], by 50 points [40, 60]; "
            "not told apart: b 80 % [70, 90]",
        ),
        (("c>a", "b>a"), "c 90 % [80, 100] and b 80 % [70, 90] are ahead; behind: a 20 % [10, 30]"),
        (("c>a", "b>a", "c>b"), "c 90 % [80, 100] is ahead of b 80 % [70, 90] and a 20 % [10, 30]"),
        (("c>b", "b>a"), "c 90 % [80, 100] is ahead; behind: b 80 % [70, 90] and a 20 % [10, 30]"),
        (
            ("a>b", "b>c", "c>a"),
            "none is ahead; behind: c 90 % [80, 100], b 80 % [70, 90] and a 20 % [10, 30]",
        ),
        ((), "c 90 % [80, 100], b 80 % [70, 90] and a 20 % [10, 30]; not told apart"),
        (
            ("a~b", "a~c", "b~c"),
            "c 90 % [80, 100], b 80 % [70, 90] and a 20 % [10, 30]; the same within 5 points",
        ),
        (
            ("a~b", "a!c"),
            "c 90 % [80, 100], b 80 % [70, 90] and a 20 % [10, 30]; "
            "1 of 3 pairs differ, and no value is the right one",
        ),
    ],
)
def test_only_what_a_test_supports_is_ranked(beats: tuple[str, ...], sentence: str) -> None:
    assert sentences(task({"a": 0.2, "b": 0.8, "c": 0.9}, beats))[0] == f"score: {sentence}."


def test_wins_at_other_metrics_rank_nobody() -> None:
    other = Metric("other", "other", "m", "lower")
    found = task({"a": 0.2, "b": 0.8}, ("b>a",), other)
    found = TaskSummary("t", (SCORE,), found.rows, differences=found.differences)
    assert sentences(found)[0].endswith("; not compared.")


def test_nobody_leads_with_nothing() -> None:
    """Two engines that never moved a cube, of four; "genesis 0 % and newton 0 % lead" it said."""
    records = [
        record(name, k, "throwing", metrics={"moved": moved})
        for name, moved in (("genesis", 0.0), ("newton", 0.0), ("drake", 0.5), ("dart", 0.5))
        for k in range(20)
    ]
    (found,) = summarise(records, METRICS)
    assert sentences(found)[0].startswith("moved: dart 50 % [")
    assert "are ahead; behind: genesis 0 % [0, " in sentences(found)[0]
    (nothing,) = summarise(records[:40], METRICS)
    assert sentences(nothing)[0].endswith(
        "; a difference needs at least 6 pairs that differ; so far none."
    )


def test_lower_is_better_where_the_metric_says_so_and_a_single_one_has_no_rank() -> None:
    assert sentences(task({"a": 0.5}))[0] == "score: a 50 % [40, 60]."
    metric = Metric("score", "error", "m", "lower", study=True)
    found = sentences(task({"a": 0.2, "b": 0.11}, ("b>a",), metric))
    assert (
        found[0]
        == "error: b 0.11 m [0.01, 0.21] is ahead of a 0.2 m [0.1, 0.3], by 0.5 m [0.4, 0.6]."
    )


def test_many_simulators_are_not_all_named() -> None:
    found = sentences(task(dict.fromkeys("abcdefgh", 0.5)))
    assert found[0].startswith(
        "score: a 50 % [40, 60], b 50 % [40, 60], c 50 % [40, 60] and 5 more;"
    )


def test_a_metric_without_a_good_direction_is_not_ranked() -> None:
    metric = Metric("score", "landing", "m", None, study=True)
    assert sentences(task({"a": 1.1}, (), metric, failed=1)) == [
        "landing: a 1.1 m [1, 1.2] (of 20 that finished).",
        "crashes: a 1 of 21.",
    ]
    two = sentences(task({"a": 1.1, "b": 2.1}, ("a!b",), metric))[0]
    assert two.endswith("; they differ, and no value is the right one.")


def test_the_headline_counts_many_and_tells_a_single_one() -> None:
    means = dict.fromkeys("abcdefg", 0.1) | {"x": 0.9}
    found = headline([task(means, tuple(f"x>{name}" for name in "abcdefg"))])
    assert found[1] == "Outcome: t, score: x ahead (behind: 7 others)."
    found = headline([task({"a": 0.1, "b": 0.5, "c": 0.9}, ("c>b", "b>a", "c>a"))])
    assert found[1] == "Outcome: t, score: c ahead (behind: a and b)."
    alone = [record(repetition=k, metrics={"placed": 1.0, "at_end": 0.8}) for k in range(10)]
    ran, outcome, cost = headline(
        summarise([*alone, record(repetition=11, status="interrupted")], METRICS)
    )
    assert ran == "mujoco did stacking: 10 repetitions, none crashed, 1 cut short."
    assert outcome.startswith("Outcome: stacking, placed: 100 % [")
    assert cost == "Cost: CPU s per simulated s: 0.048; RAM: 150 MB."


def test_profiles_are_compared_where_one_simulator_stands_alone() -> None:
    rows = [
        record(repetition=k, seed=k, profile=profile, metrics={"placed": placed})
        for profile, placed in (("default", 0.2), ("tuned", 0.9))
        for k in range(8)
    ]
    told = headline(summarise(rows, METRICS))[1]
    assert "placed: mujoco (tuned) ahead (behind: mujoco (default))" in told
    others = [replace(row, simulator="b", profile="tuned") for row in rows[:8]]
    told = headline(summarise([*rows, *others], METRICS))[1]
    assert "placed: mujoco (tuned) ahead (behind: b (tuned))" in told


def test_a_task_without_metrics_of_the_study_is_told_by_its_first_two() -> None:
    metrics = tuple(Metric(name, name, "m", "lower") for name in ("one", "two", "three"))
    found = task({"a": 0.1, "b": 0.9})
    spread = found.rows[0].metrics[SCORE.name]
    rows = tuple(replace(row, metrics=dict.fromkeys(("one", "two"), spread)) for row in found.rows)
    told = headline([TaskSummary("t", metrics, rows)])[1]
    assert told == "Outcome: t, one and two: not compared."


PAIRS = st.sets(st.sampled_from([f"{a}>{b}" for a in "abcd" for b in "abcd" if a < b]))


@given(PAIRS)
def test_who_is_beaten_is_never_ahead(beats: set[str]) -> None:
    """Letters are means: what beats another has the better one."""
    found = task({"d": 0.1, "c": 0.3, "b": 0.5, "a": 0.7}, tuple(beats))
    text = sentences(found)[0].removeprefix("score: ")
    losers = {pair[2] for pair in beats}
    ahead = text.partition(" ahead")[0] if " ahead" in text else ""
    assert set(re.findall(r"([abcd]) \d", ahead)) == {pair[0] for pair in beats} - losers
