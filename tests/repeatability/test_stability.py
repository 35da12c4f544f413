"""What random perturbations leave, and how a displacement grows, in worlds that are known.

`tests/plugin/test_repeatability.py` asks the same of an engine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pytest_simbench.measure.results import InconclusiveWarning
from pytest_simbench.repeatability.episode import Episode
from pytest_simbench.repeatability.perturbation import Perturbation
from pytest_simbench.repeatability.search import search
from pytest_simbench.repeatability.stability import Sensitivity, Stability, sensitivity, stability
from pytest_simbench.tasks.base import Moment
from tests.repeatability.scripted import (
    ALL,
    Perturbed,
    Scripted,
    episode,
    motion,
    moved,
    operation,
    shift,
    toppling,
)

GROWING = [
    # at 0.1 s after the first motion began, at 0.2 s, the cube is 1, 2, ... displacements away
    ([0.0], [1.0]),
    ([0.2, 0.4], [1.0, 2.0]),
    ([0.5, 0.9, 1.4], [3.0, 4.0, 6.0]),
    ([2.0, 6.0], [5.0, 1.0]),
]
TAPE = [
    operation("wait", "settle", 0.4),
    operation("follow", "swing", 1.0),
    operation("wait", "swing", 4.6),
]


def growing(perturbed: Perturbed) -> Episode:
    x = shift(perturbed)
    return episode(
        ALL, [motion(t, [0.1 + x * g for g in way], [0.5] * len(t)) for t, way in GROWING], TAPE
    )


@pytest.mark.parametrize("steps", [2, -2])
def test_growth_per_displacement(steps: int) -> None:
    """From the end of the settling on, at 0.4 s, with the commands of the unperturbed run."""
    experiment = Scripted(growing)
    perturbation = Perturbation("x", steps, "a")
    moments = [Moment("swung", "swing", 1), Moment("at first", "settle"), Moment("never", "swim")]
    found = sensitivity(experiment, perturbation, moments)
    assert experiment.asked == [((), None), ((perturbation,), TAPE)]
    assert found.simulator == "sim"
    assert found.perturbation == f"{0.1 * steps:g} mm in x of a"
    assert found.ratio == pytest.approx({0.1: 3.0, 1.0: 6.0, 5.0: 1.0, 20.0: None})
    assert found.largest == pytest.approx(6.0)
    assert found.until == pytest.approx({"swung": 6.0, "at first": 1.0, "never": None})
    assert found.sentence == (
        f"mm per mm after {0.1 * steps:g} mm in x of a: 3 at 0.1 s, 6 at 1 s, 1 at 5 s, "
        "6 until swung, 1 until at first; most 6"
    )
    assert found.to_wire() == {
        "perturbation": found.perturbation,
        "ratio": dict(zip(("0.1", "1", "5", "20"), found.ratio.values(), strict=True)),
        "until": found.until,
        "largest": found.largest,
        "sentence": found.sentence,
    }


def test_a_world_that_is_left_alone_begins_at_once() -> None:
    """No motion, so times count from 0."""

    def run(perturbed: Perturbed) -> Episode:
        found = growing(perturbed)
        return episode(ALL, found.motions, [operation("wait", "fall", 1.0)] * 3)

    found = sensitivity(Scripted(run), Perturbation("x", 1, "a"))
    assert found.ratio[0.1] == pytest.approx(1.0)
    assert found.ratio[1.0] == pytest.approx(6.0)


def test_only_what_comes_before_is_judged() -> None:
    grown = Sensitivity("sim", "it", {0.1: 1.0, 5.0: 4.0, 20.0: None}, 9.0, {"a": 2.0, "b": None})
    grown.assert_below(4.5, until=5.0)
    grown.assert_below(2.5, until="a")
    with pytest.raises(AssertionError) as caught:
        grown.assert_below(4.0, until=5.0)
    assert str(caught.value) == f"sim: {grown.sentence}; expected below 4 until 5 s"
    with pytest.raises(AssertionError) as caught:
        grown.assert_below(9.0, until="b")
    assert str(caught.value) == "sim: the task never came to b"
    with pytest.raises(AssertionError, match=r"the task never came to 0\.05 s"):
        grown.assert_below(9.0, until=0.05)
    with pytest.raises(ValueError, match="^no moment is named 'c'; there are: a, b$"):
        grown.assert_below(9.0, until="c")
    with pytest.raises(ValueError, match="^no moment is named 'c'; there are: none$"):
        Sensitivity("sim", "it", {}, 9.0).assert_below(9.0, until="c")


def test_an_episode_that_ended_before_shows_nothing_of_the_rest() -> None:
    """One of 1.4 s passed as "below 2 until 20 s"."""
    course = [(0.0, 1.0), (1.0, 1.2), (1.4, 1.3)]
    grown = Sensitivity("sim", "it", {0.1: 1.0, 1.0: 1.2, 5.0: None}, 1.3, course=course)
    grown.assert_below(2.0, until=1.4)
    with pytest.raises(AssertionError, match=r"^sim: the task ended after 1\.4 s, before 20 s$"):
        grown.assert_below(2.0, until=20.0)


def test_a_peak_between_the_times_that_are_told_is_judged() -> None:
    """Growth is told at 1 s and 5 s; 1000 mm per mm at 2 s passed as "below 10 until 3 s"."""

    def run(perturbed: Perturbed) -> Episode:
        off = sum(p.amount for p in perturbed)
        ways = [off, off, 1000 * off, off]
        motions = [motion([0.0], [off], [0.5]), motion([0.5, 1.0, 2.0, 4.0], ways, [0.5] * 4)]
        return episode(ALL, motions, [operation("wait", "fall", 4.0)])

    found = sensitivity(Scripted(run), Perturbation("x", 1, "a"))
    found.assert_below(10.0, until=1.5)
    with pytest.raises(AssertionError, match=r"most 1000; expected below 10 until 3 s$"):
        found.assert_below(10.0, until=3.0)


@pytest.mark.parametrize(
    ("ask", "sentence"),
    [
        (
            lambda e: sensitivity(e, Perturbation("yaw", 10, "a")),
            "per millimetre, not for 1 deg of",
        ),
        (lambda e: sensitivity(e, Perturbation("x", 0, "a")), "per millimetre, not for 0 mm in x"),
        (lambda e: sensitivity(e, Perturbation("x", 1, "c")), "is 'c'; choose from a, b$"),
        (lambda e: stability(e, {"x": 1e-3}, examples=0), "^the number of examples is 0; it must"),
        (lambda e: search(e, {"x": 1e-3}, at_once=0), "^the number of perturbations at once is 0"),
    ],
)
def test_what_cannot_be_asked_is_a_sentence(ask: Callable[[Any], Any], sentence: str) -> None:
    experiment = Scripted(growing)
    with pytest.raises(ValueError, match=sentence):
        ask(experiment)
    assert not experiment.asked


def test_what_scored_nothing_can_keep_nothing() -> None:
    """0 of 4 stood, with and without perturbations: 100 % was said to be kept of it."""
    with pytest.raises(AssertionError, match="^sim: the run without perturbations scored 0"):
        stability(Scripted(lambda p: moved(shift(p), {**ALL, "standing": 0.0})), {"x": 1e-3})


def test_stability_of_a_known_world() -> None:
    experiment = Scripted(toppling)
    found = stability(experiment, {"x": 1e-3}, examples=12, at_most=1)
    assert len(experiment.asked) == 13
    trials = [toppling(asked[0]).counts["standing"] for asked in experiment.asked[1:]]
    assert list(found.kept) == trials
    assert found.unchanged == trials.count(1.0)
    assert (found.simulator, found.bounds) == ("sim", "1 mm in x")
    worst = min(experiment.asked[1:], key=lambda asked: toppling(asked[0]).counts["standing"] or 0)
    assert min(trials) < 1.0
    names = {0.75: "topples one", 0.5: "topples one and two"}
    assert found.worst == f"{worst[0][0]} {names[min(trials)]}"
    assert found.share.mean == pytest.approx(np.mean(trials))
    assert found.same.mean == pytest.approx(found.unchanged / 12)
    again = stability(Scripted(toppling), {"x": 1e-3}, examples=12, at_most=1)
    assert again == found
    fine = stability(Scripted(lambda p: moved(shift(p))), {"x": 1e-3}, examples=5, at_most=1)
    assert (fine.kept, fine.unchanged, fine.worst) == ((1.0,) * 5, 5, "")
    other = Scripted(toppling)
    stability(other, {"x": 1e-3}, examples=12, at_most=1, random_seed=1)
    assert other.asked != experiment.asked


def test_what_a_stability_says() -> None:
    kept = [1.0, 0.5, 1.0, 1.0, 1.0]
    found = Stability("sim", kept, 4, "1 mm in x", "it topples one")
    low, high = (100 * end for end in (found.share.low, found.share.high))
    assert found.sentence == (
        f"kept 90 % [{low:.0f}, {high:.0f}] within 1 mm in x; the same outcome in 4 of 5; worst: "
        "it topples one"
    )
    assert found.to_wire() == {
        "kept": kept,
        "unchanged": 4,
        "bounds": "1 mm in x",
        "worst": "it topples one",
        "sentence": found.sentence,
    }
    with pytest.raises(AssertionError) as caught:
        Stability("sim", [0.0] * 9, 0, "1 mm in x", "").assert_kept_at_least(0.9)
    assert str(caught.value).startswith("sim: at least 90 % should be kept, but kept 0 % [0, ")
    assert "worst" not in str(caught.value)


def test_what_is_not_decided_warns_or_fails_if_strict() -> None:
    found = Stability("sim", [1.0] * 8, 8, "1 mm in x", "")
    assert found.sentence == "kept 100 % [58, 100] within 1 mm in x; the same outcome in 8 of 8"
    found.assert_kept_at_least(0.5)
    with pytest.warns(
        InconclusiveWarning, match="at least 90 % should be kept, inconclusive: kept"
    ):
        found.assert_kept_at_least(0.9)
    with pytest.raises(AssertionError, match=r"inconclusive: kept 100 % .*\(--sim-strict\)"):
        replace(found, strict=True).assert_kept_at_least(0.9)
    with pytest.warns(InconclusiveWarning, match="not judged: .*a claim needs 5 rep") as caught:
        Stability("sim", [0.0] * 4, 0, "1 mm in x", "").assert_kept_at_least(0.9)
    assert caught[0].filename == __file__
