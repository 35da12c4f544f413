"""What all repetitions of a test have in common, protocols, and the record of a repetition."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock, call

import pytest

from pytest_simbench.description.robot_files import robot_cache
from pytest_simbench.experiment.case import PROTOCOLS, Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import describe_robot, expected, scene_digest
from pytest_simbench.experiment.repeater import Repeater
from pytest_simbench.experiment.repetition import Hooks, Repetition, group
from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.laws.free import FreeFall
from pytest_simbench.motion.model import scale_of
from pytest_simbench.motion.panda import panda
from pytest_simbench.motion.registry import find
from pytest_simbench.records.record import Failure, Record
from pytest_simbench.scene import Box, Pose, Scene, SceneError
from pytest_simbench.scene.policy import LoopError
from pytest_simbench.tasks import Reaching, Settling
from pytest_simbench.tasks.base import Task
from pytest_simbench.tasks.recorded import code_of
from tests.description.test_urdf_check import stl
from tests.made_up import MadeUp
from tests.motion.small_arm import small_arm
from tests.tiny import Falling


@dataclass(frozen=True)
class Halved(Falling):
    """A task of which the smallest version of the smallest version is a smaller one."""

    def smoke(self) -> Halved:
        return replace(self, duration=self.duration / 2)


def test_a_robot_whose_file_was_changed_is_another_one(tmp_path: Path) -> None:
    file = small_arm(tmp_path)
    before, urdf = find(str(file)), file.with_suffix(".urdf")
    task = Reaching(None, robot=before)
    first, scene, scale = describe_robot(before), scene_digest(task), scale_of(before)
    urdf.write_text(urdf.read_text().replace('<mass value="1"', '<mass value="1.5"', 1))
    os.utime(urdf, ns=(0, 1))
    assert describe_robot(find(str(file))) == describe_robot(before) != first
    assert scene_digest(task) != scene
    urdf.write_text(urdf.read_text().replace('xyz="0 0 0.3"', 'xyz="0 0 0.1"', 1))
    assert scale_of(before) < scale
    box, mesh = '<box size="0.02 0.01 0.08"/>', tmp_path / "hand.stl"
    urdf.write_text(urdf.read_text().replace(box, '<mesh filename="hand.stl"/>', 1))
    mesh.write_bytes(stl(0.1))
    second = describe_robot(before)
    mesh.write_bytes(stl(0.2))
    os.utime(mesh, ns=(0, 1))
    assert describe_robot(before) != second
    assert (second["name"], describe_robot(None)) == ("small", {})


def test_the_version_is_chosen_once_whatever_becomes_of_the_case(case: Case) -> None:
    experiment = Experiment(replace(case, protocol=PROTOCOLS["smoke"]), Halved(duration=0.4))
    again = experiment.in_case(attempt=2).in_case(contended=True)
    assert again.task == experiment.task == Halved(duration=0.2)
    assert expected(again).settings["task.duration"] == 0.2


def test_seeds_count_on_from_the_case_s(case: Case) -> None:
    experiment = Experiment(replace(case, seed=40), Falling())
    assert [experiment.seed(number) for number in (1, 3)] == [40, 42]
    assert experiment.seed() == 40


@pytest.mark.parametrize(
    ("deterministic", "task", "asked", "done"),
    [(True, FreeFall(), 20, 1), (True, FreeFall(), None, 1), (False, FreeFall(), 3, 3),
     (True, Falling(), 3, 3), (True, Falling(), None, 20)],
)  # fmt: skip
def test_what_draws_nothing_is_done_once_where_it_would_be_the_same(
    case: Case, deterministic: bool, task: Task, asked: int | None, done: int
) -> None:
    experiment = Experiment(replace(case, deterministic=deterministic), task)
    assert experiment.repetitions(asked) == done


def test_measured_motions_are_not_repeated_where_that_would_copy_them(case: Case) -> None:
    class Three(Falling):
        repetitions = different = 3

    for deterministic, most in ((True, 3), (False, 20)):
        experiment = Experiment(replace(case, deterministic=deterministic), Three())
        assert [experiment.repetitions(asked) for asked in (2, None, 20)] == [2, 3, most]


def test_a_robot_with_another_swing_is_computed_anew() -> None:
    swings = robot_cache(lambda robot: robot.swing)
    other = replace(panda(), swing=((0.0,) * 7, (0.1,) * 7))
    assert swings(panda()) != swings(other) == other.swing


def test_the_task_has_its_own_time_out_unless_the_case_gives_one(case: Case) -> None:
    assert Experiment(case, Falling()).timeout == Falling.study_timeout
    experiment = Experiment(replace(case, timeout=5.0, memory_limit=900.0), Falling())
    assert experiment.limits == {"timeout": 5.0, "stall_timeout": 20.0, "memory_limit": 900.0}
    assert case.launch("limits").stall_timeout == 20.0


def test_a_case_of_a_registered_simulator(case: Case) -> None:
    told = {"test": case.test, "mode": "headless", "profile": "tuned", "folder": case.folder}
    found = Case.of("mujoco", stall_timeout=case.stall_timeout, **told)
    assert found.deterministic
    assert replace(found, compile_timeout=0.0, deterministic=False) == case
    assert Case.of("mujoco", python="/a/python", **told).python == "/a/python"
    with pytest.raises(SimulatorError, match="mujoco"):
        Case.of("mojuco", **told)


@dataclass(frozen=True)
class Versions(Falling):
    """A task that says which version of it this is."""

    version: str = "as asked for"

    def smoke(self) -> Versions:
        return replace(self, version="the smallest")

    def study(self) -> Versions:
        return replace(self, version="the study's")


@pytest.mark.engine
def test_paper_runs_in_real_time_and_records_before(case: Case) -> None:
    paper = replace(PROTOCOLS["paper"], before=1.0)
    record, error = Repetition(
        Experiment(replace(case, protocol=paper), Falling(duration=1.5)), 1
    ).run()
    assert error is None
    began, ended = record.timeline["start"], record.timeline["end"]
    assert began > 1.0
    assert 1.45 < ended - began < 3.0
    assert record.resources["phases"]["before"]["samples"] >= 7
    assert record.stepping["wall"] < 0.5  # waiting for the clock is not the simulator's time


@pytest.mark.engine
def test_phases_follow_each_other(case: Case) -> None:
    phases: list[str] = []
    Repetition(Experiment(case, Falling()), 1, hooks=Hooks(phase=phases.append)).run()
    assert [name for k, name in enumerate(phases) if phases[k - 1 : k] != [name]] == [
        *("launch", "load", "launch", "task", "fall", "task"),
    ]


@pytest.mark.engine
def test_fast_does_not_wait(case: Case) -> None:
    record, _ = Repetition(Experiment(case, Falling(duration=100.0)), 1).run()
    assert record.timeline["end"] - record.timeline["start"] < 50.0


def test_the_live_line_is_told_of_each_repetition(case: Case) -> None:
    line, kept = Mock(), list[Record]()
    ok = {"status": "ok", "metrics": {"landed": 1.0}}
    worker = MadeUp(1, lambda experiment, number: (ok, None))
    repeater = Repeater(Experiment(case, Falling()), worker, line, kept.append, line.begin)
    found = {2: expected(repeater.experiment, 2)}
    assert repeater.up_to(3, found) == [kept[0], found[2], kept[1]]
    assert line.mock_calls == [
        call.begin(), call.start_test("test_x[mujoco-headless]", 2, 3),
        call.repetition(1, 10001, ""), call.end_repetition("ok", 1.0),
        call.repetition(3, 10003, ""), call.end_repetition("ok", 1.0), call.end_test(),
    ]  # fmt: skip


ACTED: list[int] = []


def counting() -> Falling:
    class Counting(Falling):
        def perform(self, *_: Any) -> Any:
            ACTED.append(len(ACTED))

    return Counting()


def test_the_code_of_a_task_is_told_as_it_was_before_it_acted(case: Case) -> None:
    def end(experiment: Experiment, number: int) -> tuple[dict[str, Any], None]:
        experiment.task.perform(Mock(), 0, Mock())
        return {"status": "ok", "metrics": {"landed": 1.0}}, None

    repeater = Repeater(Experiment(case, counting()), MadeUp(1, end), Mock(), lambda record: None)
    (record,) = repeater.up_to(1, {})
    ACTED.clear()
    assert record.task_code == code_of(counting()) != ""


@pytest.mark.parametrize("kind", [LoopError, SceneError])
def test_what_cannot_be_is_no_crash_of_the_simulator(case: Case, kind: type[Exception]) -> None:
    """But where a search or a sweep over steps asks for it, it is a finding."""

    def end(experiment: Experiment, number: int) -> tuple[dict[str, Any], Exception | None]:
        failed = {"status": "failed", "error": Failure(kind.__name__, "no such world", "act")}
        ok = {"status": "ok", "metrics": {"landed": 1.0}}
        return (failed, kind("no such world")) if number == 2 else (ok, None)

    for noted in (False, True):
        kept: list[Record] = []
        repeater = Repeater(Experiment(case, Falling()), MadeUp(1, end), Mock(), kept.append)
        repeater.records_refusals = noted
        with pytest.raises(kind, match="^no such world$"):
            repeater.run([1, 2, 3])
        assert [record.status for record in kept] == ["ok"] + ["failed"] * noted


def test_each_protocol_has_its_version_of_a_task(case: Case) -> None:
    def version(name: str, task: Task) -> Task:
        return Experiment(replace(case, protocol=PROTOCOLS[name]), task).task

    assert {name: version(name, Versions()) for name in PROTOCOLS} == {
        "fast": Versions(version="as asked for"),
        "paper": Versions(version="the study's"),
        "smoke": Versions(version="the smallest"),
    }
    tiny = Falling(duration=0.1)  # a task with one version only
    assert all(version(name, tiny) == tiny for name in PROTOCOLS)


@pytest.mark.engine
def test_a_record_says_what_it_was(case: Case) -> None:
    case = replace(case, changes={"timestep": "0.002"})
    record, _ = Repetition(Experiment(case, Falling()), 3).run()
    assert record.settings["timestep"] == 0.002
    assert {"mujoco", "python", "pytest-simbench"} <= set(record.versions)
    assert record.stepping["simulated"] == pytest.approx(0.6)
    assert record.resources["rss_mb"]["peak"] > 20
    assert record.notes.log.startswith("logs/")


@pytest.mark.parametrize(
    ("phase", "told"),
    [("pick cube 3 of 15", "pick"), ("recover from cube 12 of 15", "recover from"),
     ("3 of 5", "3 of 5"), ("step 3", "step"),
     *((name, name) for name in ("settle start", "settle", "go home", "wind up"))],
)  # fmt: skip
def test_phases_that_count_on_are_told_together_and_no_others(phase: str, told: str) -> None:
    assert group(phase) == told


@pytest.mark.parametrize(("off", "same"), [(1e-15, True), (3e-14, True), (1e-9, False)])
def test_a_scene_is_the_same_on_processors_that_differ_in_last_digits(
    off: float, same: bool
) -> None:
    """In both digests that a record has of a scene."""
    made = [Box("a", (0.1,) * 3, Pose((0.3 + far, far, 1.0 - far)), 1.0) for far in (0.0, off)]
    first, second = (Settling(Scene("s", (box,))) for box in made)
    assert (first.parameters() == second.parameters()) is same
    assert (scene_digest(first) == scene_digest(second)) is same


def test_a_robot_of_the_task_s_own_counts_with_its_swing(case: Case) -> None:
    """A built-in one as it is does not: records of before go on."""
    before = scene_digest(Reaching(None))
    other = replace(panda(), swing=None)
    assert scene_digest(Reaching(None, robot=panda())) == before
    assert expected(Experiment(case, Reaching(None, robot=other))).scene not in ("", before)
    chosen = Experiment(replace(case, robot=other), Reaching(None))
    assert expected(chosen).scene == before
