"""Where hands grasp bodies of any shape, and what they refuse."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_simbench.motion.files import read_robot
from pytest_simbench.motion.grasping import grasping
from pytest_simbench.motion.grips import SLACK, Ungraspable, grips, hand_of, turns
from pytest_simbench.motion.kinematics import top_down_grasps
from pytest_simbench.motion.panda import panda
from pytest_simbench.motion.registry import find
from pytest_simbench.scene import Body, Box, Capsule, Cylinder, Pose, Sphere, principal
from pytest_simbench.scene.bodies import ConvexMesh
from tests.motion.small_arm import small_arm, still

PANDA = panda()
UPRIGHT = Pose.at(0.5, 0.1, 0.06, yaw=0.4)
LYING = Pose((0.5, 0.1, 0.02), (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0))  # its z along minus y


def prism(*corners: tuple[float, float], height: float = 0.04, taper: float = 1.0) -> ConvexMesh:
    """Corners of its floor, and of its roof, which is smaller by `taper` [m]."""
    points = [(x * s, y * s, z) for z, s in ((0.0, 1.0), (height, taper)) for x, y in corners]
    vertices, frame = principal(points)
    return ConvexMesh("prism", vertices, frame, mass=0.1)


WALLS = [(x, y, z) for x in (0.0, 0.05) for y in (0.0, 0.05) for z in (0.0, 0.02)]
TENT = ConvexMesh("tent", *principal([*WALLS, (0.025, 0.025, 0.15)]), mass=0.1)
"""Upright to 2 cm, and so high that the palm keeps the fingers above."""


@given(yaw=st.floats(-3.0, 3.0), edge=st.floats(0.024, 0.06))
@settings(max_examples=20)
def test_a_cube_is_grasped_in_its_middle_at_its_four_turns(yaw: float, edge: float) -> None:
    cube = Box("cube", (edge,) * 3, Pose.at(0.5, 0.0, edge / 2, yaw=yaw), 0.1)
    found = grips(PANDA, cube)
    assert [grip.tool for grip in found] == top_down_grasps(cube.pose)  # to the last bit
    assert [grip.width for grip in found] == pytest.approx([edge] * 4)


@pytest.mark.parametrize(
    ("body", "width", "ways"),
    [
        (Box("plank", (0.2, 0.03, 0.04), Pose.at(0.5, 0.0, 0.02), 0.1), 0.03, 2),
        (Sphere("ball", 0.03, UPRIGHT, 0.1), 0.06, 4),
        (Cylinder("peg", 0.02, 0.12, UPRIGHT, 0.1), 0.04, 4),
        (Cylinder("peg", 0.02, 0.12, LYING, 0.1), 0.04, 2),
        (Capsule("pill", 0.02, 0.08, LYING, 0.1), 0.04, 2),
    ],
)
def test_every_shape_is_grasped_where_it_is_narrow(body: Body, width: float, ways: int) -> None:
    found = grips(PANDA, body)
    assert len(found) == ways
    for grip in found:
        assert grip.width == pytest.approx(width, abs=1e-9)
        assert grip.tool.position[:2] == pytest.approx(body.pose.position[:2])
        line = grip.tool.rotation()[:, 1] @ body.pose.rotation()
        both = body.reach(np.stack([line, -line]))
        assert both.sum() == pytest.approx(width)  # the fingers close along that width


def test_a_tall_peg_is_grasped_under_its_top_and_a_flat_tile_above_the_ground() -> None:
    hand = hand_of(PANDA, 1.0)
    peg = Cylinder("peg", 0.02, 0.12, Pose.at(0.5, 0.0, 0.06), 0.1)
    tile = Box("tile", (0.05, 0.05, 0.012), Pose.at(0.5, 0.0, 0.006), 0.1)
    for body, height in ((peg, 0.12 - hand.palm + SLACK), (tile, 0.012 - SLACK)):
        assert grips(PANDA, body)[0].tool.position[2] == pytest.approx(height)
    brick = Box("brick", (0.05, 0.05, 0.02), Pose.at(0.5, 0.0, 0.01), 0.1)
    assert grips(PANDA, brick)[0].tool.position[2] == pytest.approx(hand.tips + SLACK)


def test_a_prism_is_grasped_at_its_faces_where_something_stands_opposite() -> None:
    triangle = [(0.0, 0.0), (0.05, 0.0), (0.02, 0.04)]
    found = grips(PANDA, prism(*triangle))
    assert len(found) == 6  # an edge and the corner opposite, from both sides
    for k in range(3):
        corner, one, other = np.roll(triangle, k, axis=0)
        edge = (other - one) / np.linalg.norm(other - one)
        foot = one + edge * ((corner - one) @ edge)
        across = [g for g in found if abs(g.tool.rotation()[:2, 1] @ edge) < 1e-9]
        assert [g.width for g in across] == pytest.approx([np.linalg.norm(corner - foot)] * 2)
        for grip in across:
            assert grip.tool.position == pytest.approx([*(corner + foot) / 2, 0.02])
    hexagon = [(0.03 * math.cos(k), 0.03 * math.sin(k)) for k in np.arange(6) * math.pi / 3]
    assert {round(grip.width, 9) for grip in grips(PANDA, prism(*hexagon))} == {
        round(0.03 * math.sqrt(3), 9)
    }
    slanted = [(0.0, 0.0), (0.05, 0.0), (0.09, 0.03), (0.04, 0.03)]  # its short sides miss
    for grip in grips(PANDA, prism(*slanted)):
        assert [grip.width, *grip.tool.position] == pytest.approx([0.03, 0.045, 0.015, 0.02])


def test_a_wall_and_a_level_edge_opposite_are_grasped_at_the_edge() -> None:
    """Where both sides have one height in common."""
    points = [(x, y, z) for x in (0.0, 0.06) for y, z in ((0.0, 0.0), (0.0, 0.04), (0.05, 0.02))]
    found = grips(PANDA, ConvexMesh("roof", *principal(points), mass=0.1))
    across = [grip for grip in found if abs(grip.tool.rotation()[1, 1]) > 0.999]
    assert [grip.width for grip in across] == pytest.approx([0.05] * 2)
    for grip in across:
        assert grip.tool.position == pytest.approx((0.03, 0.025, 0.02))


def test_what_no_hand_holds_is_refused_in_a_sentence() -> None:
    refused = {
        "'ball', a sphere, of 9 cm does not fit the fingers of robot 'panda', which hold 0 to 7 cm":
            Sphere("ball", 0.045, UPRIGHT, 0.1),
        "'prism', a convex mesh, has no two sides opposite each other that fingers from above":
            prism((0, 0), (0.05, 0), (0.05, 0.05), (0, 0.05), taper=0.3),
        "'tent', a convex mesh, has no two sides opposite each other that fingers from above": TENT,
    }  # fmt: skip
    for sentence, body in refused.items():
        with pytest.raises(Ungraspable, match=re.escape(sentence)):
            grips(PANDA, body)


def test_a_hand_that_only_touches_holds_nothing(tmp_path: Path) -> None:
    robot = read_robot(small_arm(tmp_path, still(0.0, 0.0)))
    with pytest.raises(Ungraspable, match="robot 'small' has no hand with two fingers, nor with o"):
        grips(robot, Sphere("ball", 0.02, UPRIGHT, 0.1))


def test_a_jaw_holds_what_it_was_set_for() -> None:
    arm = find("so101")
    ball = Sphere("ball", 0.01, Pose.at(0.2, 0.0, 0.01), 0.01)
    with pytest.raises(Ungraspable, match="the jaw of robot 'so101' is set for nothing"):
        grips(arm, ball, 0.4)
    ready = grasping(arm, 0.02, 0.4)
    assert len(grips(ready, ball, 0.4)) == 4
    with pytest.raises(Ungraspable, match=r"of 1.4 cm does not fill the fingers"):
        grips(ready, Sphere("ball", 0.007, Pose.at(0.2, 0.0, 0.01), 0.01), 0.4)


def test_turns_leave_the_shape_as_it_is() -> None:
    quarters = [-math.pi, -math.pi / 2, 0.0, math.pi / 2]
    assert turns(Box("cube", (0.05,) * 3, UPRIGHT, 0.1)) == quarters
    assert turns(Box("plank", (0.2, 0.03, 0.05), UPRIGHT, 0.1)) == [-math.pi, 0.0]
    assert len(turns(Cylinder("peg", 0.02, 0.12, UPRIGHT, 0.1))) == 8
    assert len(turns(prism((0, 0), (0.05, 0), (0.025, 0.04)))) == 1
