"""A real arm's commands on an engine: the hand goes about where the real one went."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pytest_simbench.data.pushes import COMMANDS, FREE, PUSH, ArmRun, ArmRuns, Command
from pytest_simbench.experiment.case import Case
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.records.record import Record
from pytest_simbench.scene import Pose
from pytest_simbench.tasks import ArmFollowing, CorrectedArmFollowing, Jitter
from pytest_simbench.tasks.arm_following import CONTROL_PERIOD, REACHED, reference, started
from pytest_simbench.tasks.arm_pushing import CUBE, CUBE_SIZE, marker
from tests.conftest import measured, performed
from tests.tasks.reached import reached
from tests.tasks.scripted import Mishap, move, perform


@pytest.fixture(scope="module")
def runs() -> ArmRuns:
    return measured("arm_pushes")


def test_joints_move_at_30_degrees_a_second_and_then_halve_what_is_missing() -> None:
    path = np.degrees(reference((0.0, 5.0), (Command(0.1, (10.0, 5.0)),), 14))
    assert path[:, 1] == pytest.approx(5.0)
    assert path[:3, 0] == pytest.approx(0.0)
    step = 30.0 * CONTROL_PERIOD
    assert path[2:8, 0] == pytest.approx(step * np.arange(6))
    missing = 10.0 - path[8:, 0]
    assert missing[1:] == pytest.approx(missing[:-1] / 2)


def test_an_arm_that_does_as_told_is_off_by_what_the_real_one_is(
    runs: ArmRuns, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The real hand follows its commands from 1.3 s on, 10 mm too high, and 20 mm in the end."""
    task, time = ArmFollowing(runs), np.arange(0.0, 7.5, 0.01)
    robot = task.arm(np.zeros(6))
    path = reference((0.0,) * 6, COMMANDS[PUSH], 130)
    knots = 1.3 + CONTROL_PERIOD * np.arange(len(path))
    joints = np.stack([np.interp(time, knots, column) for column in path.T], axis=1)
    model, seen = RobotModel(robot), Pose.at(task.marker_aside, 0, 0) * marker(runs, robot)
    tools = (model.tool_pose(row).translated(z=0.01) for row in joints)
    hand = np.array([(tool * seen).as_array() for tool in tools])
    hand[-50:, 2] += 0.01
    hand[50, :3] += 0.3  # the cameras lost it
    cube = np.tile(Pose.at(0.5, 0.1, 0.04, yaw=0.2).as_array(), (len(time), 1))
    cube[-50:, 0] += 0.07
    run = ArmRun(f"{PUSH}0001", time, hand, cube)
    assert started(run, robot) == pytest.approx(1.3, abs=0.02)
    monkeypatch.setattr(ArmFollowing, "chosen", (run,))
    scene = task.scene(3, Jitter())
    assert scene.name == "arm following"
    lying = scene.body(CUBE).pose.as_array()
    assert lying == pytest.approx([0.5, 0.1, CUBE_SIZE / 2, *cube[0, 3:]])
    outcome, process = perform(task, Mishap("follow", 5.0, move(CUBE, x=0.05)))
    assert outcome.metrics["hand_error"] == pytest.approx(0.01, abs=2e-3)
    assert outcome.metrics["rest_error"] == pytest.approx(0.02, abs=1e-4)
    assert outcome.details == {
        "run": run.name, "joint_error": pytest.approx(0.0, abs=1e-9),
        "displacement": pytest.approx(0.05), "real_displacement": pytest.approx(0.07),
    }  # fmt: skip
    assert process.marks == {"start": 0.0, "end": pytest.approx(6.2, abs=0.05)}


def test_what_the_real_arm_made_of_its_commands_is_found_again(runs: ArmRuns) -> None:
    for experiment, found in reached(runs).items():
        times, angles = found.mean(axis=0)[:, 0], found.mean(axis=0)[:, 1:]
        assert times == pytest.approx([row.time for row in REACHED[experiment]], abs=0.01)
        assert angles == pytest.approx(np.array([r.angles for r in REACHED[experiment]]), abs=0.06)
        assert found.std(axis=0)[:, 2:4].max() < 0.2  # of the joints that carry the arm


def test_the_hand_goes_where_the_real_one_went(case: Case, runs: ArmRuns) -> None:
    def followed(task: ArmFollowing, number: int) -> Record:
        record = performed(case, task, number)
        assert record.details["joint_error"] < 0.002  # rad: the drives do what they are told
        assert record.settings["task.half"] == "held_out"
        assert record.seconds["plan"] > 0.0
        return record

    given = followed(ArmFollowing(runs, most=2), 1)  # seeds 10001 and 10002
    push, free = (followed(CorrectedArmFollowing(runs, most=2), number) for number in (1, 2))
    names = [record.details["run"][:-4] for record in (given, free, push)]
    assert names == [PUSH, FREE, PUSH]
    assert 0.02 < given.metrics["hand_error"] < 0.035  # the real one stops 8 degrees off
    assert max(r.metrics["hand_error"] for r in (free, push)) < 0.012
    assert push.details["displacement"] == pytest.approx(0.095, abs=0.02)


def test_a_smoke_run_has_both_experiments(runs: ArmRuns) -> None:
    task = ArmFollowing(runs)
    assert task.repetitions == 12
    assert [run.experiment for run in task.smoke().chosen] == [FREE, PUSH]
    assert replace(task, half="chosen_on").chosen[0].number == 1
