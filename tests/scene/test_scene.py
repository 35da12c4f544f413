"""Scenes reject what cannot exist, and travel unchanged."""

from __future__ import annotations

import pytest

from pytest_simbench.robot.panda import panda
from pytest_simbench.scene import Box, Pose, Scene, SceneError


def box(name: str, x: float, **more: float) -> Box:
    return Box(name, (0.05, 0.05, 0.05), Pose.at(x, 0.0, 0.025), mass=0.1, **more)


def test_two_bodies_of_one_name_are_an_error() -> None:
    with pytest.raises(SceneError, match="2 bodies are named 'a'"):
        Scene("s", (box("a", 0.0), box("a", 1.0)))


def test_overlapping_bodies_are_an_error_that_names_both() -> None:
    with pytest.raises(SceneError, match="'a' and 'b' overlap by 10.0 mm"):
        Scene("s", (box("a", 0.0), box("b", 0.04)))


def test_touching_bodies_are_fine() -> None:
    Scene("s", (box("a", 0.0), box("b", 0.05)))


def test_a_scene_travels_unchanged() -> None:
    scene = Scene("s", (box("a", 0.0), Box("t", (1, 1, 0.1), Pose.at(0, 0, -0.05))), panda())
    assert Scene.from_wire(scene.to_wire()) == scene


def test_an_unknown_body_lists_the_known_ones() -> None:
    with pytest.raises(KeyError, match=r"it has \['a'\]"):
        Scene("s", (box("a", 0.0),)).body("b")


def test_free_and_fixed_bodies_keep_their_order() -> None:
    scene = Scene("s", (box("b", 0.0), Box("t", (1, 1, 0.1), Pose.at(0, 0, -0.05)), box("a", 1.0)))
    assert [body.name for body in scene.free_bodies] == ["b", "a"]
    assert [body.name for body in scene.fixed_bodies] == ["t"]


def test_a_ground_that_bounces_crosses_and_another_is_not_named() -> None:
    bouncing = Scene("s", ground_restitution=0.5)
    assert Scene.from_wire(bouncing.to_wire()) == bouncing
    assert "ground_restitution" not in Scene("s").to_wire()
    with pytest.raises(SceneError, match="the ground's restitution in scene 's' is 2"):
        Scene("s", ground_restitution=2.0)
