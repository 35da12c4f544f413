"""Every engine builds other arms and other hands as they are described, and holds them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.motion.files import read_robot
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.registry import find
from pytest_simbench.scene import FloatArray, Robot, Scene, Trajectory
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks import Jitter, Pushing, Stacking
from tests.conftest import ADAPTERS, case_of
from tests.motion.small_arm import TOML, URDF, joint, link, small_arm

QUICK = [name for name in ADAPTERS if not adapter(name).info.costly_start]
"""The others compile each robot anew, for a minute and more."""

TICK = 0.004


@pytest.fixture(params=QUICK)
def handle(request: pytest.FixtureRequest, case: Case) -> Iterator[SimulatorHandle]:
    """Loads scenes into one worker of an engine; each is checked for parity."""
    with closing(SimulatorHandle(case_of(case, request.param))) as handle:
        yield handle


def command(world: World, robot: Robot, goal: FloatArray) -> None:
    """Go to joint positions with gravity compensated, and wait until it has settled."""
    model = RobotModel(robot)
    zero = np.zeros((1, len(goal)))
    effort = model.inverse_dynamics(np.array(world.scene.gravity), goal[None], zero, zero)[0]
    effort[model.arm :] = 0.0
    world.follow(Trajectory.holding(TICK, goal, effort))
    world.wait(1.5)


@pytest.mark.parametrize("name", ["ur5", "ur10", "xarm7", "so101"])
def test_built_in_arms(handle: SimulatorHandle, name: str) -> None:
    """They stand in the world of a task, and go where they are told within 5 mrad and 1 mm (1 mrad
    for a jaw that turns)."""
    robot = find(name)
    task = Pushing() if name == "so101" else Stacking()
    world = handle.world(task.on(robot).scene(1, Jitter()))
    goal = robot.column("initial_position")
    arm = len(robot.arm_joints)
    goal[:arm] += 0.05
    goal[arm:] -= 0.01
    command(world, robot, goal)
    error = np.abs(world.joints[0] - goal)
    assert error[:arm].max() < 5e-3
    assert error[arm:].max() < 1e-3


THIRD = link("third", "0.01 0.02 0.08", "0.005 0 0.06", 0.05, 0.1) + joint(
    "third_finger", "lower", "third", "0 0 0.3", "1 0 0", "prismatic"
)
HANDS = {
    0: (
        URDF.replace('type="prismatic"', 'type="fixed"'),
        TOML[: TOML.index("[hand]")] + '[hand]\ntool_frame = "grip"\n',
    ),
    1: (
        URDF.replace('"right_finger" type="prismatic"', '"right_finger" type="fixed"'),
        TOML.replace(', "right_finger"', ""),
    ),
    2: (URDF, TOML),
    3: (
        URDF.replace("</robot>", f"{THIRD}</robot>"),
        TOML.replace('"right_finger"', '"right_finger", "third_finger"'),
    ),
}
"""A hand that only touches, one jaw, two fingers, three."""


def test_hands_of_any_number_of_fingers(handle: SimulatorHandle, tmp_path: Path) -> None:
    """All fingers stand at one position (1 mm) though the first is told another one."""
    for count, (urdf, toml) in HANDS.items():
        robot = read_robot(small_arm(tmp_path, toml, urdf))
        world = handle.world(Scene("hands", (), robot))
        assert world.joints.shape == (2, 3 + count)
        goal = robot.column("initial_position")
        goal[3:] = 0.02
        goal[3:4] = 0.01
        command(world, robot, goal)
        assert np.abs(world.joints[0, :3] - goal[:3]).max() < 5e-3
        fingers = world.joints[0, 3:]
        if count:
            assert np.ptp(fingers) < 1e-3, (count, fingers)
            assert 0.0 < fingers[0] < 0.03
