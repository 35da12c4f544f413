"""Bodies of several shapes, and the friction of pairs by each engine's rule."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.scene import (
    Box,
    Compound,
    Cylinder,
    Pose,
    Scene,
    SceneError,
    Sphere,
    penetration,
)
from pytest_simbench.scene.friction import RULES
from pytest_simbench.scene.pair_friction import combined

SHAPES = (
    Box("wall", (0.02, 0.1, 0.2), Pose.at(0.05, 0, 0)),
    Cylinder("rod", 0.01, 0.1, Pose((-0.05, 0, 0), (0.8, 0.6, 0.0, 0.0))),
    Sphere("knob", 0.03, Pose.at(0, 0, -0.1)),
)


def thing(**given: Any) -> Compound:
    place = given.pop("pose", Pose.at(0.3, 0.2, 0.5, yaw=0.4))
    shapes = given.pop("shapes", SHAPES)
    return Compound("thing", shapes, place, **{"mass": 1.0, "moments": (2e-3,) * 3, **given})


def test_it_crosses_with_its_shapes() -> None:
    told = json.loads(json.dumps(thing().to_wire()))
    assert Scene.from_wire({"name": "s", "bodies": [told]}).bodies == (thing(),)


def test_it_reaches_as_far_as_its_farthest_shape() -> None:
    body = thing()
    assert body.extents == pytest.approx((2 * 0.06, 2 * (0.96 * 0.05 + 0.28 * 0.01), 2 * 0.13))
    down = np.array([[0.0, 0.0, -1.0]])
    assert body.reach_placed(down)[0] == pytest.approx(-0.5 + 0.13)


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-3.0, 3.0))
def test_it_overlaps_as_deep_as_one_of_its_shapes(x: float, z: float, yaw: float) -> None:
    other = Box("box", (0.05, 0.06, 0.07), Pose.at(0.3 + x, 0.2, 0.5 + z, yaw=yaw))
    body = thing()
    shapes = [shape.moved_to(body.pose * shape.pose) for shape in SHAPES]
    deepest = max(penetration(shape, other) for shape in shapes)
    assert max(penetration(body, other), 0.0) == pytest.approx(max(deepest, 0.0), abs=1e-9)
    assert max(penetration(other, body), 0.0) == pytest.approx(max(deepest, 0.0), abs=1e-9)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"shapes": ()}, "has no shapes"),
        ({"shapes": (SHAPES[0], SHAPES[0])}, "2 shapes of 'thing' are named 'wall'"),
        ({"shapes": (replace(SHAPES[0], mass=1.0),)}, "without a mass"),
        ({"shapes": (thing(mass=0.0),)}, "must be one shape"),
        ({"friction": 0.5}, "all shapes of a body have its"),
        ({"moments": None}, "no `moments`"),
    ],
)
def test_what_cannot_be_is_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        thing(**given)


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
    assert of_pairs(made) == pytest.approx([1.0, 1.0, 1.0])


def test_an_unknown_rule_is_refused_with_those_there_are() -> None:
    with pytest.raises(SceneError, match=r"'loudest'.*maximum, minimum, mean"):
        Scene("s", friction_rule="loudest")
