"""Frictions with which an engine's own rule gives the pairs of a scene."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.scene import Box, Pose, Scene, SceneError
from pytest_simbench.scene.friction import RULES
from pytest_simbench.scene.pair_friction import combined
from pytest_simbench.testing import scenes
from tests.approval import assert_approved_message
from tests.scene.test_bodies import SHAPES, thing


def scene(rule: str, ground: float, *frictions: float) -> Scene:
    """Cubes beside each other; the last one is a compound."""
    cubes = [
        Box(f"cube{k}", (0.1,) * 3, Pose.at(0.3 * k, 0, 0.05), 1.0, mu)
        for k, mu in enumerate(frictions)
    ]
    shapes = tuple(shape.with_friction(frictions[-1]) for shape in SHAPES)
    last = thing(friction=frictions[-1], shapes=shapes, pose=Pose.at(0.3 * len(cubes), 0, 0.5))
    return Scene("s", (*cubes[:-1], last), ground_friction=ground, friction_rule=rule)


def of_pairs(made: Scene) -> list[float]:
    """The friction of each pair that can touch."""
    own = np.array([made.ground_friction, *(body.friction for body in made.bodies)])
    first, second = np.triu_indices(len(own), 1)
    return RULES[made.friction_rule](own[first], own[second]).tolist()


@pytest.mark.parametrize("rule", sorted(RULES))
def test_a_scene_of_one_friction_is_the_same_by_every_rule(rule: str) -> None:
    even = scene("maximum", 0.7, 0.7, 0.7)
    assert combined(even, rule) == (even, "")


@pytest.mark.parametrize("rule", ["mean", "geometric", "harmonic"])
@pytest.mark.parametrize("asked", sorted(RULES))
@given(ground=st.floats(0.2, 1.0), mu=st.floats(0.5, 0.8))
def test_equal_bodies_on_another_ground_have_their_pairs_by_a_mean(
    rule: str, asked: str, ground: float, mu: float
) -> None:
    """Three numbers for the pairs of two bodies and the ground: each mean can have them, but for
    negative ones."""
    own = scene(asked, ground, mu, mu)
    made, problem = combined(own, rule)
    if not problem:
        assert of_pairs(made) == pytest.approx(of_pairs(own), abs=1e-3)
        assert {shape.friction for shape in made.bodies[-1].parts} == {made.bodies[-1].friction}
    else:
        assert max(np.abs(np.subtract(of_pairs(made), of_pairs(own)))) > 1e-3


def test_the_bowl_s_frictions_are_exact_by_a_mean_and_not_by_the_smaller_one() -> None:
    own = scene("maximum", 1.0, 0.95, 0.95)
    for rule in ("mean", "geometric", "harmonic"):
        made, problem = combined(own, rule)
        assert problem == ""
        assert of_pairs(made) == pytest.approx([1.0, 1.0, 0.95], abs=1e-3)
    made, problem = combined(own, "minimum")
    assert "of cube0 and thing it is off by 0.05" in problem
    assert_approved_message(problem)
    assert of_pairs(made) == pytest.approx([1.0, 1.0, 1.0])


@pytest.mark.parametrize("rule", sorted(RULES))
def test_pairs_that_are_kept_apart_leave_the_others_exact(rule: str) -> None:
    own = scene("maximum", 0.05, 0.2, 0.9, 0.1, 0.3)
    names = ["ground", *(f"body/{body.name}" for body in own.bodies)]
    together = [(1, 2), (3, 4)]  # the ground touches nothing
    pairs = [pair for pair in combinations(range(5), 2) if pair not in together]
    apart = tuple((names[a], names[b]) for a, b in pairs)
    made, problem = combined(replace(own, apart=apart), rule)
    assert problem == ""
    assert made.ground_friction == 0.05
    a, b, c, d = (body.friction for body in made.bodies)
    assert RULES[rule](np.array([a, c]), np.array([b, d])) == pytest.approx([0.9, 0.3])


def test_what_all_links_are_kept_apart_from_does_not_touch_the_robot() -> None:
    robot, links = replace(scenes.arm(), friction=0.9), ["one", "two"]
    for kept, mu in ((links, 0.1), (links[:1], 0.9)):
        apart = tuple((f"link/{link}", "ground") for link in kept)
        own = Scene("s", robot=robot, ground_friction=0.1, apart=apart)
        assert combined(own, "minimum", links)[0].ground_friction == mu


def test_links_that_collide_keep_their_own_friction_or_that_they_do_not_is_told() -> None:
    robot = replace(scenes.arm(), friction=0.0, self_collide=True)
    own = Scene("s", robot=robot, ground_friction=0.5)
    made, problem = combined(own, "mean")
    assert problem == ""
    assert sorted(made.frictions) == pytest.approx([0.0, 1.0])
    _, problem = combined(own, "minimum")
    assert f"of {robot.name} and itself it is off by 0.5" in problem
    own = replace(own, robot=replace(robot, self_collide=False))
    made, _ = combined(own, "mean")
    assert [made.ground_friction, made.arm.friction] == pytest.approx([0.5, 0.5])


def test_an_unknown_rule_is_refused_with_those_there_are() -> None:
    with pytest.raises(SceneError, match=r"'loudest'.*maximum, minimum, mean"):
        Scene("s", friction_rule="loudest")
