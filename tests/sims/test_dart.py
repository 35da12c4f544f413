"""What only DART's adapter has to show: what its motors are asked for, coupled joints, bodies
asleep, and that what stands on the ground does not sink."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pytest_simbench.sims.dart import adapter
from pytest_simbench.sims.dart.adapter import DART
from pytest_simbench.sims.dart.bodies import add_ground

from pytest_simbench.laws.mechanisms import Part, Y, mechanism
from pytest_simbench.motion.grasping import grasp_of, grasping
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.registry import known_robot
from pytest_simbench.scene import Box, Coupling, FloatArray, Pose, Robot, Scene
from pytest_simbench.simulator import NotSupportedError
from pytest_simbench.testing import scenes

from .worlds import loaded, stepped


def world(scene: Scene, **changes: Any) -> DART:
    return loaded(DART, scene, **changes)


def test_the_drives_are_asked_for_speed_and_place() -> None:
    """Of a servo: the velocity at which the drive law asks for no effort, k / d = 10/s."""
    simulator = world(scenes.arm_alone())
    position = simulator.joint_state()[0]
    simulator.command(position + 0.01, 0 * position + 0.2, 0 * position)
    simulator.step()
    asked = simulator._robot.getCommands()[simulator._index[:7]]
    assert asked == pytest.approx((10 * 0.01 + 0.2) / (1 + 10 * simulator.settings.timestep))


def test_restore_of_bodies_asleep_continues_as_if_uninterrupted() -> None:
    """DART tells nobody who sleeps, so that is not part of the saved state. A cube falls on a tower
    asleep, which wakes: restored or not, the same happens."""
    tower = scenes.tower()
    late = scenes.cube("late", Pose.at(0.405, 0.003, 5.0))
    simulator = world(replace(tower, bodies=(*tower.bodies, late)))
    advance(simulator, 0.8)
    before = simulator.body_state()
    advance(simulator, 0.1)
    saved, state = simulator.body_state(), simulator.save()
    assert np.array_equal(saved[:3], before[:3])  # asleep
    straight = advance(simulator, 0.5)
    simulator.restore(state)
    assert np.array_equal(advance(simulator, 0.5), straight)
    assert not np.array_equal(straight[-1, :3], saved[:3])  # woken


def advance(simulator: DART, duration: float) -> FloatArray:
    """Body states at every 20th step of `duration` [s]."""
    states = []
    for k in range(round(duration / simulator.settings.timestep)):
        simulator.step()
        if k % 20 == 19:
            states.append(simulator.body_state())
    return np.array(states)


EDGE, MASS = 0.02, 0.0064
"""Of the cube that the SO-101 stacks [m, kg]."""

OWN = {"detector": "dart", "solver": "dantzig"}
"""Settings with which it does."""


def small_cube(pose: Pose) -> Box:
    return Box("cube", (EDGE,) * 3, pose, MASS)


def held() -> tuple[Scene, Robot]:
    """A weightless cube between the SO-101's jaws, which stand 1 mm apart from it."""
    robot = grasping(known_robot("so101"), EDGE, EDGE / 0.05)
    start = robot.column("initial_position")
    start[-1] = grasp_of(robot, EDGE, EDGE / 0.05).touching + 0.01
    robot = robot.with_joints(robot.joints[-1].name, initial_position=float(start[-1]))
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
    simulator = stepped(world(Scene("beside", (cube,), known_robot("so101")), **OWN), 1.0)
    assert simulator.body_state()[0, 2] == pytest.approx(EDGE / 2, abs=1e-4)


@pytest.mark.parametrize("heavy", [0.5, 2.0])
@pytest.mark.parametrize("driven", [False, True])
def test_a_coupled_joint_carries_the_other(heavy: float, driven: bool) -> None:
    """Two levers alike but in mass, coupled 1 to 1: free they fall as one lever would, and the
    drive of one holds both. DART's own coupler throws the follower that is heavier."""
    drive = {"stiffness": 5000.0, "damping": 100.0, "effort": 100.0} if driven else {}
    parts = [
        Part(name, Y, (0.0, y, 0.0), (0.3, 0.0, 0.0), mass, (0.01 * mass,) * 3, on="mount", **more)
        for name, y, mass, more in (("a", 0.0, 1.0, drive), ("b", 0.5, heavy, {}))
    ]
    robot = mechanism("pair", *parts, couplings=(Coupling("b", "a"),))
    simulator = stepped(world(Scene("pair", robot=robot)), 0.3)
    alone = stepped(world(Scene("one", robot=mechanism("one", parts[0]))), 0.3)
    (first, second), right = simulator.joint_state()[0], alone.joint_state()[0, 0]
    assert second == pytest.approx(first, abs=1e-4)
    assert first == pytest.approx(right, abs=1e-4)
    assert (right > 1.0) != driven
    with pytest.raises(NotSupportedError, match="no wrenches"):
        simulator.joint_wrenches()
