"""A joint that has a motor alone, beside one with a drive: in engines that hold drives as velocity
motors, and in MuJoCo."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_simbench.laws.mechanisms import STRONG, Part, Y, mechanism
from pytest_simbench.scene import STANDARD_GRAVITY, Scene
from pytest_simbench.simulator.registry import adapter

PUSHED = Part("pushed", (0.0, 0.0, 1.0), slides=True, effort=15.0)
HELD = Part(
    "held", Y, centre=(0.3, 0.0, 0.0), stiffness=1e4, damping=100.0, effort=STRONG, on="mount"
)
ROBOT = mechanism("both", PUSHED, HELD)


def test_a_motor_is_a_drive_without_stiffness_and_damping() -> None:
    assert [joint.motor for joint in ROBOT.joints] == [True, False]
    assert not Part("free", Y).drive.motor  # whose effort limit is next to nothing
    assert not Part("braked", Y, damping=1.0, effort=STRONG).drive.motor
    assert "motor" in Scene("both", robot=ROBOT).words


@pytest.mark.parametrize("name", ["mujoco", "pybullet", "dart", "sapien"])
def test_a_motor_pushes_beside_a_drive(name: str) -> None:
    """Up to its limit, until the next command, also after a state was restored; the drive holds,
    and the joint's wrench is what the motor pushes."""
    cls = adapter(name)
    pytest.importorskip(cls.info.modules[0])
    simulator = cls(cls.profiles["tuned"])
    simulator.load(Scene("both", robot=ROBOT))
    rest = np.zeros(2)
    simulator.command(rest, rest, np.array([100.0, 0.0]))
    for _ in range(10):
        simulator.step()
    gained = (15.0 + STANDARD_GRAVITY[2]) * simulator.time
    assert simulator.joint_state()[1, 0] == pytest.approx(gained, rel=1e-4)
    assert abs(simulator.joint_state()[0, 1]) < 1e-3
    assert simulator.joint_wrenches()[0, :3] == pytest.approx([0.0, 0.0, 15.0], abs=1e-3)
    state = simulator.save()
    simulator.command(rest, rest, rest)
    simulator.step()
    assert simulator.joint_state()[1, 0] < gained
    simulator.restore(state)
    simulator.step()
    gained = (15.0 + STANDARD_GRAVITY[2]) * simulator.time
    assert simulator.joint_state()[1, 0] == pytest.approx(gained, rel=1e-4)
    simulator.close()
