"""What a node does for a repetition, and leaves behind. No simulator and no scheduler run."""

from __future__ import annotations

import errno
import os
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pytest_simbench.client.errors import Diverged, Where
from pytest_simbench.cluster import node as module
from pytest_simbench.cluster.job import Packed, error_to_wire
from pytest_simbench.cluster.node import Benches
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import file_stem, record_of
from pytest_simbench.experiment.workers import IdleWorkers
from pytest_simbench.records.notes import Notes
from tests.tiny import Falling

distributed: Any = pytest.importorskip("distributed")
PATIENCE = 20.0
"""For what takes milliseconds, on a machine that is busy [s]."""


def job(client: str = "me", **case: Any) -> Any:
    told = {"costly_start": False, "fresh": False, "mode": "headless", **case}
    return SimpleNamespace(client=client, case=told)


class Timer:
    made: list[Any] = []  # noqa: RUF012

    def __init__(self, seconds: float, call: Any, arguments: Any) -> None:
        self.seconds, self.fire = seconds, lambda: call(*arguments)
        self.daemon = False

    def start(self) -> None:
        Timer.made.append(self)


def test_a_bench_is_shared_by_a_case_and_cleared_away(monkeypatch: pytest.MonkeyPatch) -> None:
    """At once, or where starting is costly once nobody has used it for a while."""
    at_exit: list[Any] = []
    monkeypatch.setattr(module, "atexit", SimpleNamespace(register=at_exit.append))
    timed = SimpleNamespace(**{**vars(threading), "Timer": Timer})
    monkeypatch.setattr(module, "threading", timed)
    monkeypatch.setattr(Timer, "made", [])
    benches = Benches()
    with benches.bench(job()) as one, benches.bench(job()) as same:
        assert one is same
        with benches.bench(job("you")) as theirs, benches.bench(job(seed=1)) as other:
            folders = [bench.folder for bench in (one, theirs, other)]
            assert [folder.is_dir() for folder in folders] == [True] * 3
            assert len({*folders}) == 3
        assert [folder.is_dir() for folder in folders] == [True, False, False]
    with benches.bench(job(costly_start=True, fresh=True)) as fresh:
        pass
    assert [bench.folder.exists() for bench in (one, fresh)] == [False, False]
    assert not Timer.made
    with benches.bench(job(costly_start=True)) as kept:
        pass
    (first,) = Timer.made
    assert (first.seconds, first.daemon, kept.folder.is_dir()) == (60.0, True, True)
    with benches.bench(job(costly_start=True)) as again:
        first.fire()
        assert again is kept
    first.fire()
    assert kept.folder.is_dir()  # it was used since
    Timer.made[1].fire()
    Timer.made[1].fire()
    assert not kept.folder.exists()
    with benches.bench(job(costly_start=True)) as left:
        pass
    at_exit[0]()
    assert not left.folder.exists()


@pytest.fixture
def carried(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """What is made of a repetition that ends so, by a node of so many slots; and all that was
    given to it."""
    adapter = "pytest_simbench.sims.mujoco.adapter:MuJoCo"
    case = Case("t::test_x[mujoco-headless]", "mujoco", "headless", "tuned", adapter, tmp_path)
    experiment, given = Experiment(case, Falling()), SimpleNamespace()
    stem = file_stem(experiment, 2)

    def carry(
        error: Any = None, named: str = "logs/x.log", slots: int = 1, **files: bytes
    ) -> tuple[Any, Any]:
        class Made:
            def __init__(self, *what: Any, **more: Any) -> None:
                given.what, given.more = what, more

            def run(self) -> Any:
                given.more["hooks"].phase("fall"), given.more["hooks"].count(1, 2)
                for name, content in files.items():
                    place = (
                        given.folder / {"log": "logs/x.log", "trace": f"traces/{stem}.npz"}[name]
                    )
                    place.parent.mkdir()
                    place.write_bytes(content)
                return given.record, error

        def made(folder: Path, **more: Any) -> Experiment:
            given.folder, given.asked = folder, more
            return experiment

        given.record = record_of(
            experiment, 2, status="ok", settings={}, versions={}, host={}, notes=Notes(log=named)
        )
        monkeypatch.setattr(module, "Repetition", Made)
        asked = job(mode="gui" if slots > 1 else "headless")
        asked.experiment, given.progress, started = made, {}, []
        answer = module.carry_out(asked, 2, slots, given.progress, started.append)
        assert isinstance(started[0], Made)
        assert given.what == (experiment, 2)
        assert isinstance(given.more["idle"], IdleWorkers)
        return answer, given

    return carry


def test_a_repetition_comes_with_its_files(carried: Any) -> None:
    answer, given = carried(trace=b"moved")
    record = given.record.to_json()
    assert answer == {"record": record, "error": None, "log": None, "trace": b"moved"}
    assert given.progress == {"phase": "fall", "done": 1, "total": 2}
    assert given.asked == {"contended": False, "display": None}
    assert not given.folder.exists()
    error = Diverged("it flew", Where("mujoco", "headless", 2, 7, "fall"))
    said = b"a" * 2**20 + b"end"
    answer, given = carried(error, slots=2, log=said)
    assert (answer["error"], answer["trace"]) == (error_to_wire(error), None)
    assert answer["log"] == said[3:]
    assert given.asked == {"contended": True, "display": module._displays}
    answer, _ = carried(OSError(errno.EPERM, "not allowed"), named="")
    told = {"type": "PermissionError", "what": "[Errno 1] not allowed"}
    assert answer["error"] == {**told, "traceback": f"PermissionError: {told['what']}\n"}
    with pytest.raises(OSError, match="full"):
        carried(OSError(errno.ENOSPC, "full"))


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The worker of Dask that a job runs in: its state, its events, and the watchers it leaves."""
    told = SimpleNamespace(tasks={"key": SimpleNamespace(state="executing")}, nthreads=3)
    heard, events, before = threading.Event(), list[Any](), set(threading.enumerate())

    def log_event(*event: Any) -> None:
        events.append(event)
        heard.set()

    worker = SimpleNamespace(get_current_task=lambda: "key", state=told, log_event=log_event)
    monkeypatch.setattr(distributed, "get_worker", lambda: worker)
    monkeypatch.setattr(module, "LOOK_PERIOD", 0.001)
    monkeypatch.setattr(module.Job, "unpack", lambda data: ("unpacked", data))
    yield SimpleNamespace(state=told, heard=heard, events=events)
    for thread in {*threading.enumerate()} - before:
        thread.join(PATIENCE)
        assert not thread.is_alive()


def test_progress_is_told_when_it_is_another(asked: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def carry_out(job: Any, number: int, slots: int, progress: Any, started: Any) -> Any:
        started(None)
        assert all(one.daemon for one in threading.enumerate() if "watch" in one.name)
        for step in ({"phase": "fall"}, {"done": 1, "total": 2}):
            asked.heard.clear()
            progress.update(step)
            assert asked.heard.wait(PATIENCE)
        return job, number, slots

    monkeypatch.setattr(module, "carry_out", carry_out)
    assert module.run(Packed(None, "0"), 4) == {"unknown": "0"}
    assert module.run(Packed.of(b"job"), 4) == (("unpacked", b"job"), 4, 3)
    fall = {"key": "key", "phase": "fall", "done": 0, "total": 0}
    assert asked.events == [(module.TOPIC, fall), (module.TOPIC, {**fall, "done": 1, "total": 2})]


@pytest.mark.parametrize("state", ["cancelled", "released", "forgotten", ""])
def test_what_nobody_wants_any_more_ends(
    asked: Any, monkeypatch: pytest.MonkeyPatch, state: str
) -> None:
    def carry_out(job: Any, number: int, slots: int, progress: Any, started: Any) -> Any:
        started(SimpleNamespace(kill=killed.set))
        asked.state.tasks = {"key": SimpleNamespace(state=state)} if state else {}
        return killed.wait(PATIENCE)

    killed = threading.Event()
    monkeypatch.setattr(module, "carry_out", carry_out)
    assert module.run(Packed.of(b"job"), 4) is True


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EMFILE, errno.EPERM])
def test_a_machine_that_cannot_says_so(
    asked: Any, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def carry_out(*given: Any) -> Any:
        given[-1](None)
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(module, "carry_out", carry_out)
    if number == errno.EPERM:  # as any machine may say
        with pytest.raises(PermissionError):
            module.run(Packed.of(b"job"), 4)
    else:
        told = {"lost": f"it cannot: {os.strerror(number)}"}
        assert module.run(Packed.of(b"job"), 4) == told
