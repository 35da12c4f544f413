"""What acts on bodies from outside is told step by step, also after a jump in time."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_simbench.scene import Box, FloatArray, Pose, Scene, SceneError, Wrench
from pytest_simbench.simulator import NotSupportedError
from pytest_simbench.worker.acting import Acting, prescribed
from pytest_simbench.worker.stepping import Stepper

from .toys import Toy

PULL = Wrench(force=(1.0, 0.0, 0.0), start=0.003, end=0.007)
PULLED = Scene("pulled", (Box("a", (0.1,) * 3, Pose.at(0.0, 0.0, 1.0), 1.0, wrenches=(PULL,)),))
BELT = Box(
    "belt",
    (1.0, 0.2, 0.1),
    Pose.at(0.0, 0.0, 0.5),
    linear_velocity=(0.5, 0.0, 0.0),
    angular_velocity=(0.0, 0.0, 2.0),
    prescribed=True,
)


class Told(Toy):
    """Notes what it is told."""

    def __init__(self) -> None:
        super().__init__()
        self.pushed: list[float] = []
        self.led: list[tuple[FloatArray, FloatArray]] = []

    def push(self, wrenches: FloatArray) -> None:
        self.pushed.append(float(wrenches[0, 0]))

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        self.led.append((before, after))


def told(scene: Scene, steps: int) -> Told:
    simulator = Told()
    acting = Acting.of(simulator, scene)
    assert acting is not None
    simulator.pushed.clear()
    simulator.led.clear()
    act = acting.steps()
    for _ in range(steps):
        act()
        simulator.step()
    return simulator


def test_a_force_is_told_while_it_acts_and_once_that_it_ended() -> None:
    # steps of 2 ms; the first is told whatever acts, since nobody knows what was before
    assert told(PULLED, 8).pushed == pytest.approx([0.0, 0.5, 1.0, 0.5, 0.0])


def test_it_is_told_in_each_step_of_a_wait() -> None:
    simulator = Told()
    acting = Acting.of(simulator, PULLED)
    simulator.pushed.clear()
    Stepper(simulator, PULLED, lambda at: None, acting).wait(0.016, None)
    assert simulator.pushed == pytest.approx([0.0, 0.5, 1.0, 0.5, 0.0])


def test_a_motion_goes_on_from_the_simulators_time() -> None:
    simulator = Told()
    acting = Acting.of(simulator, Scene("s", (BELT,)))
    assert acting is not None
    simulator.steps = 100  # restored
    acting.steps()()
    before, after = simulator.led[-1]
    assert before[0] == pytest.approx(prescribed(BELT, 0.2))
    assert after[0, :3] == pytest.approx([0.101, 0.0, 0.5])
    assert Pose.from_array(after[0]).yaw == pytest.approx(0.404)
    assert after[0, 7:] == pytest.approx([0.5, 0.0, 0.0, 0.0, 0.0, 2.0])


def test_where_nothing_acts_nobody_is_told() -> None:
    assert (
        Acting.of(Toy(), Scene("s", (Box("a", (0.1,) * 3, Pose.at(0.0, 0.0, 1.0), 1.0),))) is None
    )


@pytest.mark.parametrize(
    ("scene", "what"),
    [(PULLED, "forces on bodies"), (Scene("s", (BELT,)), "bodies that move as prescribed")],
)
def test_who_takes_none_says_so_before_the_first_step(scene: Scene, what: str) -> None:
    with pytest.raises(NotSupportedError, match=f"toy has no {what}"):
        Acting.of(Toy(), scene)


def test_a_prescribed_body_is_neither_free_of_its_motion_nor_fixed() -> None:
    scene = Scene("s", (BELT,))
    assert scene.free_bodies == scene.prescribed_bodies == (BELT,)
    assert not scene.fixed_bodies
    assert Scene.from_wire(scene.to_wire()) == scene
    assert "prescribed" not in BELT.changed(prescribed=False, mass=1.0).to_wire()
    with pytest.raises(SceneError, match="moves as prescribed, so it has no mass"):
        BELT.changed(mass=1.0)


def test_a_turn_about_any_axis_keeps_the_quaternion_a_unit() -> None:
    row = prescribed(BELT.changed(angular_velocity=(0.3, -1.0, 2.0)), 7.3)
    assert np.linalg.norm(row[3:7]) == pytest.approx(1.0)


def test_what_only_slides_keeps_its_orientation() -> None:
    turned = Pose.at(0.0, 0.0, 0.5, yaw=0.3)
    row = prescribed(BELT.changed(angular_velocity=(0.0, 0.0, 0.0), pose=turned), 2.0)
    assert row == pytest.approx([1.0, 0.0, 0.5, *turned.quaternion, 0.5, 0, 0, 0, 0, 0])
