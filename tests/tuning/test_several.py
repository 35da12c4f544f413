"""Several tasks and laws in one search."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.cli.tune import _judge
from pytest_simbench.cli.tune_told import Result, profile_of, together, verdict_of
from pytest_simbench.experiment.identity import settings
from pytest_simbench.laws import LAWS
from pytest_simbench.tuning.search import front
from pytest_simbench.tuning.several import MOST, Several, named
from pytest_simbench.tuning.target import Look, Target, TuningError
from pytest_simbench.tuning.trials import Candidate
from tests.approval import assert_approved, assert_approved_message
from tests.tiny import Falling

from .made_up import target, trials


class Landing(Falling):
    """Another task."""

    name = "landing"


def both(chosen: int = 2, judged: int = 3) -> Several:
    falling = target(chosen, judged)
    other = Target(
        "landing", "cpu_cost", *(tuple(Look(Landing(), k.number) for k in half) for half in
        (falling.chosen, falling.judged)), falling.metric,
    )  # fmt: skip
    looks = (*falling.chosen, *other.chosen), (*falling.judged, *other.judged)
    return Several("falling,landing", "cpu_cost", *looks, several=(falling, other))


def test_what_a_command_line_names() -> None:
    """Laws come first, which are quick; then one look at each task, and the others."""
    found = named("throwing:landing_error,stacking,laws:creep,grip_holds", "cpu_cost", None, 3, 9)
    assert [part.name for part in found.parts] == ["laws:creep,grip_holds", "throwing", "stacking"]
    assert [p.metric.name for p in found.parts if p.metric] == ["landing_error", "at_end"]
    order = [(look.task.name, look.number) for look in found.chosen]
    assert order[:4] == [("creep", 1), ("grip_holds", 1), ("throwing", 1), ("stacking", 1)]
    assert order[-4:] == [(name, k) for name in ("throwing", "stacking") for k in (2, 3)]
    assert len([look for look in found.judged if look.task.name == "stacking"]) == 9
    assert (found.name[:8], found.word, found.laws, found.unit) == (
        "throwing", "several", False, "margins",
    )  # fmt: skip
    for alone, error in (("stacking", "at_end_strict"), ("stacking:at_end_strict,", None)):
        one = named(alone, "cpu_cost", error, 3, 9)
        assert (one.name, one.metric and one.metric.name) == ("stacking", "at_end_strict")
    assert named("stacking:converged:placed", "cpu_cost", None, 3, 9).converged
    found = named("laws,stacking", "cpu_cost", None, 3, 9)
    assert [look.task.name for look in found.chosen[:-3]] == [law.name for law in LAWS]
    found = named("laws,stacking", "cpu_cost", None, 3, 9, ())  # laws that ask for nothing
    assert [look.task.name for look in found.chosen[:-3]] == [o.name for o in LAWS if not o.needs]


@pytest.mark.parametrize(
    ("name", "error"),
    [("stacking,throwing", "hit"), ("stacking:hit", "hit"), ("stacking,pushing:hit", None),
     ("stacking,throwing:hits", None), ("stacking:converged,throwing", None),
     ("stacking,stacking", None), ("stacking,x", None)],
)  # fmt: skip
def test_bad_names(name: str, error: str | None) -> None:
    with pytest.raises(TuningError) as told:
        named(name, "cpu_cost", error, 4, 9)
    assert_approved_message(str(told.value))


def test_the_error_is_that_of_the_worst_in_margins() -> None:
    of = both()
    had = dict.fromkeys(of.chosen, 0.1)
    of = of.beside(had)
    assert of.together(had) == 0.0
    first, *_, last = of.chosen
    assert of.together({**had, last: 0.2}) == pytest.approx(1.0)  # 5 points
    assert of.together({**had, first: 0.0, last: 0.3}) == pytest.approx(2.0)
    assert of.together({last: 0.3}, of.chosen) == pytest.approx(1.0)  # the other may have none
    assert of.together({}) == 0.0
    assert (of.comparable(of.chosen[:2]), of.comparable(of.chosen[1:3])) == (False, True)


def test_each_law_counts_by_itself() -> None:
    kept, broken = (Look(law) for law in LAWS[:2])
    of = Target("laws:x", "cpu_cost", (kept, broken), (kept, broken))
    both_ = Several("x,y", "cpu_cost", of.chosen, of.judged, several=(of, target()))
    both_ = both_.beside({kept: 0.5, broken: 8.0})
    assert both_.together({kept: 0.9, broken: 8.0}) == 0.0
    assert both_.together({kept: 1.0, broken: 0.1}) == pytest.approx(1.0)
    assert both_.together({kept: 0.5, broken: 9.6}) == pytest.approx(2.0)


def score(found: Mapping[str, Any], number: int) -> float:
    return 1.0 if found["timestep"] <= 0.004 else 0.7


def test_what_is_far_worse_in_one_is_not_asked_for_the_others(tmp_path: Path) -> None:
    """And a dearer look at one alone ends nothing."""
    looks, _ = trials(tmp_path, score, both())
    today = looks.today()
    assert (looks.error(today), looks.target.together(today.errors)) == (0.0, 0.0)
    far = looks.choose("trial1", {"timestep": 0.01}, [today])
    assert far.ended == "hopeless after 2 of 4"  # 0.3 of both is 6 margins, of one 3
    assert looks.error(far) == pytest.approx(0.3 / 0.05)
    assert looks.error(far) > MOST
    dear = looks.choose("trial2", {"timestep": 0.001}, [today])
    assert dear.ended == "hopeless after 3 of 4"
    good = looks.choose("trial3", {"timestep": 0.004}, [today])
    assert [one.name for one in front([today, far, dear, good], looks)] == ["trial3"]


def test_the_verdict_is_that_of_the_worst(tmp_path: Path) -> None:
    def landed(task: str, found: Mapping[str, Any]) -> float:
        return 0.0 if task == "landing" and found["timestep"] > 0.004 else 1.0

    looks, executor = trials(tmp_path, lambda s, k: 1.0, both(2, 30))
    ended = executor.end
    executor.end = lambda experiment, k: (
        {**ended(experiment, k)[0], "metrics": {
            "landed": landed(experiment.task.name, settings(experiment.case))}}, None,
    )  # fmt: skip
    today = looks.today()
    found = looks.choose("trial1", {"timestep": 0.004}, [today])
    lost = replace(found, name="trial2", changes={"timestep": 0.005})
    lines = []
    for one in (found, lost):
        halves = _judge(looks, today, one, 1e4 if one is lost else 30.0)
        result = Result(looks, [today, one], one, "it is cheaper", halves)
        lines += [*verdict_of(result), f"{getattr(result.judgement, 'after', None):g}"]
    lines += [*together([result])]
    lines += [line for line in profile_of(result).splitlines() if "seeds" in line or "by" in line]
    assert_approved("several", "\n".join(lines))


def test_all_count_alike_in_the_cost() -> None:
    """However many looks there are."""
    of = both()
    one = Candidate("x", {}, costs=dict(zip(of.chosen, (1.0, 3.0, 6.0), strict=False)))
    assert one.cost() == 4.0
