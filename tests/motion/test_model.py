"""The robot's model: what it says of arm and hand, and what a held body asks of the motors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_simbench.motion import panda as module
from pytest_simbench.motion.adapting import mounted
from pytest_simbench.motion.kinematics import Servo
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.motion.registry import find
from pytest_simbench.scene import Body, Box, Cylinder, Pose, Scene, Sphere
from pytest_simbench.scene.policy import LoopError
from pytest_simbench.simulator import DescriptionError

ROBOT = panda(base=Pose.at(0.1, 0.2, 0.3, yaw=0.5))
MODEL = RobotModel(ROBOT)
GRAVITY = np.array([1.0, 2.0, -9.0])
THINGS = (
    Box("box", (0.05, 0.02, 0.1), Pose(), 0.3),
    Box("box", (0.05, 0.02, 0.1), Pose(), 0.6),
    Box("box", (0.02, 0.05, 0.1), Pose(), 0.3),
    Sphere("ball", 0.04, Pose(), 0.3),
    Cylinder("can", 0.02, 0.1, Pose(), 0.3),
)


@pytest.mark.parametrize("held", THINGS, ids=lambda body: body.kind)
@given(seed=st.integers(0, 99))
@settings(max_examples=5)
def test_a_held_body_asks_for_its_weight_and_its_inertia(held: Body, seed: int) -> None:
    """By Newton and Euler at the tool centre point, of an arm that begins to move."""
    arm, start = np.random.default_rng(seed).uniform(-1, 1, (2, 7))
    q, still, a = MODEL.full(arm)[None], np.zeros((1, 9)), np.array([[*start, 0.0, 0.0]])
    rotation, jacobian = MODEL.tool_transform(arm).rotation, MODEL.tool_jacobian(arm)
    moved = jacobian @ start
    force = held.mass * (moved[:3] - rotation.T @ GRAVITY)
    wrench = np.concatenate([force, held.inertia() * moved[3:]])
    loaded, empty = (
        MODEL.inverse_dynamics(GRAVITY, q, still, a, body)[0, :7] for body in (held, None)
    )
    assert loaded - empty == pytest.approx(jacobian.T @ wrench, abs=1e-9)


def test_what_a_hand_is_and_how_far_its_tips_move() -> None:
    """Two that slide go half of a width each; one that turns goes its arc."""
    servos = [Servo(Scene("one", (), robot)) for robot in (ROBOT, find("so101"))]
    models = [servo.model for servo in servos]
    assert [model.finger_unit for model in models] == ["m", "rad"]
    assert [model.has_parallel_fingers for model in models] == [True, False]
    assert [model.has_one_jaw for model in models] == [False, True]
    assert models[0].finger_lever == 1.0
    at = [models[1].pin.jointPlacements[6], models[1].pin.frames[models[1].tool].placement]
    lever = np.linalg.norm(at[1].translation - at[0].translation)
    assert models[1].finger_lever == pytest.approx(lever)
    assert [servo.finger(0.02) for servo in servos] == pytest.approx([0.01, 0.02 / lever])


def test_what_is_missing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DescriptionError, match="robot 'panda' has no limits of motion"):
        _ = RobotModel(replace(panda(), limits=None)).limits
    with pytest.raises(LoopError, match="scene 'bare' has no robot that a policy could move"):
        Servo(Scene("bare"))
    with pytest.raises(DescriptionError, match="the hand begins with 'claw', which is no link"):
        mounted(panda(), panda(), "claw", "panda_link8", Pose())
    swapped = replace(ROBOT, joints=(ROBOT.joints[1], ROBOT.joints[0], *ROBOT.joints[2:]))
    with pytest.raises(DescriptionError, match=r"urdf has joints \['panda_joint1', .* not \('pan"):
        RobotModel(swapped)
    for name in ("no-such-distribution", "pytest"):
        monkeypatch.setattr(module, "DISTRIBUTION", name)
        module.description_folder.cache_clear()
        with pytest.raises(DescriptionError, match=f"is missing: pip install {name} "):
            module.description_folder()
    monkeypatch.undo()
    assert module.description_folder() == module.description_folder()
