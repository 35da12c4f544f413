"""A repetition under way on a node: what comes of each end that it can have. No scheduler runs."""

from __future__ import annotations

from concurrent.futures import CancelledError, Future
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pytest_simbench.client.errors import ExecutorError, Interrupted
from pytest_simbench.cluster import executor as module
from pytest_simbench.cluster.executor import ClusterExecutor, _Lost
from pytest_simbench.cluster.job import Packed, TaskFailed
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Hooks
from tests.cluster.test_pool import A, B, Told, lab, node
from tests.tiny import Falling

KilledWorker = pytest.importorskip("distributed.scheduler").KilledWorker
JOB = Packed.of(b"job")


class Carrying(Told):
    """Each time that it is asked how far a job is, it is one step further; then comes the end."""

    joined = True
    there = True

    def __init__(self, end: Any, *steps: tuple[str, int, int]) -> None:
        super().__init__([A, B])
        self.end, self.address, self.done = end, "tcp://head", list[Any]()
        told = [dict(zip(("phase", "done", "total"), step, strict=True)) for step in steps]
        self.steps: list[Any] = [{}, *(step for one in told for step in (one, one))]
        self.coming: Future[Any] = Future()

    def submit(self, *sent: Any) -> Any:
        self.done.append(("submit", *sent))
        return "future"

    def result(self, future: Any) -> Any:
        assert future == "future"
        return self.coming

    def progress(self, key: str) -> Any:
        step = self.steps.pop(0)
        if not self.steps and isinstance(self.end, BaseException):
            self.coming.set_exception(self.end)
        elif not self.steps and self.end is not None:
            self.coming.set_result(self.end)
        self.steps = self.steps or [step]
        return step

    def lives(self, node: Any) -> bool:
        return self.there

    def release(self, *given: Any) -> None:
        self.done.append(("release", *given))
        super().release(given[0])

    def give_up(self, node: Any) -> None:
        self.done.append(("give up", node))

    def note(self, *given: Any, **more: Any) -> None:
        self.done.append(("note", *given, more))


@pytest.fixture
def one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Makes the second repetition of a small task, on a pool, and what is told of it."""
    monkeypatch.setattr(module, "LOOK_PERIOD", 0.001)
    adapter = "pytest_simbench.sims.mujoco.adapter:MuJoCo"
    case = Case("t::test_x[mujoco-headless]", "mujoco", "headless", "tuned", adapter, tmp_path)

    def made(pool: Any) -> tuple[Any, list[Any]]:
        told: list[Any] = []
        hooks = Hooks(*(lambda *what, k=k: told.append((k, *what)) for k in ("on", "in", "of")))
        repetition = ClusterExecutor(pool).repetition(Experiment(case, Falling()), 2, hooks)
        return repetition, told

    return made


def test_a_job_is_sent_and_what_it_tells_is_told_once(one: Any) -> None:
    pool = Carrying({"record": "r"}, ("fall", 0, 0), ("land", 1, 2), ("land", 2, 2))
    repetition, told = one(pool)
    assert repetition._on(A, "key", JOB) == {"record": "r"}
    assert told == [("in", "fall"), ("in", "land"), ("of", 1, 2), ("in", "land"), ("of", 2, 2)]
    assert repetition.where.phase == "land"
    assert pool.done == [
        ("submit", "key", A, JOB, 2), ("note", A, JOB, {"there": True}),
        ("release", "key", "future"),
    ]  # fmt: skip
    pool = Carrying({"unknown": "digest"})
    assert one(pool)[0]._on(A, "key", JOB) == {"unknown": "digest"}
    assert pool.done[1] == ("note", A, JOB, {"there": False})


@pytest.mark.parametrize(
    ("end", "joined", "kind", "why"),
    [
        ({"lost": "it cannot"}, True, _Lost, "^it cannot$"),
        (KilledWorker("key", SimpleNamespace(address="a"), "r"), True, _Lost, f"^{module.GONE}$"),
        (CancelledError(), True, ExecutorError, "^the scheduler at tcp://head is gone; "),
        (OSError("no"), False, ExecutorError, "^the scheduler at tcp://head is gone; "),
        (OSError("no"), True, TaskFailed, "^a cannot run it: OSError: no$"),
        (None, True, _Lost, f"^{module.GONE}$"),
    ],
)
def test_what_ends_a_job(one: Any, end: Any, joined: bool, kind: type, why: str) -> None:
    """Its slot is free then, whatever it was."""
    pool = Carrying(end)
    pool.joined, pool.there = joined, end is not None  # type: ignore[misc]
    with pytest.raises(kind, match=why):
        one(pool)[0]._on(A, "key", JOB)
    killed = [("give up", A)] if isinstance(end, KilledWorker) else []
    assert pool.done[1:] == [*killed, ("release", "key", "future")]
    assert pool.coming.done()


def test_a_run_that_is_interrupted_waits_no_longer(one: Any) -> None:
    pool = Carrying(None)
    repetition, _ = one(pool)
    repetition.kill()
    with pytest.raises(Interrupted, match="^the run was interrupted"):
        repetition._on(A, "key", JOB)
    assert pool.done[1:] == [("release", "key", "future")]


def test_a_repetition_ends_with_its_record_or_with_what_went_wrong(
    one: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And Ctrl-C waits from then on until the record is kept."""
    repetition, _ = one(Told([A]))
    held: list[str] = []
    monkeypatch.setattr(repetition.hooks.interrupts, "hold", lambda: held.append("held"))
    monkeypatch.setattr(repetition, "_answer", lambda: "answer")
    monkeypatch.setattr(repetition, "_received", lambda answer: (answer, None))
    assert repetition.run() == ("answer", None)
    error = OSError("no")

    def fails() -> Any:
        raise error

    monkeypatch.setattr(repetition, "_answer", fails)
    clock = SimpleNamespace(monotonic=iter([3.0, 5.5]).__next__)
    monkeypatch.setattr(module, "time", clock)
    record, ended = repetition.run()
    assert (ended, record.seconds["total"], record.status) == (error, 2.5, "interrupted")
    assert (record.repetition, record.error.type, held) == (2, "OSError", ["held", "held"])


def test_a_window_needs_a_node_with_a_display(one: Any) -> None:
    repetition, _ = one(Told([]))
    repetition.case = replace(repetition.case, mode="gui")
    nodes = A, lab("d", "mujoco==4.0", "display")
    assert [repetition._able(node) for node in nodes] == [False, True]


def test_there_are_more_threads_than_slots() -> None:
    executor = ClusterExecutor(Told([node("a", slots=3), node("b")]))
    assert (executor.slots, executor.jobs) == (4, 24)
    assert (ClusterExecutor(Told([])).slots, ClusterExecutor(Told([])).jobs) == (1, 18)
    assert ClusterExecutor(Told([node("a", slots=999)])).jobs == 256
