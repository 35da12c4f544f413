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
from pytest_simbench.scene.pair_friction import OF_PAIRS, combined
from pytest_simbench.tasks import Settling
from pytest_simbench.tasks.base import Jitter
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
        assert max(np.abs(np.log(np.divide(of_pairs(made), of_pairs(own))))) > 1e-3


def test_the_bowl_s_frictions_are_exact_by_a_mean_and_not_by_the_smaller_one() -> None:
    own = scene("maximum", 1.0, 0.95, 0.95)
    for rule in ("mean", "geometric", "harmonic"):
        made, problem = combined(own, rule)
        assert problem == ""
        assert of_pairs(made) == pytest.approx([1.0, 1.0, 0.95], abs=1e-3)
    made, problem = combined(own, "minimum")
    assert "of cube0 and thing it is 1, not 0.95 (" in problem
    assert_approved_message(problem)
    assert of_pairs(made) == pytest.approx([1.0, 1.0, 1.0])


def test_an_engine_of_the_larger_one_has_a_scene_of_the_smaller_one() -> None:
    """Of two that lie alike all pairs, else those that touch."""
    made, problem = combined(scene("minimum", 0.9, 0.3, 0.3), "maximum")
    assert (of_pairs(made), problem) == ([0.3] * 3, "")
    made, problem = combined(scene("minimum", 0.3, 0.5, 0.9), "maximum")
    assert (of_pairs(made)[0], "ground and cube0" in problem) == (0.3, False)
    assert "of cube0 and thing it is 0.3, not 0.5" in problem


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


def sliding() -> Scene:
    """A puck and a block lie on a floor; a table stands and an arm hangs elsewhere."""
    puck = Box("puck", (0.1,) * 3, Pose.at(0.5, 0, 0.05), 1.0, 0.2)
    block = Box("block", (0.1,) * 3, Pose.at(0.5, 1, 0.0509), 1.0, 0.8)
    table = Box("table", (0.2,) * 3, Pose.at(-1, 2, 0.1), friction=1.0)
    return Scene("s", (puck, block, table), scenes.arm(), ground_friction=0.2)


@pytest.mark.parametrize("rule", sorted(RULES))
def test_what_touches_at_the_start_is_exact(rule: str) -> None:
    made, problem = combined(sliding(), rule)
    assert of_pairs(made)[:2] == pytest.approx([0.2, 0.8])
    assert bool(problem) == (rule != "maximum")
    assert "ground and puck" not in problem


def test_what_falls_has_its_friction_with_what_stands_still() -> None:
    puck, falling = (
        Box(name, (0.1,) * 3, Pose.at(x, 0, z), 1.0, mu)
        for name, x, z, mu in (("puck", 0, 0.05, 0.9), ("falling", 2, 1, 0.5))
    )
    made, problem = combined(Scene("s", (puck, falling), ground_friction=0.2), "minimum")
    assert of_pairs(made)[:2] == pytest.approx([0.9, 0.5])
    assert "of puck and falling" in problem


@pytest.mark.parametrize("rule", sorted(RULES))
def test_a_block_between_ground_and_hand_has_both_its_frictions(rule: str) -> None:
    block = Box("block", (0.1,) * 3, Pose.at(0.5, 0, 0.05), 1.0, 0.3)
    made, problem = combined(Scene("s", (block,), scenes.arm(), ground_friction=0.3), rule)
    robot, [box] = made.arm, made.bodies
    pairs = RULES[rule](np.array([made.ground_friction, robot.friction]), box.friction)
    assert pairs == pytest.approx([0.3, 1.0])
    assert problem.startswith(OF_PAIRS + "not") == (rule in ("harmonic", "minimum"))
    assert f"{robot.name} it is" in problem or not problem


@pytest.mark.parametrize("rule", ["mean", "geometric", "harmonic"])
@given(data=st.data())
def test_bodies_on_the_ground_have_their_frictions_there(rule: str, data: st.DataObject) -> None:
    ground, *frictions = data.draw(st.lists(st.floats(0.05, 2.0), min_size=4, max_size=6))
    own = scene("maximum", ground, *frictions)
    last = own.bodies[-1]
    low = float(last.reach_placed(np.array([[0.0, 0.0, -1.0]]))[0])
    own = own.with_pose(last.name, last.pose * Pose.at(0, 0, low))
    made, problem = combined(own, rule)
    count = len(frictions)
    assert of_pairs(made)[:count] == pytest.approx(of_pairs(own)[:count], rel=1e-3)
    assert "ground" not in problem


def test_a_start_that_is_moved_has_the_same_frictions() -> None:
    """Boxes 0.8 mm apart, which touch or not as they are moved by less: frictions were chosen
    anew for each repetition, and a moved start was another scene."""
    row = tuple(
        Box(f"box{k}", (0.1,) * 3, Pose.at(0.1008 * k, 0, 0.05), 1.0, mu)
        for k, mu in enumerate((0.2, 0.5, 0.9))
    )
    task = Settling(Scene("s", row, ground_friction=0.4), moved=3.9e-4)
    made = [combined(task.scene(seed, Jitter()), "minimum")[0] for seed in range(10)]
    assert (
        len({(scene.ground_friction, *(b.friction for b in scene.bodies)) for scene in made}) == 1
    )
    assert len({scene.bodies[0].pose for scene in made}) == 10


def test_the_worst_pair_that_touches_is_told_first() -> None:
    cubes = [
        Box(f"cube{k}", (0.1,) * 3, Pose.at(0.1 * k, 0, 0.05), 1.0, mu)
        for k, mu in enumerate((0.2, 0.2, 0.9))
    ]
    far = Box("far", (0.1,) * 3, Pose.at(1, 0, 0.05), 1.0, 4.0)
    made, problem = combined(Scene("s", (*cubes, far), ground_friction=0.2), "minimum")
    assert "the scene's: of the ground and cube1 it is 0.9, not 0.2; " in problem
    assert_approved_message(problem)
    assert of_pairs(made)[:4] == pytest.approx([0.2, 0.9, 0.9, 4.0])


def test_an_engine_of_several_rules_has_the_scene_s() -> None:
    own = sliding()
    assert combined(own, "mean|maximum") == (own, "")
    assert combined(own, "mean|minimum") == combined(own, "mean")


def test_an_engine_of_no_rule_keeps_the_frictions_and_that_is_told() -> None:
    own = sliding()
    made, problem = combined(own, "")
    assert made == own
    assert problem.startswith(OF_PAIRS)
    assert_approved_message(problem)


def test_links_that_collide_keep_their_own_friction_or_that_they_do_not_is_told() -> None:
    robot = replace(scenes.arm(), friction=0.0, self_collide=True)
    own = Scene("s", robot=robot, ground_friction=0.5)
    made, problem = combined(own, "mean")
    assert problem == ""
    assert sorted(made.frictions) == pytest.approx([0.0, 1.0])
    _, problem = combined(own, "minimum")
    assert f"of {robot.name} and itself it is 0.5, not 0" in problem
    own = replace(own, robot=replace(robot, self_collide=False))
    made, _ = combined(own, "mean")
    assert [made.ground_friction, made.arm.friction] == pytest.approx([0.5, 0.5])


def test_an_unknown_rule_is_refused_with_those_there_are() -> None:
    with pytest.raises(SceneError, match=r"'loudest'.*maximum, minimum, mean"):
        Scene("s", friction_rule="loudest")
