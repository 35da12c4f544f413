"""What only PyBullet's adapter has to show: its motors keep the effort limits, which Bullet does
not report, and parity faults of links that the common tests do not plant."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from pytest_simbench.sims.pybullet import PyBullet

from pytest_simbench.simulator import ParityError
from pytest_simbench.simulator.parity import check, expected_quantities
from pytest_simbench.tasks import Jitter, Throwing

SCENE = Throwing().scene(1, Jitter())


@pytest.fixture
def loaded() -> Iterator[PyBullet]:
    simulator = PyBullet(PyBullet.profiles["tuned"])
    simulator.load(SCENE)
    yield simulator
    simulator.close()


def test_motors_keep_the_effort_limits(loaded: PyBullet) -> None:
    """Parity excuses the effort limits, so they are measured: no drive exceeds its own, and every
    arm drive that is torn to and fro reaches it."""
    import pybullet

    robot = SCENE.robot
    assert robot is not None
    limits = robot.column("effort_limit")
    largest, rest = np.zeros_like(limits), np.zeros_like(limits)
    for k in range(120):
        target = robot.column("initial_position")
        target[:7] += 1.0 if k // 30 % 2 else -1.0
        loaded.command(target, rest, rest)
        loaded.step()
        states = pybullet.getJointStates(
            loaded._robot, loaded._joints, physicsClientId=loaded.client
        )
        largest = np.maximum(largest, [abs(state[3]) for state in states])
    assert (largest <= limits * (1 + 1e-9)).all()
    np.testing.assert_allclose(largest[:7], limits[:7], rtol=1e-6)


def link_inertia(s: Any) -> None:
    import pybullet

    was = pybullet.getDynamicsInfo(s._robot, 3, physicsClientId=s.client)[2]
    scaled = [1.2 * moment for moment in was]
    pybullet.changeDynamics(s._robot, 3, localInertiaDiagonal=scaled, physicsClientId=s.client)


def ground_friction(s: Any) -> None:
    import pybullet

    pybullet.changeDynamics(s._ground, -1, lateralFriction=0.5, physicsClientId=s.client)


def initial_position(s: Any) -> None:
    import pybullet

    pybullet.resetJointState(s._robot, s._joints[3], -2.0, physicsClientId=s.client)


FAULTS: dict[str, Callable[[Any], None]] = {
    "link/panda_link4/inertia": link_inertia,
    "ground/friction": ground_friction,
    "joint/panda_joint4/initial_position": initial_position,
}


@pytest.mark.parametrize("quantity", FAULTS)
def test_fault_is_caught(loaded: PyBullet, quantity: str) -> None:
    expected = expected_quantities(SCENE, loaded.settings)
    info = loaded.info
    check(expected, loaded.read_back(), info.deviations, info.name)
    FAULTS[quantity](loaded)
    with pytest.raises(ParityError, match=f"{quantity}: scene .*, pybullet "):
        check(expected, loaded.read_back(), info.deviations, info.name)
