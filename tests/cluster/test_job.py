"""What goes to a node is the same experiment there; what comes back is the same error here."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from pytest_simbench.client.errors import Diverged, Where, WorkerError
from pytest_simbench.cluster.job import Job, TaskFailed, heard, told
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import expected, robot_told
from pytest_simbench.robot.registry import find
from pytest_simbench.tasks import Stacking
from tests.tiny import Falling


def test_the_experiment_is_the_same_on_the_node(case: Case, tmp_path: Path) -> None:
    experiment = Experiment(replace(case, changes={"timestep": 0.001}), Falling(0.3))
    there = Job.unpack(Job.of(experiment, 3).pack()).experiment(tmp_path)
    assert there.case.folder == tmp_path
    assert replace(expected(there, 3), scene="") == replace(expected(experiment, 3), scene="")


def test_a_task_of_the_tests_travels_as_code(case: Case) -> None:
    """The node has neither the test nor what its class is derived from."""
    packed = Job.of(Experiment(case, Falling(0.25)), 1).pack()
    code = (
        "import sys; from pytest_simbench.cluster.job import Job\n"
        "job = Job.unpack(sys.stdin.buffer.read())\n"
        "print(job.task, [metric.name for metric in job.task.metrics])"
    )
    command = [sys.executable, "-P", "-c", code]
    out = subprocess.run(command, input=packed, capture_output=True, check=True, cwd="/").stdout
    assert out.decode().strip() == "Falling(duration=0.25) ['landed']"


def test_a_class_that_travelled_can_be_derived_from(case: Case) -> None:
    """Its parameters have the defaults that they had, also in who unpacks its own job."""
    task = Job.unpack(Job.of(Experiment(case, Falling(0.25)), 1).pack()).task

    @dataclass(frozen=True)
    class Watched(type(task)):  # type: ignore[misc]
        more: float = 1.0

    assert Watched().parameters() == {"task.duration": 0.6, "task.more": 1.0}


def test_a_robot_travels_by_content(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = find("xarm7")
    experiment = Experiment(replace(case, robot=robot), Stacking())
    job = Job.unpack(Job.of(experiment, 1).pack())
    monkeypatch.setattr("pytest_simbench.simulator.robot_files.folder", lambda: tmp_path)
    assert job.robot is not None
    assert str(robot.urdf) not in str(job.robot.robot)
    there = job.experiment(tmp_path)
    assert there.robot is not None
    assert Path(there.robot.urdf).parent == tmp_path
    assert Path(there.robot.srdf).parent == tmp_path
    assert robot_told(there.robot) == robot_told(robot)
    assert there.problem() is None
    own = Job.unpack(Job.of(Experiment(case, Stacking(robot=robot)), 1).pack())
    assert robot_told(own.experiment(tmp_path).task.robot) == robot_told(robot)  # type: ignore[attr-defined]


def test_errors_come_back_as_what_they_are() -> None:
    where = Where("mujoco", "headless", 1, 2022, "settle")
    found = heard(
        told(Diverged("cube_02 is not finite", where, "log")), Where("mujoco", "headless")
    )
    assert isinstance(found, Diverged)
    assert (found.what, found.phase, found.log_tail) == ("cube_02 is not finite", "settle", "log")
    other = heard(told(ZeroDivisionError("division by zero"), "Traceback ..."), where)
    assert isinstance(other, TaskFailed)
    assert not isinstance(other, WorkerError)
    assert str(other) == "ZeroDivisionError: division by zero\nTraceback ..."
    assert heard(told(None), where) is None


def test_one_machine_marks_what_runs_side_by_side(case: Case) -> None:
    experiment = Experiment(case, Falling())
    contended = [LocalExecutor(jobs).repetition(experiment, 1).case.contended for jobs in (1, 2)]
    assert contended == [False, True]


@pytest.mark.parametrize(
    "module", ["pytest_simbench.plugin.hooks", "pytest_simbench.cluster.executor"]
)
def test_dask_is_imported_for_a_cluster_alone(module: str) -> None:
    code = f"import sys, {module}; print([m for m in ('dask', 'distributed') if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True)
    assert out.stdout.strip() == "[]"
