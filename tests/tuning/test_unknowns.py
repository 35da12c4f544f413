"""What may be unknown of a scene, and the scene with other values of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Box, Pose, Scene, Start, Trajectory, Wrench
from pytest_simbench.tasks import Log
from pytest_simbench.tuning.target import TuningError
from pytest_simbench.tuning.unknowns import Unknown, begun, changed, known, starts, unknowns
from tests.tasks.scripted_scene import SCENE

BLOCK = Box("block", (0.1, 0.1, 0.1), Pose.at(1, 0, 0.05), 2.0, 0.5, moments=(0.1, 0.2, 0.3))
WHOLE = replace(SCENE, bodies=(BLOCK, Box("wall", (0.1, 0.1, 0.1), Pose.at(3, 0, 0.05))))
ROWS = np.zeros((2, 2))
NOTHING = Start((), ())
LOG = Log(Trajectory(1.0, ROWS, ROWS, ROWS), ["hinge"], NOTHING, NOTHING, "", told=["hinge"])


@pytest.mark.parametrize("name", known(WHOLE))
def test_each_unknown_changes_its_own_number_alone(name: str) -> None:
    before = known(WHOLE)
    after = known(changed(WHOLE, {name: 0.25}))
    assert after == {**before, name: pytest.approx(0.25)}


def test_the_inertia_changes_with_the_mass() -> None:
    after = changed(WHOLE, {"mass:block": 4.0, "mass:door": 3.0, "linear_damping:block": 0.5})
    assert after.body("block").moments == pytest.approx((0.2, 0.4, 0.6))
    (door,) = [link for link in PreparedRobot(after.robot).links.values() if link.name == "door"]
    assert door.mass == pytest.approx(3.0)
    assert door.inertia == pytest.approx(3 * np.eye(3))


def test_a_link_of_meshes_can_be_heavier() -> None:
    after = changed(Scene("arm", (), panda()), {"mass:panda_link7": 1.5})
    assert known(after)["mass:panda_link7"] == 1.5


def test_what_a_file_says_of_gravity_and_damping_goes_with_the_mass() -> None:
    """It compensates a share of the weight, and damps by a force and a torque."""
    borne = BLOCK.changed(wrenches=(Wrench(force=(0, 0, 6)),), angular_damping=3.0)
    sought = {"linear_damping:block": 4.0, "mass:block": 4.0}
    block = changed(replace(WHOLE, bodies=(borne,)), sought).body("block")
    assert block.wrenches[0].force == (0, 0, 12)
    assert (block.mass, block.linear_damping, block.angular_damping) == (4.0, 4.0, 1.5)


def test_ranges_are_a_tenth_to_ten_times_where_nobody_says() -> None:
    found = unknowns(["friction:block", "passive_damping:hinge = 0.1..2"], WHOLE, LOG)
    assert found == [
        Unknown("friction:block", 0.5, 0.05, 5.0),
        Unknown("passive_damping:hinge", 0.0, 0.1, 2.0),
    ]


@pytest.mark.parametrize(
    ("texts", "why"),
    [
        ([], "name what is unknown.* choose from friction:ground, mass:block, friction:block"),
        (["friction:blok"], "has no 'friction:blok'; choose from friction:ground"),
        (["mass:wall"], "has no 'mass:wall'"),
        (["mass:block", "mass:block"], "given twice"),
        (["spring:hinge"], r"is 0 in the scene: give a range, spring:hinge=LOW\.\.HIGH"),
        (["mass:block=1"], "give a range as"),
        (["mass:block=1..1"], "give a range as"),
        (["mass:block=0..1"], "give a range as"),
        (["stiffness:slider"], "lacks the column slider/command"),
        (["passive_damping:slider=1..2"], "lacks the column slider/command"),
    ],
)
def test_what_cannot_be_sought_is_one_sentence(texts: list[str], why: str) -> None:
    with pytest.raises(TuningError, match=why) as raised:
        unknowns(texts, WHOLE, LOG)
    assert "\n" not in str(raised.value)


def test_a_scene_begins_where_the_log_does_but_bodies_that_stand_there_stay() -> None:
    near, far = Pose.at(1.003, 0, 0.05), Pose.at(1.5, 0, 0.06)
    for pose, wanted in ((near, BLOCK.pose), (far, far)):
        log = replace(LOG, start=Start(("block",), (pose,), (0.25, 0.5)))
        scene = begun(replace(WHOLE, starts=(NOTHING,)), log)
        assert (scene.body("block").pose, scene.starts) == (wanted, ())
        assert starts(scene, log) == {"start:hinge": 0.25}
        moved = changed(scene, {"start:hinge": 7.0}).robot
        assert moved.column("initial_position").tolist() == [1.0, 0.5]  # its limit
