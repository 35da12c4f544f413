"""What only Omniverse PhysX's adapter has to show, in its own environment.

Its engine cannot be imported here, so the tests run it in workers; without the environment they
are skipped with the command that makes it.
"""

from __future__ import annotations

import time

import numpy as np
import psutil
import pytest
from pytest_simbench.sims.ovphysx.adapter import OvPhysX

from pytest_simbench.client.environments import missing
from pytest_simbench.scene import Box, Pose, Scene, Trajectory
from pytest_simbench.scene.friction import RULES
from pytest_simbench.scene.pair_friction import OF_PAIRS
from pytest_simbench.tasks import Jitter, Nesting
from pytest_simbench.testing import Subject, scenes

ABSENT = missing(OvPhysX.info)
pytestmark = pytest.mark.skipif(ABSENT is not None, reason=str(ABSENT))


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


def test_bowls_that_lie_in_each_other_are_no_larger_than_they_are() -> None:
    """Parity looks when the world is loaded."""
    with Subject(OvPhysX).world(Nesting(2).scene(1, Jitter())) as world:
        assert len(world.bodies) == 2


def test_an_engine_that_nobody_asks_takes_no_cpu_time() -> None:
    """Its cooking service took 0.25 s of each second."""
    with Subject(OvPhysX).world(scenes.falling()) as world:
        engine = psutil.Process(world.process.pid)
        before = engine.cpu_times()
        time.sleep(1.0)
        assert sum(engine.cpu_times()[:2]) - sum(before[:2]) < 0.1


@pytest.mark.parametrize("rule", ["maximum", "mean", "minimum"])
def test_pairs_have_the_scene_s_friction_whatever_else_there_is(rule: str) -> None:
    frictions, pull = [0.3, 0.7, 0.9], (9.81, 0.0, -9.81)
    pucks = tuple(
        Box(f"puck {k}", (0.2, 0.2, 0.02), Pose.at(0.0, float(k), 0.01), 1.0, mu)
        for k, mu in enumerate(frictions)
    )
    scene = Scene("pucks", pucks, None, pull, ground_friction=0.5, friction_rule=rule)
    with Subject(OvPhysX).world(scene) as world:
        assert not any(told.startswith(OF_PAIRS) for told in world.excused)
        world.wait(0.2)
        speeds = world.bodies[:, 7]
    held = [RULES[rule](0.5, mu) for mu in frictions]
    np.testing.assert_allclose(speeds, 9.81 * 0.2 * (1 - np.array(held)), rtol=0.02)


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
