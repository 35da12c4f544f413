"""DART's own detector: few contacts of meshes on fingers, and a ground that carries."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pytest_simbench.sims.dart import adapter
from pytest_simbench.sims.dart.adapter import DART
from pytest_simbench.sims.dart.bodies import add_ground

from pytest_simbench.robot.grasping import grasp_of, grasping
from pytest_simbench.robot.model import RobotModel
from pytest_simbench.robot.registry import known_robot
from pytest_simbench.scene import Box, Pose, Robot, Scene
from pytest_simbench.simulator.settings import changed
from pytest_simbench.testing import scenes

pytest.importorskip("dartpy")

EDGE, MASS = 0.02, 0.0064
"""Of the cube that the SO-101 stacks [m, kg]."""

OWN = {"detector": "dart", "solver": "dantzig"}
"""Settings with which it does."""


def world(scene: Scene, profile: str = "tuned", **changes: Any) -> DART:
    simulator = DART(changed(DART.profiles[profile], changes, "dart"))
    simulator.load(scene)
    return simulator


def small_cube(pose: Pose) -> Box:
    return Box("cube", (EDGE,) * 3, pose, MASS)


def held() -> tuple[Scene, Robot]:
    """A weightless cube between the SO-101's jaws, which stand 1 mm apart from it."""
    robot = grasping(known_robot("so101"), EDGE, EDGE / 0.05)
    start = robot.column("initial_position")
    start[-1] = grasp_of(robot, EDGE, EDGE / 0.05).touching + 0.01
    robot = scenes.with_joint(robot, robot.joints[-1].name, initial_position=float(start[-1]))
    pose = RobotModel(robot).tool_pose(start)
    return Scene("held", (small_cube(pose),), robot, gravity=(0.0, 0.0, 0.0)), robot


def most_contacts(simulator: DART, robot: Robot, seconds: float) -> int:
    """While the jaw closes."""
    goal, most = robot.column("initial_position"), 0
    goal[-1] = robot.gripper.closed
    simulator.command(goal, 0 * goal, 0 * goal)
    for _ in range(round(seconds / simulator.settings.timestep)):
        simulator.step()
        most = max(most, simulator.contact_count())
    return most


def test_a_jaw_of_meshes_has_few_contacts_and_holds() -> None:
    """With the detector `ode` it has hundreds: a second of the grip takes minutes."""
    scene, robot = held()
    simulator = world(scene, **OWN)
    before = simulator.body_state()[0]
    assert 0 < most_contacts(simulator, robot, 1.0) <= 50
    after = simulator.body_state()[0]
    assert np.linalg.norm(after[:3] - before[:3]) < 0.002
    assert np.linalg.norm(after[7:10]) < 1e-3
    assert most_contacts(world(scene), robot, 0.03) > 100


@pytest.mark.parametrize("detector", ["fcl", "dart"])
@pytest.mark.parametrize(("slab", "contacts", "stands"), [(True, 4, True), (False, 1, False)])
def test_a_cube_under_another_stands_on_a_slab(
    monkeypatch: pytest.MonkeyPatch, detector: str, slab: bool, contacts: int, stands: bool
) -> None:
    """Of a box on a plane these detectors tell one contact; loaded aside, a cube sinks."""
    if not slab:
        monkeypatch.setattr(adapter, "add_ground", lambda *arguments: add_ground(*arguments[:3]))
    upper = replace(small_cube(Pose.at(EDGE / 3, 0.0, 1.5 * EDGE)), name="upper")
    simulator = world(
        Scene("two", (small_cube(Pose.at(0.0, 0.0, EDGE / 2)), upper)), detector=detector
    )
    most = 0
    for _ in range(1000):
        simulator.step()
        found = [pair for *pair, _ in simulator.contact_forces() if "ground" in pair]
        most = max(most, len(found))
    assert most == contacts
    assert (abs(simulator.body_state()[0, 2] - EDGE / 2) < 2e-5) == stands


def test_the_ground_is_a_slab_where_cubes_would_sink() -> None:
    """A cube beside the SO-101 stays where it was put."""
    cube = small_cube(Pose.at(0.5, 0.0, EDGE / 2))
    simulator = world(Scene("beside", (cube,), known_robot("so101")), **OWN)
    for _ in range(1000):
        simulator.step()
    assert simulator.body_state()[0, 2] == pytest.approx(EDGE / 2, abs=1e-4)
