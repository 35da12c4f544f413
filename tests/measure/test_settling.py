"""The noise of a scene: which simulators differ, whether moved starts explain it, which ends hold
with finer steps; from planted records, and the sentences made of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from pytest_simbench.measure.settling import Settled, settlings
from pytest_simbench.records.record import Record
from pytest_simbench.report.model.settling import section, sentences
from tests.records.build import record

MODE = ("headless", "tuned")
A = ("a", *MODE)


def end(
    simulator: str, x: float, step: float = 0.002, moved: float = 0.0, seed: int = 1, **given: Any
) -> Record:
    """A repetition in which the bowl ends at x [mm]."""
    place = [x / 1000, 0.0, 0.9, 1.0, 0.0, 0.0, 0.0]
    told = {
        "test": f"test_scene[{simulator}-headless]",
        "task": "settling",
        "simulator": simulator,
        "seed": seed,
        "metrics": {"premises": float(x < 20)},
        "details": {"places": {"bowl": place}},
        "settings": {
            "timestep": step, "task.scene": "bowl", "task.scene_digest": "d",
            "task.seconds": 2.5, "task.moved": moved, "task.starts": 0,
        },
        "stepping": {},
    }  # fmt: skip
    return record(seed, **{**told, **given})


def one(*records: Record) -> Settled:
    (found,) = settlings(records)
    return found


def test_ends_within_a_millimetre_are_alike_also_through_a_third() -> None:
    found = one(end("a", 1.8), end("b", 0.9), end("c", 0.0), end("d", 5.0))
    assert [[who[0] for who in group] for group in found.places(found.written)] == [
        ["a", "b", "c"], ["d"],
    ]  # fmt: skip
    assert sentences(found)[0] == (
        "As written, bowl ends in 2 ways: a, b and c; d. They differ by up to 5 mm (bowl, c and d)."
    )
    many = one(*(end(who, 0.5 * k) for k, who in enumerate("abcdef")), end("z", 10.0))
    assert sentences(many)[0] == (
        "As written, bowl ends in 2 ways: a, b, c, d and 2 more; z. They differ by up to 10 mm "
        "(bowl, a and z)."
    )
    assert sentences(one(end("a", 0.0), end("b", 0.9))) == [
        "As written, bowl ends alike in all 2, within 1 mm."
    ]


def test_a_difference_that_a_moved_start_makes_too_is_noise() -> None:
    apart = [end("a", 0.0), end("b", 10.0)]
    still = [end(who, at, moved=1e-4, seed=k) for who, at in (("a", 0), ("b", 10)) for k in (1, 2)]
    assert sentences(one(*apart, *still))[1] == (
        "Starts moved by up to 0.1 mm move no end so far: the difference is more than the start's "
        "noise."
    )
    found = one(*apart, *still, end("b", 21.0, moved=1e-3))
    assert found.noise(("b", "headless", "tuned"), 1e-3) == pytest.approx(11.0)
    assert found.noise(("a", "headless", "tuned"), 1e-3) is None
    assert sentences(found)[1] == (
        "A start moved by 1 mm moves the end within one simulator as far: the difference is the "
        "scene's own noise, and no cause can be told from it."
    )
    more = [*apart, *still, end("b", 21.0, moved=1e-3), end("c", 100.0)]
    third = one(*more, end("a", 0.0, moved=1e-3), end("c", 100.0, moved=1e-3))
    assert sentences(third)[1] == (
        "Of 3 pairs that differ, moved starts explain 1; the others differ by more than starts "
        "moved by up to 1 mm do."
    )
    assert sentences(one(*more))[1] == (
        "Of 3 pairs that differ, moved starts explain 1; of 2 nobody knows, since no moved start "
        "ended in both."
    )
    assert sentences(one(*more, end("c", 100.0, moved=1e-3)))[1] == (
        "Of 3 pairs that differ, moved starts explain 1; 1 differ by more than starts moved by up "
        "to 1 mm do; of 1 nobody knows, since no moved start ended in both."
    )


def crashed(simulator: str, *more: float, **given: Any) -> Record:
    """The same of a repetition that crashed, which has no end."""
    return end(simulator, 0.0, *more, status="failed", details={}, metrics={}, **given)


def test_moved_starts_that_crashed_are_no_sign_that_the_start_has_no_noise() -> None:
    apart, moved = [end("a==1", 0.0), end("a==2", 10.0)], [crashed("a==2", moved=1e-4)]
    for lost in [*moved, crashed("a==1", moved=1e-4)], [*moved, end("a==1", 0.0, moved=1e-4)]:
        assert sentences(one(*apart, *lost))[1:3] == [
            "2 moves the end by 10 mm: no moved start ended in both, so it may be noise.",
            "No moved start ended in both, so nobody knows whether this is more than noise.",
        ]


def test_without_moved_starts_or_finer_steps_nobody_knows() -> None:
    told = sentences(one(end("a", 0.0), end("b", 10.0)))
    assert told[1:] == [
        "No moved start was tried, so nobody knows whether this is more than noise.",
        "No finer step was tried, so nobody knows whether an end is converged.",
    ]
    crashed = end("a", 0.0, 0.0005, status="failed", details={}, metrics={})
    assert sentences(one(end("a", 0.0), end("b", 10.0), crashed))[2] == (
        "With steps 4 times as fine no repetition finished."
    )
    moved = one(end("a", 0.0), end("a", 1.2, moved=6e-4))
    assert sentences(moved) == ["bowl ran in a alone, so nothing is compared."]


def test_a_finer_step_says_whether_the_difference_survives_and_who_is_not_converged() -> None:
    apart = [end("a", 0.0), end("b", 10.0), end("a", 0.1, 0.0005), end("b", 10.2, 0.0005)]
    found = one(*apart)
    assert found.change(("b", "headless", "tuned"), 4) == pytest.approx(0.2)
    assert sentences(found)[2] == (
        "With steps 4 times as fine they still end in 2 ways, up to 10 mm apart, where they ended "
        "before: the step is not to blame."
    )
    found = one(*apart, end("a", 0.1, 0.00025), end("b", 0.3, 0.00025))
    assert sentences(found)[2] == (
        "With steps 8 times as fine they all end alike; the end of b depends on the step, so it is "
        "not converged."
    )


def test_who_crashed_at_the_finer_step_does_not_end_alike() -> None:
    apart = [end("a", 0.0), end("b", 10.0), end("a", 0.1, 0.0005), crashed("b", 0.0005)]
    assert sentences(one(*apart))[2] == (
        "With steps 4 times as fine there is no end of b, and nothing is compared."
    )
    assert sentences(one(*apart, end("c", 5.0), end("c", 0.2, 0.0005)))[2] == (
        "With steps 4 times as fine there is no end of b, and the others all end alike; the end of "
        "c depends on the step, so it is not converged."
    )


def test_equal_ends_of_one_start_that_is_unstable_are_no_agreement() -> None:
    tried = [end("a", 25.0, moved=1e-4), end("b", 3.0, moved=1e-4), end("a", 90.0, moved=1e-3)]
    assert sentences(one(end("a", 0.0), end("b", 0.5), *tried)) == [
        "As written, bowl ends alike in all 2, within 1 mm.",
        "But a start moved by 0.1 mm moves an end by up to 25 mm: equal ends of one start are no "
        "sign that the simulators agree.",
    ]


def test_a_crash_is_told_and_other_scenes_stay_apart() -> None:
    other = {"settings": {**end("a", 0).settings, "task.scene": "cup"}}
    records = [
        end("c", 0.0, details={}), end("a", 0.0), end("b", 9.0, metrics={}),
        end("a", 1.26, moved=1e-3),
        end("a", 0.0, moved=1e-3, seed=2, status="failed", details={}, metrics={}),
        end("a", 3.0, **other), end("b", 3.0, **other),
    ]  # fmt: skip
    bowl, cup = settlings(records)
    assert (bowl.scene, cup.scene) == ("bowl", "cup")
    heads = [column.heading for column in section(bowl).tables[0].columns]
    assert heads == ["simulator", "as written", "moved by 1 mm", "CPU s/sim s"]
    told = [[cell.text for cell in one.cells] for one in section(bowl).tables[0].columns]
    assert told[:3] == [["a", "b"], ["100 %", "ended"], ["100 % 1.3 1 crashed", "-"]]
    for key in ("task.scene", "task.scene_digest", "task.seconds", "task.starts"):
        other = {"settings": {**end("a", 0).settings, key: 3}}
        more = [end(who, 3.0, **other, test=f"x.py::test_x[{who}-headless-b]") for who in "ab"]
        found = [one.scene for one in settlings([*records[1:3], *more])]
        named = ["bowl (test_scene)", "bowl (test_x b)"]  # both were called "bowl"
        assert found == (["bowl", "3"] if key == "task.scene" else named)


def test_each_configuration_has_ends_of_its_own() -> None:
    """Their mean would be the end of neither."""
    records = [
        replace(r, settings={**r.settings, "iterations": k})
        for k, x in ((10, 0.0), (100, 30.0))
        for r in (end("a", x), end("a", x, 0.0005), end("a", x + 2, moved=1e-3))
    ]
    found = one(*records, end("b", 15.0))
    assert list(found.written) == [(*A, "iterations=10"), (*A, "iterations=100"), ("b", *MODE)]
    told = [[cell.text for cell in one.cells] for one in section(found).tables[0].columns]
    assert told[0] == ["a (iterations=10)", "a (iterations=100)", "b"]
    assert told[2:4] == [["100 % 2", "0 % 2", "-"], ["100 % 0", "0 % 0", "-"]]


def test_one_simulator_without_moved_starts_is_no_comparison() -> None:
    assert settlings([end("a", 0.0)]) == []


def at(who: str, seed: int, x: float, moved: float = 0.0, step: float = 0.002) -> Record:
    """The same from one of two stored starts."""
    own = {**end(who, 0.0, step).settings, "task.starts": 2, "task.moved": moved}
    return end(who, x, seed=seed, settings=own)


def test_stored_starts_are_held_against_themselves_alone() -> None:
    """Two starts that are 500 mm apart on the table are no noise of 500 mm."""
    apart = [at("a", 2, 0.0), at("a", 3, 500.0), at("b", 2, 0.0), at("b", 3, 510.0)]
    moved = [at("a", 2, 0.1, 1e-4), at("a", 3, 500.2, 1e-4)]
    found = one(*apart, *moved)
    a, b = found.written
    assert found.apart(found.written[a], found.written[b]) == (pytest.approx(10.0), "bowl")
    assert found.noise(a, 1e-4) == pytest.approx(0.2)
    lost = one(*apart[:3], *moved)  # b has one start: the other one is not compared
    assert lost.apart(lost.written[a], lost.written[b])[0] == pytest.approx(0.0)


def test_ends_of_different_starts_are_no_agreement() -> None:
    found = one(
        at("a", 2, 0.0), at("b", 3, 0.0), at("a", 2, 0.0, step=5e-4), at("b", 3, 0.0, step=5e-4)
    )
    assert sentences(found) == [
        "As written, a; b have no start of bowl in common that ended, so nobody knows whether they "
        "end alike.",
        "With steps 4 times as fine they have no start in common, where they ended before: the "
        "step is not to blame.",
    ]
    third = [at("a", 2, 0.0), at("b", 3, 0.0), at("c", 2, 9.0), at("a", 3, 0.0, step=5e-4)]
    assert sentences(one(*third))[:2] == [
        "As written, bowl ends in 3 ways: a; b; c. They differ by up to 9 mm (bowl, a and c).",
        "Of 2 pairs more nobody knows, since no start ended in both.",
    ]
    assert sentences(one(*third))[-1] == (
        "With steps 4 times as fine there is no end of b and c, and nothing is compared."
    )


def test_releases_are_told_as_spans_with_the_move_that_does_what_each_boundary_does() -> None:
    ends = {"1.10": 30.0, "1.8": 0.0, "1.9": 0.3, "1.11": 30.1, "2.0": 90.0}
    records = [end(f"sim=={release}", x) for release, x in ends.items()]
    records += [end(f"sim=={release}", x + 35, moved=1e-4) for release, x in ends.items()]
    records += [end(f"sim=={release}", x, 0.0005) for release, x in ends.items()]
    records += [end("sim==1.9", 9.0, 0.00025)]
    told = sentences(one(*records))
    assert told[0].startswith(
        "As written, bowl ends in 3 ways: sim==1.8 to 1.9; sim==1.10 to 1.11; sim==2.0. "
    )
    assert told[1:3] == [
        "1.10 moves the end by 30 mm: a start moved by 0.1 mm does so within one release.",
        "2.0 moves the end by 60 mm: no start that was moved does so.",
    ]
    assert told[-1].endswith("the end of sim==1.9 depends on the step, so it is not converged.")
    alone = one(*records).only([("sim==1.9", *MODE), ("sim==1.10", *MODE)])
    assert sentences(alone)[0].startswith("As written, bowl ends in 2 ways: sim==1.9; sim==1.10. ")
