"""Carries one repetition of a job out, in the process of a node that Dask runs.

Logs and traces lie in a temporary folder until they are on their way. Where starting is costly a
worker waits for the next repetition of its case, for `IDLE` seconds.
"""

from __future__ import annotations

import atexit
import errno
import shutil
import tempfile
import threading
import time
import traceback
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pytest_simbench.client.display import Displays
from pytest_simbench.cluster.job import Job, Packed, error_to_wire
from pytest_simbench.experiment.identity import file_stem
from pytest_simbench.experiment.repetition import Hooks, Repetition
from pytest_simbench.experiment.workers import IdleWorkers
from pytest_simbench.recordings.trace import FOLDER as TRACES

TOPIC = "pytest-simbench"
"""Of Dask's events that tell how far a repetition is."""

LOOK_PERIOD = 0.5
"""Between two looks whether somebody still wants the result, and two words of progress [s]."""

IDLE = 60.0
"""That a worker waits for the next repetition, where starting is costly [s]."""

OF_THE_MACHINE = (
    errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO, errno.EMFILE, errno.ENFILE, errno.ENOMEM,
    errno.EAGAIN,
)  # fmt: skip
"""Errors that another machine may not have: a full disk, too many files or processes."""

KEPT_JOBS = 32
"""With a robot of many meshes each has some megabytes."""

LARGEST_LOG = 2**20
"""Of a log that is sent back [bytes]; its end is kept. Workers' logs are cut to less."""


@dataclass
class Bench:
    """What repetitions of one case share on a node."""

    folder: Path
    idle: IdleWorkers = field(default_factory=IdleWorkers)
    users: int = 0
    left: float = 0.0

    def close(self) -> None:
        self.idle.close()
        shutil.rmtree(self.folder, ignore_errors=True)


class Benches:
    """The benches of a node; those that nobody has used for a while are cleared away."""

    def __init__(self) -> None:
        self._by_case: dict[str, Bench] = {}
        self._lock = threading.Lock()
        atexit.register(self._close)

    @contextmanager
    def bench(self, job: Job) -> Iterator[Bench]:
        """For one repetition.

        Raises:
            OSError: no folder can be made.
        """
        key = repr((job.client, sorted(job.case.items())))
        with self._lock:
            if key not in self._by_case:
                self._by_case[key] = Bench(Path(tempfile.mkdtemp(prefix="simbench-node-")))
            bench = self._by_case[key]
            bench.users += 1
        try:
            yield bench
        finally:
            with self._lock:
                bench.users -= 1
                bench.left = left = time.monotonic()
            if job.case["costly_start"] and not job.case["fresh"]:
                timer = threading.Timer(IDLE, self._clear, (key, left))
                timer.daemon = True
                timer.start()
            else:
                self._clear(key, left)

    def _clear(self, key: str, left: float) -> None:
        """Clear a bench away that nobody has used since it was left."""
        with self._lock:
            bench = self._by_case.get(key)
            if bench is None or bench.users or bench.left != left:
                return
            del self._by_case[key]
        bench.close()

    def _close(self) -> None:
        for bench in self._by_case.values():
            bench.close()


_benches = Benches()
_displays = Displays()


def carry_out(
    job: Job,
    number: int,
    slots: int,
    progress: dict[str, Any],
    started: Callable[[Repetition], object],
) -> dict[str, Any]:
    """Carry a repetition out.

    Args:
        number: of the repetition; 0 starts and ends the simulator alone.
        slots: of the node; with several at once, records are contended.
        progress: takes how far it is: `phase`, `done`, `total`.
        started: told of the repetition before it runs, so that another thread may kill it.

    Returns:
        `record` (a line of JSON), `error` (see `job.error_to_wire`), `log` and `trace` (bytes, or
        None).

    Raises:
        OSError: this machine cannot carry it out: its disk is full, for instance.
    """
    with _benches.bench(job) as bench:
        display = _displays if job.case["mode"] == "gui" else None
        experiment = job.experiment(bench.folder, contended=slots > 1, display=display)
        hooks = Hooks(
            phase=lambda name: progress.update(phase=name),
            count=lambda done, total: progress.update(done=done, total=total),
        )
        repetition = Repetition(experiment, number, idle=bench.idle, hooks=hooks)
        started(repetition)
        record, error = repetition.run()
        if isinstance(error, OSError) and error.errno in OF_THE_MACHINE:
            raise error
        lines = "" if error is None else "".join(traceback.format_exception(error))
        name = record.notes.log
        trace = bench.folder / TRACES / f"{file_stem(experiment, number)}.npz"
        return {
            "record": record.to_json(),
            "error": error_to_wire(error, lines),
            "log": _read(bench.folder / name) if name else None,
            "trace": _taken(trace),
        }


def _read(path: Path) -> bytes | None:
    with suppress(OSError):
        return path.read_bytes()[-LARGEST_LOG:]
    return None


def _taken(path: Path) -> bytes | None:
    """A file, which is gone then."""
    with suppress(OSError):
        data = path.read_bytes()
        path.unlink()
        return data
    return None


class LatestJobs:
    """Jobs that came lately, so that each has to come once."""

    def __init__(self) -> None:
        self._data: OrderedDict[str, bytes] = OrderedDict()
        self._lock = threading.Lock()

    def find(self, job: Packed) -> bytes | None:
        """All of a job, if it came with it or before."""
        with self._lock:
            data = self._data.pop(job.digest, job.data)
            if data is not None:
                self._data[job.digest] = data
            while len(self._data) > KEPT_JOBS:
                self._data.popitem(last=False)
            return data


_latest = LatestJobs()


def run(packed: Packed, number: int) -> dict[str, Any]:
    """What Dask calls on a node, with a job or its digest alone.

    Returns:
        what `carry_out` does; or `lost`: why this node cannot carry it out, as text; or `unknown`:
        the digest of a job that is not there.
    """
    from distributed import get_worker

    data = _latest.find(packed)
    if data is None:
        return {"unknown": packed.digest}
    worker = get_worker()
    key = worker.get_current_task()
    nothing: dict[str, Any] = {"phase": "", "done": 0, "total": 0}
    progress, ended = dict(nothing), threading.Event()

    def watch(repetition: Repetition) -> None:
        """Tell of the progress, and end what nobody wants any more."""
        before = nothing
        while not ended.wait(LOOK_PERIOD):
            task = worker.state.tasks.get(key)
            if task is None or task.state in ("cancelled", "released", "forgotten"):
                repetition.kill()
                return
            now = dict(progress)
            if now != before:
                worker.log_event(TOPIC, {"key": key, **now})
                before = now

    def started(repetition: Repetition) -> None:
        threading.Thread(target=watch, args=(repetition,), daemon=True).start()

    try:
        return carry_out(Job.unpack(data), number, worker.state.nthreads, progress, started)
    except OSError as error:
        if error.errno not in OF_THE_MACHINE:
            raise
        return {"lost": f"it cannot: {error.strerror}"}
    finally:
        ended.set()
