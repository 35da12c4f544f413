"""Restitutions that differ: what counts where two surfaces meet is told to be the engine's own."""

from __future__ import annotations

import pytest

from pytest_simbench.scene import Pose, Scene, Sphere
from pytest_simbench.scene.pair_restitution import unlike
from pytest_simbench.testing import scenes
from tests.approval import assert_approved_message


def scene(ground: float, ball: float, robot: bool = False) -> Scene:
    bodies = (Sphere("ball", 0.05, Pose.at(2, 0, 0.05), 0.1, restitution=ball),)
    return Scene("s", bodies, scenes.arm() if robot else None, ground_restitution=ground)


@pytest.mark.parametrize("told", [(0.0, 0.0, True), (0.6, 0.6, False)])
def test_one_restitution_is_no_question(told: tuple[float, float, bool]) -> None:
    assert not unlike(scene(*told))


def test_two_are_one() -> None:
    assert_approved_message(unlike(scene(0.6, 0.25)))
    assert unlike(scene(0.6, 0.0))


def test_robots_do_not_bounce() -> None:
    assert unlike(scene(0.6, 0.6, True))
