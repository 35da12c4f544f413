"""What goes to a node is the same experiment there; what comes back is the same error here."""

from __future__ import annotations

import subprocess
import sys
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pytest_simbench.client.errors import Diverged, Interrupted, NodeLost, Where, WorkerError
from pytest_simbench.cluster import job as module
from pytest_simbench.cluster.executor import ClusterExecutor, _Lost
from pytest_simbench.cluster.job import Job, Packed, TaskFailed, error_from_wire, error_to_wire
from pytest_simbench.cluster.node import LatestJobs
from pytest_simbench.cluster.offers import Node
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import (
    describe_robot,
    expected,
    file_stem,
    record_of,
    settings,
)
from pytest_simbench.experiment.policy_file import read_policies
from pytest_simbench.experiment.repetition import Hooks
from pytest_simbench.motion.panda import panda
from pytest_simbench.motion.registry import find
from pytest_simbench.records.notes import Notes
from pytest_simbench.records.record import Failure
from pytest_simbench.scene import Scene
from pytest_simbench.scene.policy import Function
from pytest_simbench.tasks import Holding, Reaching, Settling, Stacking
from tests.cluster.test_pool import A, B, Told, lab
from tests.tiny import Falling


def test_the_experiment_is_the_same_on_the_node(case: Case, tmp_path: Path) -> None:
    experiment = Experiment(replace(case, changes={"timestep": 0.001}), Falling(0.3))
    job = Job.unpack(Job.of(experiment, "me").pack().data or b"")
    there = job.experiment(tmp_path)
    assert (job.client, there.case.folder) == ("me", tmp_path)
    assert replace(expected(there, 3), scene="") == replace(expected(experiment, 3), scene="")


def test_what_is_of_a_machine_is_the_nodes_own(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = SimpleNamespace(variables=lambda: {"CACHE": "own"})
    monkeypatch.setattr(module, "interpreter", lambda info: f"python of {info.name}")
    monkeypatch.setattr(module, "Environment", SimpleNamespace(of=lambda info: own))
    theirs = replace(case, python="p", spec="s", environment={"A": "1"}, contended=True)
    there = Job.of(Experiment(theirs, Falling())).experiment(tmp_path / "n", display=None).case
    told = {"python": "python of mujoco", "environment": {"CACHE": "own"}, "folder": tmp_path / "n"}
    assert there == replace(case, **told)


def of_node(experiment: Experiment, asked: str) -> str:
    """What a process elsewhere prints of the task that reached it."""
    code = (
        "import sys; from pytest_simbench.cluster.job import Job; sys.modules['tests'] = None\n"
        f"task = Job.unpack(sys.stdin.buffer.read()).task\nprint({asked})"
    )
    packed, command = Job.of(experiment).pack().data, [sys.executable, "-P", "-c", code]
    out = subprocess.run(command, input=packed, capture_output=True, check=True, cwd="/").stdout
    return out.decode().strip()


def test_a_task_of_the_tests_travels_as_code(case: Case) -> None:
    """The node has neither the test nor what its class is derived from."""
    asked = "task, [metric.name for metric in task.metrics]"
    assert of_node(Experiment(case, Falling(0.25)), asked) == "Falling(duration=0.25) ['landed']"


@pytest.mark.engine
@pytest.mark.parametrize("name", ["still", "wrapped"])
def test_so_does_the_policy_of_a_file(case: Case, tmp_path: Path, name: str) -> None:
    path = tmp_path / "mine.py"
    path.write_text(
        "class Still:\n    name = 'still'\n    def act(self, seen):\n        return seen\n"
        "def act(seen):\n    return seen\n"
        "policies = {'still': Still(), 'wrapped': act}\n"
    )
    (policy,) = read_policies(path, name)
    assert of_node(Experiment(case, Reaching(policy)), "task.policy.act(3)") == "3"


class Still:
    name = "still"

    def act(self, seen: Any) -> Any:
        return seen


def unmoved(seen: Any) -> Any:
    return seen


@pytest.mark.parametrize("task", [Reaching(Still()), Reaching(Function(unmoved)), Falling(0.2)])
def test_what_is_the_tests_own_travels_as_code(
    case: Case, monkeypatch: pytest.MonkeyPatch, task: Any
) -> None:
    """And nothing else; afterwards cloudpickle sends as before."""
    cloudpickle, sent, left = pytest.importorskip("cloudpickle"), list[Any](), list[Any]()
    monkeypatch.setattr(cloudpickle, "register_pickle_by_value", sent.append)
    monkeypatch.setattr(cloudpickle, "unregister_pickle_by_value", left.append)
    Job.of(Experiment(case, task)).pack()
    assert sent == left == [sys.modules["tests.tiny" if isinstance(task, Falling) else __name__]]


def test_a_class_that_travelled_can_be_derived_from(case: Case) -> None:
    """Its parameters have the defaults that they had, also in who unpacks its own job."""
    task = Job.unpack(Job.of(Experiment(case, Falling(0.25))).pack().data or b"").task

    @dataclass(frozen=True)
    class Watched(type(task)):  # type: ignore[misc]
        more: float = 1.0

    assert Watched().parameters() == {"task.duration": 0.6, "task.more": 1.0}


def test_a_robot_travels_by_content(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = find("xarm7")
    experiment = Experiment(replace(case, robot=robot), Stacking())
    data = Job.of(experiment).pack().data or b""
    assert not any(path.encode() in data for path in (robot.urdf, robot.srdf))
    monkeypatch.setattr("pytest_simbench.description.robot_files.folder", lambda: tmp_path)
    there = Job.unpack(data).experiment(tmp_path)
    assert Path(there.robot.urdf).parent == tmp_path
    assert Path(there.robot.srdf).parent == tmp_path
    assert describe_robot(there.robot) == describe_robot(robot)
    assert there.problem() is None
    own = Job.unpack(Job.of(Experiment(case, Stacking(robot=robot))).pack().data or b"")
    assert describe_robot(own.experiment(tmp_path).task.robot) == describe_robot(robot)  # type: ignore[attr-defined]


@pytest.mark.parametrize("task", [Settling, Holding])
def test_so_does_that_of_a_task_s_scene(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, task: type[Settling | Holding]
) -> None:
    """A file's joints are one: the node has neither the file nor what was made of it."""
    robot = panda()
    data = Job.of(Experiment(case, task(Scene("arm", (), robot)))).pack().data or b""
    assert robot.urdf.encode() not in data
    monkeypatch.setattr("pytest_simbench.description.robot_files.folder", lambda: tmp_path)
    there = Job.unpack(data).task.world.robot  # type: ignore[attr-defined]
    assert Path(there.urdf).parent == tmp_path
    assert describe_robot(there) == describe_robot(robot)


def test_it_is_packed_once_for_all_repetitions(case: Case) -> None:
    executor = ClusterExecutor(Told([]))
    one, other = Experiment(case, Falling()), Experiment(case, Falling(0.3))
    shared = executor.shared(one)
    assert executor.shared(one) is shared
    of_other = executor.shared(other)
    assert executor.shared(one) == shared  # unpacking renews the class here
    there = Job.unpack(of_other.job.data or b"")
    assert there.task.parameters() == other.task.parameters()


def test_it_goes_to_a_node_once(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[Packed] = []
    pool, node = Told([A]), LatestJobs()
    pool._client = SimpleNamespace(submit=lambda call, job, *_, **__: sent.append(job))  # type: ignore[assignment]
    jobs = [Packed.of(b"one"), Packed.of(b"other")]
    for job in (*jobs, *jobs):
        pool.submit("key", A, job, 1)
        assert node.find(sent[-1]) == job.data
        pool.note(A, job, there=True)
    assert [job.data for job in sent] == [b"one", b"other", None, None]
    monkeypatch.setattr("pytest_simbench.cluster.node.KEPT_JOBS", 1)
    assert node.find(sent[-1]) == b"other"  # the last that was asked for is kept
    assert node.find(sent[-2]) is None
    pool.note(A, jobs[0], there=False)
    pool.submit("key", A, jobs[0], 1)
    assert node.find(sent[-1]) == b"one"


def test_errors_come_back_as_what_they_are() -> None:
    where = Where("mujoco", "headless", 1, 2022, "settle")
    found = error_from_wire(
        error_to_wire(Diverged("cube_02 is not finite", where, "log")), Where("mujoco", "headless")
    )
    assert isinstance(found, Diverged)
    assert (found.what, found.phase, found.log_tail) == ("cube_02 is not finite", "settle", "log")
    other = error_from_wire(
        error_to_wire(ZeroDivisionError("division by zero"), "Traceback ..."), where
    )
    assert isinstance(other, TaskFailed)
    assert not isinstance(other, WorkerError)
    assert str(other) == "ZeroDivisionError: division by zero\nTraceback ..."
    assert str(error_from_wire(error_to_wire(ValueError("x")), where)) == "ValueError: x"
    assert error_from_wire(error_to_wire(None), where) is None


def test_what_a_node_sends_is_the_record_but_for_what_only_this_side_knows(case: Case) -> None:
    experiment, where = Experiment(case, Falling(0.3)), Where("mujoco", "headless", 2, 7, "fall")
    one: Any = ClusterExecutor(Told([A])).repetition(experiment, 2)
    one._node, one._lost = A, ["b: gone"]
    sent = record_of(
        experiment, 2, status="failed", settings={"timestep": 0.1, "task.duration": 9.0},
        versions={"mujoco": "4.0"}, host={"cpu": "theirs"}, notes=Notes(log="logs/x.log"),
    )  # fmt: skip
    theirs = replace(sent, scene="of another file", task_code="of another file")
    error = error_to_wire(Diverged("it flew", where))
    answer = {"record": theirs.to_json(), "error": error, "log": b"said", "trace": b"moved"}
    record, ended = one._received(answer)
    kept = Notes(log="logs/x.log", lost_nodes=("b: gone",))
    told = {"timestep": 0.1, "task.duration": 0.3}
    assert record == replace(sent, host={"cpu": "theirs", "node": "a"}, notes=kept, settings=told)
    assert (type(ended), ended.what) == (Diverged, "it flew")
    trace = case.folder / "traces" / f"{file_stem(experiment, 2)}.npz"
    assert [(case.folder / "logs/x.log").read_bytes(), trace.read_bytes()] == [b"said", b"moved"]
    trace.unlink(), trace.mkdir()
    outside = replace(theirs, notes=Notes(log="x.log")).to_json()
    record, _ = one._received({**answer, "record": outside})
    assert record.notes.trace.startswith("the trace could not be written: [Errno 21] Is a dir")
    assert not (case.folder / "x.log").exists()

    for why, status, what in (
        (NodeLost("gone", where), "failed", "gone"), (TaskFailed("no"), "failed", "no"),
        (Interrupted("over", where), "interrupted", str(Interrupted("over", where))),
    ):  # fmt: skip
        assert one._without_result(why, 3.5) == record_of(
            experiment, 2, status=status, settings=settings(case), versions={},
            error=Failure(type(why).__name__, what, "fall"), seconds={"total": 3.5},
            notes=Notes(lost_nodes=("b: gone",)), host={"node": "a"},
        )  # fmt: skip


LACKS, FAILS, OK = ({"error": e} for e in ({"type": "Unavailable"}, {"type": "Diverged"}, None))


@pytest.mark.parametrize(
    ("ends", "asked", "told"),
    [
        (["gone", OK], "ba", ""), ([{"unknown": "0"}, OK], "bb", ""), ([FAILS], "b", ""),
        ([LACKS, OK], "ba", ""), ([LACKS, LACKS], "ba", ""),
        (["gone", "full"], "ba",
         "it was lost on b: gone, then on a: full; it is not tried again"),
    ],
)  # fmt: skip
def test_which_nodes_are_asked(case: Case, ends: list[Any], asked: str, told: str) -> None:
    begun: list[str] = []
    executor = ClusterExecutor(Told([A, B]))
    one: Any = executor.repetition(Experiment(case, Falling()), 1, Hooks(begin=begun.append))

    def on(node: Node, key: str, job: Packed) -> Any:
        executor.pool.release(key)
        end = ends[len(begun) - 1]
        if isinstance(end, str):
            raise _Lost(end)
        return end

    one._on = on
    with pytest.raises(NodeLost, match=f"^{told}") if told else nullcontext():
        assert one._answer() == ends[-1]
    assert "".join(begun) == asked
    one.kill()
    with pytest.raises(Interrupted):
        one._answer()
    assert not executor.pool._mine


def test_without_a_node_that_offers_it_a_repetition_fails(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pytest_simbench.cluster.pool.PATIENCE", 0.0)
    executor = ClusterExecutor(Told([lab("c", "drake==1.51")]))
    with pytest.raises(NodeLost, match="^no other node offers it"):
        executor.repetition(Experiment(case, Falling()), 1)._answer()  # type: ignore[attr-defined]


def test_one_machine_marks_what_runs_side_by_side(case: Case) -> None:
    experiment = Experiment(case, Falling())
    for jobs in (1, 2):
        executor = LocalExecutor(jobs)
        assert executor.repetition(experiment, 1).case.contended == (jobs > 1)  # type: ignore[attr-defined]
        executor.close()


@pytest.mark.parametrize(
    "module", ["pytest_simbench.plugin.hooks", "pytest_simbench.cluster.executor"]
)
def test_dask_is_imported_for_a_cluster_alone(module: str) -> None:
    code = f"import sys, {module}; print([m for m in ('dask', 'distributed') if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True)
    assert out.stdout.strip() == "[]"
