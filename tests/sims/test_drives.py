"""Drives: their effort limits and the squeeze. What a robot may have beside them: a motor alone, in
engines that hold drives as velocity motors, and in MuJoCo; and links that feel a share of gravity:
it lasts, the engine tells it, no joint carries the rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pytest_simbench.description.links import borne
from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.laws.mechanisms import STRONG, Part, Y, mechanism
from pytest_simbench.scene import STANDARD_GRAVITY, Joint, Scene
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.testing import scenes

from .worlds import loaded, stepped

PUSHED = Part("pushed", (0.0, 0.0, 1.0), slides=True, effort=15.0)
HELD = Part(
    "held", Y, centre=(0.3, 0.0, 0.0), stiffness=1e4, damping=100.0, effort=STRONG, on="mount"
)
ROBOT = mechanism("both", PUSHED, HELD)


def of_bullet(s: Any) -> list[float]:
    import pybullet

    states = pybullet.getJointStates(s._robot, s._joints, physicsClientId=s.client)
    return [abs(state[3]) for state in states]


def of_dart(s: Any) -> Any:
    return np.abs(s._robot.getConstraintForces()[s._index])


@pytest.mark.parametrize(
    ("name", "efforts", "turn"), [("pybullet", of_bullet, 30), ("dart", of_dart, 20)]
)
def test_motors_keep_the_effort_limits(name: str, efforts: Callable[[Any], Any], turn: int) -> None:
    """Torn to and fro each `turn` steps, too shortly to reach a joint limit, no drive exceeds its
    own limit, which neither engine reports, and every arm drive reaches it."""
    robot = scenes.arm()
    simulator = loaded(adapter(name), scenes.arm_alone(robot))
    limits = robot.column("effort_limit")
    if name == "dart":
        limits[robot.finger_indices[1]] *= 2  # the follower's: it carries both drives' force
    largest, rest = np.zeros_like(limits), np.zeros_like(limits)
    for k in range(120):
        target = robot.column("initial_position")
        target[:7] += 1.0 if k // turn % 2 else -1.0
        simulator.command(target, rest, rest)
        simulator.step()
        largest = np.maximum(largest, efforts(simulator))
    simulator.close()
    assert (largest <= limits * (1 + 1e-9)).all()
    np.testing.assert_allclose(largest[:7], limits[:7], rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "fine", "bound"),
    [("dart", {}, 0.02), ("sapien", {"timestep": 0.001, "velocity_iterations": 1}, 0.01)],
)
def test_both_fingers_press_with_the_squeeze(name: str, fine: dict[str, Any], bound: float) -> None:
    """25 N on a held cube: what couples the fingers takes nothing of it. SAPIEN in short sub-steps,
    so that its tendon is seen and not the solver's residual (24.6 N at tuned)."""
    scene = replace(scenes.grip(), gravity=(0.0, 0.0, 0.0))
    robot = scene.robot
    goal = robot.column("initial_position")
    goal[robot.finger_indices] = robot.gripper.closed
    simulator = loaded(adapter(name), scene, **fine)
    simulator.command(goal, 0 * goal, 0 * goal)
    stepped(simulator, 0.6)
    forces = {"link/panda_leftfinger": np.zeros(3), "link/panda_rightfinger": np.zeros(3)}
    for *pair, wrench in simulator.contact_forces():
        for finger in forces.keys() & pair if "body/held" in pair else ():
            forces[finger] += wrench[:3] if finger == pair[0] else -wrench[:3]
    simulator.close()
    pressed = [np.linalg.norm(force) for force in forces.values()]
    assert pressed == pytest.approx([robot.gripper.squeeze] * 2, rel=bound)


def test_a_motor_is_a_drive_without_stiffness_and_damping() -> None:
    assert [joint.motor for joint in ROBOT.joints] == [True, False]
    assert ROBOT.joints[0] == replace(ROBOT.joints[0], stiffness=0.0)  # engines divide by it
    assert not Part("free", Y).drive.motor  # whose effort limit is next to nothing
    assert not Part("braked", Y, damping=1.0, effort=STRONG).drive.motor
    assert "motor" in Scene("both", robot=ROBOT).words


@pytest.mark.parametrize("name", ["mujoco", "pybullet", "dart", "sapien"])
def test_a_motor_pushes_beside_a_drive(name: str) -> None:
    """Up to its limit, whatever it is told, until the next command, also after a state was
    restored; the drive holds, and the joint's wrench is what the motor pushes."""
    simulator = loaded(adapter(name), Scene("both", robot=ROBOT))
    rest = np.zeros(2)
    simulator.command(rest, rest, np.array([2e4, 0.0]))
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


@pytest.mark.parametrize("name", ["pybullet", "dart"])
def test_an_effort_beside_a_velocity_motor_does_nothing_which_is_told(name: str) -> None:
    ends = []
    for effort in (0.0, 20.0):
        simulator = loaded(adapter(name), Scene("both", robot=ROBOT))
        simulator.command(np.zeros(2), np.zeros(2), np.array([0.0, effort]))
        ends.append(stepped(simulator, 0.1).joint_state()[0, 1])
        simulator.close()
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)
    assert any("an effort beside one does nothing" in d.reason for d in simulator.info.deviations)


SHARES = {"half": 0.5, "risen": -0.5, "held": 0.0, "whole": 1.0}
HALF = Part("half", (0.0, 0.0, 1.0), slides=True, gravity=0.5)
RISEN = Part("risen", (0.0, 0.0, 1.0), slides=True, on="mount", gravity=-0.5)
LIFTED, WHOLE = (
    Part(
        name, Y, centre=(0.3, 0.0, 0.0), stiffness=1e4, damping=100.0, effort=STRONG, on="mount",
        gravity=SHARES[name],
    )
    for name in ("held", "whole")
)  # fmt: skip


@pytest.mark.parametrize("name", ["dart", "drake", "mujoco", "pybullet", "sapien"])
def test_a_share_of_gravity_lasts(name: str) -> None:
    scene = Scene("shares", robot=mechanism("shares", HALF, RISEN, LIFTED, WHOLE))
    assert "link_gravity" in scene.words
    simulator = loaded(adapter(name), scene)
    half = STANDARD_GRAVITY[2] / 2
    for restored in (False, True):
        for _ in range(10):
            simulator.step()
        assert simulator.joint_state()[1, :2] / simulator.time == pytest.approx(
            [half, -half], rel=1e-4
        )
        told = {part: simulator.read_back().get(f"link/{part} link/gravity") for part in SHARES}
        if name == "sapien":  # which tells whether gravity acts
            assert told == {part: float(share == 1) for part, share in SHARES.items()}
        elif name != "pybullet":
            assert told == pytest.approx(SHARES)
        up = simulator.joint_wrenches()[:, 2]
        assert up[:3] == pytest.approx(0.0, abs=1e-3)
        assert up[3] > -half  # it swings
        if not restored:
            simulator.restore(simulator.save())
    simulator.close()


def test_a_share_crosses_the_wire() -> None:
    assert HALF.drive.to_wire()["gravity"] == 0.5
    assert "gravity" not in WHOLE.drive.to_wire()
    assert Joint.from_wire(HALF.drive.to_wire()) == HALF.drive


def test_forces_are_those_of_each_link() -> None:
    robot = PreparedRobot(mechanism("shares", HALF, RISEN, LIFTED, WHOLE))
    forces = borne(robot, (0.0, 1.0, -10.0))
    assert {name: force.tolist() for name, force in forces.items()} == {
        "half link": [0.0, -0.5, 5.0],
        "risen link": [0.0, -1.5, 15.0],
        "held link": [0.0, -1.0, 10.0],
    }
    assert not np.any(borne(robot, (0.0, 1.0, -10.0), felt=0.0)["held link"])
