"""What only Omniverse PhysX's adapter has to show, in its own environment.

Its engine cannot be imported here, so the tests run it in workers; without the environment they
are skipped with the command that makes it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pytest_simbench.sims.ovphysx.adapter import OvPhysX

from pytest_simbench.client.environments import missing
from pytest_simbench.client.errors import WorkerError
from pytest_simbench.scene import Box, Pose, Scene, Trajectory
from pytest_simbench.tasks import Jitter, Stacking, Throwing
from pytest_simbench.testing import ConformanceFailure, Subject, scenes

from .coverage import uncovered
from .ovphysx_faults import FAULTS, FaultyOvPhysX

ABSENT = missing(OvPhysX.info)
pytestmark = pytest.mark.skipif(ABSENT is not None, reason=str(ABSENT))

SCENE = Scene(
    "parity",
    (
        Box("table", (0.9, 0.9, 0.3), Pose.at(0.8, 0.0, 0.15), friction=0.7),
        Box("brick", (0.1, 0.06, 0.03), Pose.at(0.5, 0.1, 0.315, yaw=0.4), 0.23, 0.7),
    ),
    robot=scenes.arm(),
    ground_friction=0.7,
    friction_rule="mean",  # the engine's own, so that its stage has these numbers
)


@pytest.mark.parametrize("profile", ["default", "tuned"])
@pytest.mark.parametrize("task", [Stacking(), Throwing()], ids=lambda task: task.name)
def test_an_honest_world_passes(task: Any, profile: str) -> None:
    with Subject(OvPhysX, profile).world(task.scene(7, Jitter())) as world:
        assert world.time == 0


AT_THE_START = ("body/brick/pose", "joint/panda_joint4/initial_position")
"""Seen in the state that the engine starts with, before anything is read back."""


@pytest.mark.parametrize("quantity", FAULTS)
def test_fault_is_caught(quantity: str) -> None:
    error: type[Exception] = WorkerError
    wrong = rf"{quantity}: scene .*, ovphysx "
    if quantity in AT_THE_START:
        error, wrong = ConformanceFailure, r"starts at \(.*\), where the scene has"
    with (
        pytest.raises(error, match=wrong),
        Subject(FaultyOvPhysX).world(SCENE, fresh=True, changes={"fault": quantity}),
    ):
        pass


def test_nothing_is_left_out() -> None:
    with Subject(OvPhysX).world(SCENE) as world:
        assert uncovered(world.process.request("read_back"), FAULTS) == set()


def test_the_limit_bounds_drive_and_feed_forward_together() -> None:
    """An effort of 3000 N m asked for as feed-forward moves joint 1 just as a far position does:
    both are cut to 87 N m (in so short a time that the damping does not leave the limit)."""
    subject, robot = Subject(OvPhysX), scenes.arm()
    start, effort = robot.column("initial_position"), np.zeros(9)
    far = start.copy()
    far[0] += 2.0
    effort[0] = 3000.0
    speeds = []
    for command in (Trajectory.holding(0.004, far), Trajectory.holding(0.004, start, effort)):
        with subject.world(scenes.arm_alone(robot, (0.0, 0.0, 0.0), "weightless")) as world:
            world.follow(command)
            world.wait(0.02)
            speeds.append(world.joints[1, 0])
    assert speeds[0] > 0.5
    assert speeds[1] == pytest.approx(speeds[0], rel=0.01)


def test_the_first_command_is_obeyed_like_any_other() -> None:
    """Before the first step commands go another way (sessions, not bindings): a command that is
    given at once and the same one given after 0.1 s lead to the same place."""
    subject, robot = Subject(OvPhysX), scenes.arm()
    goal = robot.column("initial_position")
    goal[:7] += 0.1
    ends = []
    for wait in (0.0, 0.1):
        with subject.world(scenes.arm_alone(robot, (0.0, 0.0, 0.0), "weightless")) as world:
            if wait:
                world.wait(wait)
            world.follow(Trajectory.holding(0.004, goal))
            world.wait(1.0)
            ends.append(world.joints[0])
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-5)
    np.testing.assert_allclose(ends[0], goal, atol=5e-3)


def test_threads_change_nothing() -> None:
    """The adapter computes in the calling thread, where PhysX would take eight workers."""
    ends = []
    for threads in (0, 2):
        with Subject(OvPhysX).world(scenes.tower(), changes={"threads": threads}) as world:
            world.wait(0.5)
            ends.append(world.bodies.tobytes())
    assert ends[0] == ends[1]


def test_a_state_from_before_the_first_step_comes_back() -> None:
    """Saved before any step there is no contact to forget: the run from it is the same one."""
    scene = scenes.grip()
    with Subject(OvPhysX).world(scene) as world:
        world.save()
        ends = []
        for _ in range(2):
            world.wait(0.1)
            ends.append((world.time, world.bodies.tobytes(), world.joints.tobytes()))
            world.restore()
            assert world.time == 0
    assert ends[0] == ends[1]
