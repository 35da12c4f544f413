"""Perturbations: units, words, and what they do to a scene."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import find, given, settings
from hypothesis import strategies as st
from hypothesis.errors import NoSuchExample

from pytest_simbench.repeatability.perturbation import (
    QUANTITIES,
    Perturbation,
    controller_delay,
    described,
    fits,
    perturbations,
    perturbed,
)
from pytest_simbench.scene import Scene
from pytest_simbench.tasks import Jitter, LeaningTowers, Nesting, Throwing

TOWER = LeaningTowers().scene(1, Jitter())
THROW = Throwing().scene(1, Jitter())


@pytest.mark.parametrize(
    ("perturbation", "text"),
    [
        (Perturbation("x", 7, "cube_12"), "0.7 mm in x of cube_12"),
        (Perturbation("y", -1, "cube_12"), "-0.1 mm in y of cube_12"),
        (Perturbation("yaw", 15, "a"), "1.5 deg of yaw of a"),
        (Perturbation("mass", -3, "a"), "-3 % in the mass of a"),
        (Perturbation("friction", 20), "20 % in the friction of all surfaces"),
        (Perturbation("squeeze", 5), "5 % in the gripper's squeeze"),
        (Perturbation("delay", 4), "4 ms of controller delay"),
    ],
)
def test_words(perturbation: Perturbation, text: str) -> None:
    assert str(perturbation) == text


def test_pose() -> None:
    before = TOWER.body("cube_02")
    after = Perturbation("x", 7, "cube_02").applied(TOWER).body("cube_02")
    assert after == replace(before, pose=before.pose.translated(x=0.0007))
    turned = Perturbation("yaw", -20, "cube_02").applied(TOWER).body("cube_02").pose
    assert turned.yaw - before.pose.yaw == pytest.approx(math.radians(-2))
    assert turned.position == before.pose.position


def test_mass_and_friction() -> None:
    heavier = Perturbation("mass", 10, "cube_02").applied(TOWER)
    assert heavier.body("cube_02").mass == pytest.approx(0.11)
    assert heavier.body("cube_01").mass == pytest.approx(0.1)
    smoother = Perturbation("friction", -20).applied(THROW)
    surfaces = [body.friction for body in smoother.bodies]
    surfaces += [smoother.ground_friction, smoother.robot.friction]
    assert surfaces == pytest.approx([0.8] * len(surfaces))
    bowls = Perturbation("friction", 20).applied(Nesting(2).scene(1, Jitter()))
    assert [*bowls.frictions] == pytest.approx([0.24])


def test_squeeze_is_the_fingers_alone() -> None:
    scene = Perturbation("squeeze", 20).applied(THROW)
    assert scene.robot.gripper.squeeze == pytest.approx(30.0)
    factors = scene.robot.column("effort_limit") / THROW.robot.column("effort_limit")
    assert list(factors) == pytest.approx([1.0] * 7 + [1.2] * 2)


def test_delay_changes_no_scene() -> None:
    late = (Perturbation("delay", 4), Perturbation("x", 1, "projectile"))
    assert late[0].applied(THROW) == THROW
    assert controller_delay(late) == pytest.approx(0.004)
    assert controller_delay(late[1:]) == 0


@given(perturbations(THROW, at_most=4))
def test_drawn_ones_fit_and_stay_within_their_bounds(found: tuple[Perturbation, ...]) -> None:
    assert 1 <= len(found) <= 4
    assert len({(p.quantity, p.body) for p in found}) == len(found)
    for perturbation in found:
        bound = QUANTITIES[perturbation.quantity].bound
        assert 0 < abs(perturbation.amount) <= bound * (1 + 1e-9)
        assert perturbation.quantity != "delay" or perturbation.amount > 0
    assert isinstance(perturbed(THROW, found), Scene)
    assert described(found).count(" and ") == len(found) - 1


@pytest.mark.parametrize("least", [1, 7, 50])
def test_shrinks_to_the_smallest_amount(least: int) -> None:
    strategy = perturbations(TOWER, {"x": 0.01, "mass": 0.5}, at_most=3)
    smallest = find(
        strategy,
        lambda found: any(p.quantity == "x" and abs(p.steps) >= least for p in found),
        settings=settings(database=None),  # of other parameters it would remember the result
    )
    assert smallest == (Perturbation("x", least, "cube_01"),)


def test_what_does_not_fit_is_never_drawn() -> None:
    """Cubes of the pyramid are 15 mm apart: more than that, and they are inside each other."""
    towards = Perturbation("y", -200, "pyramid_2")
    assert not fits(THROW, [towards])

    @given(perturbations(THROW, {"y": 0.03}))
    def check(found: tuple[Perturbation, ...]) -> None:
        assert fits(THROW, found)

    check()


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        ({"z": 1.0}, "no quantity is named 'z'; choose from x, y, yaw"),
        ({"x": 0.00001}, "the bound of x, 1e-05, is below its smallest step, 0.0001"),
        ({"x": float("nan")}, "the bound of x, nan, is below"),
        ({"squeeze": 0.1}, "scene 'leaning towers' has no robot to perturb"),
        ({}, "has nothing that could be perturbed"),
    ],
)
def test_bad_bounds(bounds: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        perturbations(TOWER, bounds)


def test_no_robot_no_squeeze() -> None:
    with pytest.raises(ValueError, match="has no robot"):
        Perturbation("squeeze", 1).applied(TOWER)


@given(steps=st.integers(-100, 100).filter(bool), name=st.sampled_from(["x", "y", "yaw"]))
def test_there_and_back(steps: int, name: str) -> None:
    there = Perturbation(name, steps, "cube_03").applied(TOWER)
    back = Perturbation(name, -steps, "cube_03").applied(there)
    assert back.body("cube_03").pose.as_array() == pytest.approx(
        TOWER.body("cube_03").pose.as_array(), abs=1e-12
    )


def test_the_smallest_delay_is_one_step() -> None:
    """It is never negative, and never more than its bound."""
    strategy = perturbations(THROW, {"delay": 0.003})
    assert [find(strategy, lambda found, n=n: found[0].steps == n)[0].steps for n in (1, 2, 3)] == [
        1, 2, 3,
    ]  # fmt: skip
    for steps in (-1, 0, 4):
        with pytest.raises(NoSuchExample):
            find(strategy, lambda found, n=steps: found[0].steps == n)
