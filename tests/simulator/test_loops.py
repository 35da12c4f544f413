"""Closures of loops, as the reduced robot has them, and who refuses them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pytest_simbench.laws.loops import FourBarClosure
from pytest_simbench.scene import Closure, Robot, Scene, SceneError
from pytest_simbench.simulator import DescriptionError, NotSupportedError, PreparedRobot
from pytest_simbench.simulator.links import check_loops, ends, reduced
from pytest_simbench.simulator.registry import adapter


def four_bar() -> Robot:
    robot = FourBarClosure().build().robot
    assert robot is not None
    return robot


def test_points_of_a_link_that_became_part_of_another_are_in_its_frame() -> None:
    robot = four_bar()
    x, y, z = PreparedRobot(robot).links["crank link"].centre  # any point of the crank
    held = Closure("crank link", "mount", (x, y, z))
    place, _ = ends(PreparedRobot(robot), reduced(PreparedRobot(robot))[0])
    prepared = PreparedRobot(replace(robot, closures=()))
    at = ends(prepared, replace(held, second="base"))[0]
    anchored = replace(held, second_point=tuple(np.subtract(at, robot.base.position)))
    (found,) = reduced(PreparedRobot(replace(robot, closures=(anchored,))))
    assert found.second == "base"
    assert found.second_point == pytest.approx(at)
    assert not np.allclose(at, place)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"second": "rod"}, "holds link 'rod', which is none of .*choose from mount, crank link"),
        ({"first_point": (0.501, 0.0, 0.0)}, "is open by 1 mm at the joints' initial positions"),
    ],
)
def test_a_wrong_closure_is_refused(change: dict[str, object], message: str) -> None:
    robot = four_bar()
    wrong = replace(robot.closures[0], **change)
    with pytest.raises(DescriptionError, match=message):
        reduced(PreparedRobot(replace(robot, closures=(wrong,))))


def test_a_link_is_not_held_at_itself() -> None:
    with pytest.raises(SceneError, match="a closure holds link 'a' at itself"):
        Closure("a", "a")


def test_who_closes_no_loops_says_so() -> None:
    info = replace(adapter("mujoco").info, name="mysim", capabilities=frozenset())
    with pytest.raises(NotSupportedError, match="mysim closes no loops of links, and the robot of"):
        check_loops(info, FourBarClosure().build())
    check_loops(info, Scene("empty"))


def test_closures_travel_and_robots_without_any_look_as_before() -> None:
    robot = four_bar()
    assert Robot.from_wire(robot.to_wire()) == robot
    assert "closures" not in replace(robot, closures=()).to_wire()
