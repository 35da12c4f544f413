"""Links that collide with each other, who has none, and what is expected of the others."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_simbench.laws.domino import DominoWave
from pytest_simbench.robot.panda import panda
from pytest_simbench.scene import Robot, Scene
from pytest_simbench.simulator import NotSupportedError, PreparedRobot
from pytest_simbench.simulator.links import (
    check_self_collision,
    joined,
    links_collide,
)
from pytest_simbench.simulator.quantities import expected_quantities
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.simulator.settings import Settings


def test_who_has_links_pass_through_each_other_says_so() -> None:
    info = replace(adapter("mujoco").info, name="mysim", capabilities=frozenset())
    scene = DominoWave().build()
    message = "mysim has links of a robot pass through each other, and those of scene 'domino_wave'"
    with pytest.raises(NotSupportedError, match=message):
        check_self_collision(info, scene)
    assert scene.robot is not None
    passing = replace(scene, robot=replace(scene.robot, self_collide=False))
    check_self_collision(info, passing)
    check_self_collision(info, Scene("empty"))
    check_self_collision(adapter("mujoco").info, scene)


def test_it_travels_and_other_robots_look_as_before() -> None:
    colliding = replace(panda(), self_collide=True)
    assert Robot.from_wire(colliding.to_wire()).self_collide
    assert not Robot.from_wire(panda().to_wire()).self_collide
    assert "self_collide" not in panda().to_wire()


def test_links_that_one_joint_joins_never_collide() -> None:
    robot = PreparedRobot(replace(panda(), self_collide=True))
    assert frozenset(("base", "panda_link1")) in joined(robot)
    assert not links_collide(robot, "panda_link1", "base")
    assert links_collide(robot, "base", "panda_link2")
    assert not links_collide(PreparedRobot(panda()), "base", "panda_link2")


def test_shares_of_links_that_can_be_touched() -> None:
    """Of the Panda's ten links, each but the ends is joined to two others."""
    colliding = replace(panda(), self_collide=True)
    found = expected_quantities(Scene("s", (), colliding), Settings())
    shares = {
        name: found[f"link/{name}/touches"].tolist() for name in PreparedRobot(colliding).links
    }
    assert shares["base"] == [0, 0, pytest.approx(8 / 9)]
    assert shares["panda_link3"] == [1, 0, pytest.approx(7 / 9)]
    assert shares["panda_leftfinger"] == [1, 0, pytest.approx(8 / 9)]
