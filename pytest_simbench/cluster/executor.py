"""The executor of a cluster: each repetition goes to a node.

It is lost when the node's process ended (the simulator may have killed it), when its network is
gone, or when the node says that it cannot (a full disk). Then it goes once more to another node,
and the record says so (`notes.lost_nodes`); after a second loss the repetition has failed. What a
node sends after it was given up is not looked at, so there is one record for each repetition.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, Future, wait
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pytest_simbench.client.errors import Interrupted, NodeLost, Unavailable, Where
from pytest_simbench.cluster.job import Job, Packed, TaskFailed, error_from_wire
from pytest_simbench.cluster.offers import Node
from pytest_simbench.cluster.pool import Pool
from pytest_simbench.experiment.executor import Executor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import (
    describe_robot,
    file_stem,
    record_of,
    scene_digest,
    settings,
)
from pytest_simbench.experiment.repetition import AnyRepetition, Ended, Hooks
from pytest_simbench.recordings.trace import FOLDER as TRACES
from pytest_simbench.records.notes import Notes
from pytest_simbench.records.paths import write_whole
from pytest_simbench.records.record import Failure, Record, Status, plain
from pytest_simbench.tasks.recorded import code_of
from pytest_simbench.worker.wire import told

ATTEMPTS = 2
"""Of a repetition: after a lost node once more elsewhere."""

MOST_AT_ONCE = 256
"""Repetitions that one client has under way; each has a thread that waits for it."""

GONE = "its process ended, or its network is gone"

ROOM = 16
"""More threads than twice the slots that are there now: nodes may come in the middle of a test."""

LOOK_PERIOD = 0.5
"""Between two looks at the node of a job under way [s]."""


@dataclass(frozen=True)
class Shared:
    """What all repetitions of an experiment share.

    Attributes:
        job: goes to the nodes.
        known: attributes of its records that tell of files which are here, not on the node.
    """

    job: Packed
    known: Mapping[str, Any]

    @classmethod
    def of(cls, experiment: Experiment, client: str) -> Shared:
        task, robot = experiment.task, experiment.robot
        known: dict[str, Any] = {"task_code": code_of(task), "scene": scene_digest(task, robot)}
        if robot is not None:
            known["robot"] = describe_robot(robot)
        return cls(Job.of(experiment, client).pack(), known)


class ClusterExecutor(Executor):
    """Repetitions on the nodes of a cluster; `tell` takes why one of these got none."""

    def __init__(self, pool: Pool, tell: Callable[[str], None] = lambda told: None) -> None:
        self.pool = pool
        self.tell = tell
        self._packing = threading.Lock()
        self._last: tuple[Experiment, Shared] | None = None

    @property
    def jobs(self) -> int:
        """More than there are slots: those without one wait for it."""
        return min(MOST_AT_ONCE, ROOM + 2 * self.slots)

    @property
    def slots(self) -> int:
        return sum(node.slots for node in self.pool.nodes()) or 1

    def repetition(
        self, experiment: Experiment, number: int, hooks: Hooks | None = None
    ) -> AnyRepetition:
        return RemoteRepetition(self, experiment, number, hooks or Hooks())

    def shared(self, experiment: Experiment) -> Shared:
        """What an experiment's repetitions share, made once: meshes and data sets are large.

        Raises:
            DescriptionError: a file of its robot is missing or wrong.
        """
        with self._packing:
            if self._last is None or self._last[0] is not experiment:
                self._last = experiment, Shared.of(experiment, self.pool.name)
            return self._last[1]


class _Lost(Exception):
    """The node of a job is lost; says how."""


class RemoteRepetition:
    """One repetition on a node. `run` once; `kill` from any thread."""

    def __init__(
        self,
        executor: ClusterExecutor,
        experiment: Experiment,
        number: int,
        hooks: Hooks,
    ) -> None:
        self.pool = executor.pool
        self.experiment = experiment
        self._shared = executor.shared
        self.case = case = experiment.case
        self._tell = executor.tell
        self.number = number
        self.hooks = hooks
        self.where = Where(case.simulator, case.mode, number, experiment.seed(number))
        self._stop = threading.Event()
        self._lost: list[str] = []
        self._node: Node | None = None

    def kill(self) -> None:
        """End it on its node, or its waiting for one."""
        self._stop.set()

    def run(self) -> Ended:
        """Carry it out; the record, and what ended it early if anything did."""
        began = time.monotonic()
        try:
            answer = self._answer()
            self.hooks.interrupts.hold()
        except BaseException as error:
            self.hooks.interrupts.hold()
            return self._without_result(error, time.monotonic() - began), error
        return self._received(answer)

    def _answer(self) -> Mapping[str, Any]:
        """What a node found.

        Raises:
            NodeLost: as many nodes as there may be were lost, or none is left.
            ExecutorError: the cluster is gone.
        """
        job = self._shared(self.experiment).job
        avoid: set[str] = set()
        while True:
            reserved = self.pool.reserve(self._able, avoid, self._stop)
            if self._stop.is_set():
                if reserved is not None:
                    self.pool.release(reserved[0])
                raise Interrupted("the run was interrupted", self.where)
            if reserved is None:
                raise NodeLost(self._why("no other node offers it"), self.where)
            key, self._node = reserved
            self.hooks.begin(self._node.name)
            try:
                answer = self._on(self._node, key, job)
            except _Lost as lost:
                self._lost.append(f"{self._node.name}: {lost}")
                avoid.add(self._node.name)
                if len(self._lost) == ATTEMPTS:
                    raise NodeLost(self._why("it is not tried again"), self.where) from None
                continue
            if "unknown" in answer:
                continue  # it comes again, and with all of the job
            lacks = (answer["error"] or {}).get("type") == Unavailable.__name__  # no SceneRefused
            avoid.add(self._node.name)
            if lacks and any(self._able(n) and n.name not in avoid for n in self.pool.nodes()):
                continue  # another node may have the device
            return answer

    def _able(self, node: Node) -> bool:
        """Whether a node can carry it out, with the version that the run has."""
        name = self.case.simulator
        if node.stranger:
            self._tell(f"{node.name} got no repetition: it {node.stranger}")
        if not node.has(name, self.case.mode):
            return False
        version = node.versions[name]
        if (began := self.pool.began.setdefault(name, version)) != version:
            self._tell(f"{node.name} got no repetition: {name} is {version} there, {began} here")
        return version == began

    def _why(self, end: str) -> str:
        lost = f"it was lost on {', then on '.join(self._lost)}; " if self._lost else ""
        return f"{lost}{end}"

    def _on(self, node: Node, key: str, job: Packed) -> Mapping[str, Any]:
        """Have a node carry it out.

        Raises:
            _Lost: the node is lost.
            ExecutorError: the cluster is gone, or Dask cannot run anything there.
        """
        future = self.pool.submit(key, node, job, self.number)
        coming = self.pool.result(future)
        try:
            shown: Mapping[str, Any] = {}
            while not wait([coming], LOOK_PERIOD).done:
                if self._stop.is_set():
                    raise Interrupted("the run was interrupted", self.where)
                if not self.pool.lives(node):
                    raise _Lost(GONE)
                shown = self._show(key, shown)
            answer = self._result(coming, node)
            self.pool.note(node, job, there="unknown" not in answer)
            return answer
        finally:
            coming.cancel()
            self.pool.release(key, future)

    def _show(self, key: str, shown: Mapping[str, Any]) -> Mapping[str, Any]:
        now = self.pool.progress(key)
        if now is not shown and now:
            self.where.phase = now["phase"]
            self.hooks.phase(now["phase"])
            if now["total"]:
                self.hooks.count(now["done"], now["total"])
        return now

    def _result(self, coming: Future[Mapping[str, Any]], node: Node) -> Mapping[str, Any]:
        from distributed.scheduler import KilledWorker

        try:
            answer = coming.result()
        except KilledWorker:
            self.pool.give_up(node)
            raise _Lost(GONE) from None
        except CancelledError:  # Dask does so when the connection to the scheduler breaks
            raise self.pool.gone() from None
        except Exception as error:
            if not self.pool.joined:
                raise self.pool.gone() from None
            told = f"{node.name} cannot run it: {type(error).__name__}: {error}"
            raise TaskFailed(told) from None
        if "lost" in answer:
            raise _Lost(str(answer["lost"]))
        return answer

    def _received(self, answer: Mapping[str, Any]) -> Ended:
        """The record that a node sent, with what only this side knows; its files are written."""
        assert self._node is not None
        record = Record.from_json(answer["record"], f"the answer of {self._node.name}")
        known = dict(self._shared(self.experiment).known)
        known["settings"] = {**record.settings, **plain(self.experiment.task.parameters())}
        stem = file_stem(self.experiment, self.number)
        self._keep(record.notes.log, "logs", answer["log"])
        problem = self._keep(f"{TRACES}/{stem}.npz", TRACES, answer["trace"])
        if problem:
            record = record.noting(trace=f"the trace could not be written: {problem}")
        host = {**record.host, "node": self._node.name}
        record = replace(record.noting(lost_nodes=tuple(self._lost)), host=host, **known)
        return record, error_from_wire(answer["error"], self.where)

    def _keep(self, name: str, folder: str, data: bytes | None) -> str:
        """Write a file of the node's into a folder of the run; why that failed, or nothing."""
        if data is None or Path(name).parent != Path(folder):
            return ""
        try:
            write_whole(self.case.folder, name, data)
        except OSError as error:
            return told(error)
        return ""

    def _without_result(self, error: BaseException, seconds: float) -> Record:
        """The record of a repetition of which no node told."""
        status: Status = "failed" if isinstance(error, NodeLost | TaskFailed) else "interrupted"
        what = error.what if isinstance(error, NodeLost) else told(error)
        found: dict[str, Any] = {}
        with suppress(Exception):
            found = settings(self.case)
        return record_of(
            self.experiment,
            self.number,
            status=status,
            settings=found,
            versions={},
            error=Failure(type(error).__name__, what, self.where.phase),
            notes=Notes(lost_nodes=tuple(self._lost)),
            seconds={"total": seconds},
            host={"node": self._node.name} if self._node else {},
        )
