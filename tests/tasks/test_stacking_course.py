"""What stacking is: its places, the course of its steps, other robots, and the study's rules."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_simbench.motion.files import read_robot
from pytest_simbench.motion.panda import READY
from pytest_simbench.motion.registry import find
from pytest_simbench.scene import Pose
from pytest_simbench.tasks import Jitter, Stacking, stacking
from pytest_simbench.tasks.arm import Speeds
from pytest_simbench.tasks.base import Randomness
from pytest_simbench.tasks.manipulator import Manipulator
from pytest_simbench.tasks.stacking import Place
from tests.motion.small_arm import TOML, URDF, small_arm
from tests.tasks.scripted import Asked, Mishap, ScriptedProcess, drop, perform
from tests.tasks.test_stacking import ONE, ONE_IN_FULL, SCORES, sized

FIRST_OF_2022 = ["cube_02", "cube_06", "cube_09"]


def in_phase(process: ScriptedProcess, phase: str) -> list[Asked]:
    return [asked for asked in process.asked if asked.phase == phase]


def test_the_places_in_their_order() -> None:
    assert Stacking(towers=2, levels=3).places() == [
        Place(tower, level, Pose.at(0.5, y, z))
        for tower, y in ((0, -0.2), (1, 0.0))
        for level, z in ((0, 0.325), (1, pytest.approx(0.375)), (2, pytest.approx(0.425)))
    ]
    assert len(Stacking().places()) == Stacking().cubes == 15


def test_another_robot_stacks_in_the_same_world() -> None:
    ur5 = find("ur5")
    task = Stacking().on(ur5)
    assert task == Stacking(robot=ur5)
    assert task.parameters() == Stacking().parameters()  # the robot is no parameter
    scene, pandas = task.scene(3, Jitter()), Stacking().scene(3, Jitter())
    assert scene.robot == ur5
    assert scene.bodies == pandas.bodies
    assert task.smoke() == Stacking(towers=1, levels=2, settle=2.0, robot=ur5)
    study = task.study().scene(3, Jitter()).robot
    assert study.gripper == replace(ur5.gripper, closed=0.02)


def test_what_a_robot_cannot_do_is_a_sentence(tmp_path: Path) -> None:
    ur5 = find("ur5")
    far = replace(ur5, base=Pose.at(-0.5, 0.0, 0.3))
    assert Stacking(robot=far).problem() == (
        "robot 'ur5' cannot handle a cube at (0.40, -0.30, 0.33): unreachable: tool at "
        "(0.400, -0.300, 0.425); place its base elsewhere"
    )
    low = replace(ur5, base=Pose.at(0.0, 0.0, 0.15))
    assert "in collision: upper_arm_link_0 and table" in str(Stacking(robot=low).problem())
    narrow = replace(ur5, gripper=replace(ur5.gripper, opened=0.028))
    assert Stacking(robot=narrow).problem() == (
        "robot 'ur5' opens its fingers to 0.028 m from the middle and needs 0.03 m for a cube of "
        "0.05 m"
    )
    small = sized(Stacking(robot=replace(ur5, gripper=replace(ur5.gripper, opened=0.014))), 0.5)
    assert str(small.problem()).endswith("and needs 0.015 m for a cube of 0.025 m")
    toml = TOML[: TOML.index("[hand]")] + '[hand]\ntool_frame = "grip"\n'
    bare = read_robot(small_arm(tmp_path, toml, URDF.replace('"prismatic"', '"fixed"')))
    assert Stacking(robot=bare).problem() == (
        "robot 'small' has no hand with two parallel fingers to grasp a cube, nor one with a jaw "
        "that turns"
    )
    so101 = find("so101")
    shut = replace(so101, gripper=replace(so101.gripper, opened=0.0))
    assert Stacking(robot=shut).problem() == (
        "robot 'so101' opens its jaw to 0 rad, too little for a cube of 0.02 m"
    )


def test_the_course_of_one_cube() -> None:
    _, process = perform(ONE_IN_FULL)
    assert list(dict.fromkeys(asked.phase for asked in process.asked)) == [
        *("settle start", "pick cube 1 of 1", "place cube 1 of 1", "check cube 1 of 1"),
        *("retreat cube 1 of 1", "go home", "settle"),
    ]
    (start,), (check,), (end, *more) = (
        in_phase(process, phase) for phase in ("settle start", "check cube 1 of 1", "settle")
    )
    assert (start.kind, start.duration) == ("wait", 0.2)
    assert sum(asked.duration for asked in (end, *more)) == pytest.approx(60.0)
    opening = in_phase(process, "place cube 1 of 1")[-1]
    assert check.began + check.duration == pytest.approx(opening.began + 0.5)
    home = in_phase(process, "go home")[-1]
    assert home.arguments["position"][-1, :7] == pytest.approx(READY)
    assert process.position[-2:] == pytest.approx([0.035, 0.035])
    assert process.marks == pytest.approx({"start": 0.2, "end": end.began})


def test_a_longer_delay_of_the_count_is_waited_for() -> None:
    _, process = perform(Stacking(towers=1, levels=1, check_delay=2.0))
    (check,) = in_phase(process, "check cube 1 of 1")
    opening = in_phase(process, "place cube 1 of 1")[-1]
    assert check.began + check.duration == pytest.approx(opening.began + 2.0)
    _, process = perform(Stacking(towers=1, levels=1, check_delay=0.1))
    assert [asked.duration for asked in in_phase(process, "check cube 1 of 1")] == [0.0]


@pytest.mark.parametrize("height", [0.005, 0.02])
def test_cubes_are_let_go_at_the_release_height_over_their_places(height: float) -> None:
    task = Stacking(towers=2, levels=2, release_height=height)
    _, process = perform(task)
    assert Stacking().release_height == 0.005
    for place, (_, pose) in zip(task.places(), process.released, strict=True):
        offset = np.subtract(pose.position, place.pose.position)
        assert offset == pytest.approx([0.0, 0.0, height], abs=1e-5)


def test_the_published_seeds_have_their_order() -> None:
    """By name, not by where the simulator lists them: records of other days stay comparable."""
    _, process = perform(Stacking(), seed=2022)
    names = sorted(body.name for body in Stacking().scene(2022, Jitter()).free_bodies)
    expected = Randomness.of(2022).order.permutation(names)
    assert [name for name, _ in process.released] == list(expected[:15])
    assert [name for name, _ in process.released][:3] == FIRST_OF_2022
    (other,) = perform(ONE, seed=3)[1].released
    assert other[0] == Randomness.of(3).order.permutation(names)[0] != FIRST_OF_2022[0]


def test_the_planner_has_a_generator_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[dict[str, Any]] = []

    class Spy(Manipulator):
        def __init__(
            self, world: Any, rng: np.random.Generator, speeds: Speeds, scale: float
        ) -> None:
            seen.append(rng.bit_generator.state)
            super().__init__(world, rng, speeds, scale)

    monkeypatch.setattr(stacking, "Manipulator", Spy)
    perform(ONE, seed=5)
    assert seen == [Randomness.of(5).planner.bit_generator.state]


def test_the_studys_rules() -> None:
    assert Stacking().study() == Stacking(
        spare_cubes=False,
        release_height=0.02,
        check_delay=0.5,
        count_after_retreat=True,
        finger_closed=0.020,
        speeds=Speeds(1.0, 1.0, 1.0),
        settle=60.0,
        full_wait=True,
    )
    own = Stacking(1, 2, True, 0.01, 2.0, False, 0.01, Speeds(0.5, 0.5, 0.5), settle=1.0)
    assert own.study() == replace(Stacking().study(), towers=1, levels=2)  # its size stays
    assert Stacking() == Stacking(
        3, 5, True, 0.005, 0.5, False, None, Speeds(1.0, 0.6, 0.3), 60.0
    )  # fmt: skip
    assert Stacking().parameters()["task.finger_closed"] == 0.0  # the Panda's own
    assert Stacking().study().parameters()["task.finger_closed"] == 0.02
    assert Stacking().smoke() == Stacking(towers=1, levels=2, settle=2.0)


def test_the_study_makes_one_attempt_for_each_place() -> None:
    """A failed pick leaves its place empty and goes on with the next place."""
    lost = Mishap("pick cube 2 of 4", 1.5, drop)
    ours, _ = perform(Stacking(towers=2, levels=2), Mishap("pick cube 2 of 4", 2.6, drop))
    assert ours.metrics["placed"] == 1.0
    outcome, process = perform(Stacking(towers=2, levels=2).study(), lost)
    assert outcome.metrics["failed_picks"] == 1.0
    assert [outcome.metrics[n] for n in SCORES[:4]] == [0.75, 0.75, 0.75, 0.75]
    assert outcome.metrics["towers"] == 0.5
    places = [(pick["tower"], pick["level"]) for pick in outcome.details["picks"]]
    assert places == [(0, 0), (1, 0), (1, 1)]
    assert process.counts == [(1, 4), (1, 4), (2, 4), (3, 4)]


def test_the_course_of_one_cube_by_the_studys_rules() -> None:
    outcome, process = perform(ONE.study())
    assert outcome.metrics["placed"] == 1.0
    assert list(dict.fromkeys(asked.phase for asked in process.asked))[2:5] == [
        *("place cube 1 of 1", "retreat cube 1 of 1", "check cube 1 of 1"),
    ]
    (check,) = in_phase(process, "check cube 1 of 1")
    assert (check.kind, check.duration) == ("wait", 0.5)
    grasp = in_phase(process, "pick cube 1 of 1")[2]
    assert grasp.arguments["position"][-1, -2:] == pytest.approx([0.020, 0.020])
    (_, pose) = process.released[0]
    assert pose.position[2] == pytest.approx(0.325 + 0.02, abs=1e-5)
