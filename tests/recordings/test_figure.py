"""Every robot can be drawn from its trace, and stands as the adapters' kinematics have it."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_simbench.recordings.figure import Figure
from pytest_simbench.robot.registry import known, known_robot
from pytest_simbench.scene import Pose
from pytest_simbench.simulator.links import link_poses
from pytest_simbench.simulator.urdf import PreparedRobot


@pytest.mark.parametrize("name", known())
def test_links_stand_where_the_engines_have_them(name: str) -> None:
    robot = known_robot(name)
    figure, prepared = Figure.of(robot), PreparedRobot(robot)
    rng = np.random.default_rng(0)
    positions = rng.uniform(-0.5, 0.5, (3, len(robot.joint_names)))
    found = figure.poses(robot.joint_names, positions)
    for k, row in enumerate(positions):
        expected = link_poses(prepared, dict(zip(robot.joint_names, row, strict=True)))
        assert set(figure.links) == expected.keys()
        for link, pose in zip(figure.links, found[k], strict=True):
            there = Pose.from_array(pose).matrix()
            np.testing.assert_allclose(there, expected[link].matrix(), atol=1e-9)
    assert {part.link for part in figure.parts} <= set(figure.links)
    assert all(len(mesh.faces) for mesh in figure.meshes)
