"""Faults of every kind at random moments, on real engines: what is lost, left behind, or hangs?

    python benchmarks/chaos.py [REPETITIONS] [SEED]

Each repetition is a tiny task on one of four engines with one fault, drawn at random; the faults in
workers are in chaos_faults.py, those of the run (Ctrl-C, killed pytest, killed display) here. Told
at the end: records lost or with the wrong status, cause or seed; processes left behind; repetitions
that took longer than their limits allow; differences between the tables and the truth.
"""

from __future__ import annotations

import _thread
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np
import psutil
from chaos_faults import ADAPTERS, LATER

from pytest_simbench.client import reaper
from pytest_simbench.client.display import Displays
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repeater import Repeater
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record
from pytest_simbench.report.model.summary import summarise
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.tasks.base import Count, Jitter, Outcome, Task, cube

STALL, TIMEOUT, MEMORY = 5.0, 15.0, 200.0
"""Limits of every repetition: silence [s], time from launch [s], memory [MB]."""

WINDOW_STALL = 12.0
"""Where a window opens, which takes seconds with software rendering [s]."""

SLACK = 15.0
"""Wall time beyond the limits for noticing, closing (10 s at most) and recording [s]."""

DURATION = 0.6
"""Simulated time that the task takes [s]; faults come at a random moment of its first 0.5 s."""


@dataclass(frozen=True)
class Fault:
    """What happens, and what the record must say.

    Attributes:
        name: of `chaos_faults`, or of this file.
        status: of the record.
        cause: type of its error, and a part of its message.
        phase: of its error; None for any.
    """

    name: str
    status: str = "failed"
    cause: tuple[str, str] = ("", "")
    phase: str | None = "fall"


HUNG = ("WorkerHung", "no sign of life")
FAULTS = (
    Fault("none", "ok"),
    Fault("SIGSEGV", cause=("WorkerExited", "SIGSEGV")),
    Fault("SIGABRT", cause=("WorkerExited", "SIGABRT")),
    Fault("SIGKILL", cause=("WorkerExited", "SIGKILL")),
    Fault("SIGBUS", cause=("WorkerExited", "SIGBUS")),
    Fault("SIGTERM of the worker", cause=("WorkerExited", "SIGTERM")),
    Fault("SIGSTOP while starting", cause=HUNG, phase="launch"),
    Fault("SIGSTOP while loading", cause=HUNG, phase="load"),
    Fault("SIGSTOP while stepping", cause=HUNG),
    Fault("SIGSTOP between requests", cause=HUNG),
    Fault("SIGSTOP while closing", "ok"),
    Fault("interpreter kept between requests", cause=HUNG),
    Fault("hang, interpreter kept", cause=HUNG),
    Fault("hang, interpreter free", cause=HUNG),
    Fault("garbage on stdout", "ok"),
    Fault("garbage among the messages", cause=("WorkerExited", "broke the connection")),
    Fault("half a message", cause=HUNG),
    Fault("connection closed", cause=("WorkerExited", "broke the connection")),
    Fault("sys.exit", cause=("WorkerExited", "sys.exit(4)")),
    Fault("os._exit", cause=("WorkerExited", "status 5")),
    Fault("exception while starting", cause=("EngineFailed", "no licence"), phase="launch"),
    Fault("exception while loading", cause=("EngineFailed", "no such shape"), phase="load"),
    Fault("exception while reading back", cause=("EngineFailed", "cannot tell"), phase="load"),
    Fault("exception while stepping", cause=("EngineFailed", "unhappy")),
    Fault("exception while closing", "ok"),
    Fault("base exception", cause=("EngineFailed", "from inside")),
    Fault("huge message", cause=("EngineFailed", "more characters")),
    Fault("surrogate message", cause=("EngineFailed", "\\ud800")),
    Fault("endless recursion", cause=("EngineFailed", "RecursionError")),
    Fault("state not a number", cause=("Diverged", "not finite")),
    *(Fault(f"state {what}", cause=("BadState", "float64")) for what in ("of nothing", "a text")),
    *(
        Fault(f"time {what}", cause=("BadState", "the time must be"))
        for what in ("not a number", "infinite", "stands still", "runs back", "jumps")
    ),
    Fault("versions of numbers", cause=("ProtocolError", "$.versions"), phase="launch"),
    Fault("fork that answers", cause=("ProtocolError", "engine forks"), phase=None),
    Fault("wrong shape", cause=("BadState", "float64 (2, 13)"), phase="load"),
    Fault("wrong type of number", cause=("BadState", "float32"), phase="load"),
    Fault("bodies in another order", cause=("BadState", "order"), phase="load"),
    Fault("memory up to the limit", cause=("OutOfMemory", "--sim-memory-limit"), phase=None),
    Fault("memory refused", cause=("OutOfMemory", "allocate")),
    Fault("slow", cause=("RepetitionTimeout", "--sim-timeout")),
    Fault("child left behind", "ok"),
    Fault("child stopped, left behind", "ok"),
    Fault("child stopped, waited for", cause=HUNG),
    Fault("SIGSEGV of a child", cause=("EngineFailed", "SIGSEGV")),
    Fault("daemon left behind", "ok"),
    Fault("full disk for the log", "ok"),
    Fault("log deleted", "ok"),
    Fault("folder deleted", "ok"),
    Fault("log flooded", "ok"),
    Fault("display killed", cause=("DisplayLost", "SIGKILL"), phase=None),
    Fault("Ctrl-C", "interrupted", ("KeyboardInterrupt", ""), None),
    Fault("Ctrl-C three times", "interrupted", ("KeyboardInterrupt", ""), None),
    Fault("SIGKILL of pytest"),
    Fault("SIGTERM of pytest"),
)
OF_PYTEST = {"SIGKILL of pytest": signal.SIGKILL, "SIGTERM of pytest": signal.SIGTERM}
WINDOWS = ("mujoco", "pybullet", "dart")
"""Engines whose window needs nothing but a display."""


@dataclass(frozen=True)
class Falling(Task):
    """Two cubes fall and are counted on the ground."""

    name: ClassVar[str] = "falling"
    study_timeout: ClassVar[float] = TIMEOUT

    fault: str = ""

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (Metric("landed", "landed", kind="share", of=2, study=True),)

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        places = (("left", 0.0), ("right", 0.2))
        bodies = [cube(name, Pose.at(x, 0, 0.1), (1, 1, 1, 1)) for name, x in places]
        return Scene("falling", tuple(bodies))

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        with world.phase("fall"):
            if self.fault in LATER:  # and then send more than a pipe holds
                time.sleep(1.0)
                world.process.request("read_back", ballast=np.zeros(1_000_000))
            if self.fault == "display killed":
                for child in psutil.Process().children():
                    if child.name() == "Xvfb":
                        child.kill()
            if self.fault.startswith("Ctrl-C") or self.fault == "slow":
                world.wait(1e6)
            world.wait(DURATION)
        return Outcome({"landed": sum(p.position[2] < 0.03 for p in world.poses().values()) / 2})


class Silent:
    """Progress that nobody watches."""

    def __getattr__(self, name: str) -> object:
        return lambda *arguments: None


@dataclass
class Tally:
    """What went wrong, in sentences, and what was measured."""

    wrong: list[str] = field(default_factory=list)
    seconds: list[tuple[float, str]] = field(default_factory=list)
    truth: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    orphans: int = 0
    lost: int = 0

    def check(self, fine: bool, sentence: str) -> None:
        if not fine:
            self.wrong.append(sentence)
            print(f"    WRONG: {sentence}", flush=True)


@contextmanager
def ctrl_c(times: int, after: float) -> Iterator[None]:
    """Interrupt this process a moment from now, once or more."""

    def work() -> None:
        time.sleep(after)
        for _ in range(times):
            _thread.interrupt_main()
            time.sleep(0.01)

    thread = threading.Thread(target=work)
    if times:
        thread.start()
    yield
    if times:
        thread.join()


def one(case: Case, fault: Fault, number: int, rng: random.Random, tally: Tally) -> None:
    """One repetition with one fault, in this process."""
    kept: list[Record] = []
    folder = RunFolder(case.folder)

    def keep(record: Record) -> None:
        kept.append(record)
        folder.append(record)

    times = {"Ctrl-C": 1, "Ctrl-C three times": 3}.get(fault.name, 0)
    title = f"{number} {case.simulator} {fault.name}"
    experiment = Experiment(case, Falling(fault.name))
    repeater = Repeater(experiment, LocalExecutor(1), Silent(), keep)  # type: ignore[arg-type]
    try:
        with ctrl_c(times, rng.uniform(0.5, 6.0)):
            repeater.run([number])
        tally.check(not times, f"{title}: Ctrl-C got lost")
    except KeyboardInterrupt:
        tally.check(bool(times), f"{title}: an interrupt came from nowhere")
    tally.lost += len(kept) != 1
    tally.check(len(kept) == 1, f"{title}: {len(kept)} records")
    for record in kept[:1]:
        error = record.error
        found = (record.status, error.type if error else "", error.phase if error else "")
        wanted = (fault.status, fault.cause[0], found[2] if fault.phase is None else fault.phase)
        if fault.status == "ok":
            wanted = ("ok", "", "")
        message = error.message if error else ""
        tally.check(found == wanted, f"{title}: {found} instead of {wanted}: {message[:300]}")
        tally.check(fault.cause[1] in message, f"{title}: the message is {message[:300]!r}")
        tally.check(len(message) < 3000, f"{title}: a message of {len(message)} characters")
        tally.check(record.seed == case.seed + number - 1, f"{title}: seed {record.seed}")
        tally.truth[case.simulator, case.mode, fault.status] += 1


PYTEST = """
from chaos import Falling
def test_falling(repeat):
    repeat(Falling("Ctrl-C"))
"""


def killed(engine: str, number: int, title: str, rng: random.Random, tally: Tally) -> None:
    """A pytest of its own, killed at a random moment of its second repetition or before."""
    folder, mark = Path(tempfile.mkdtemp(prefix="simbench-chaos-")), uuid.uuid4().hex
    (folder / "test_chaos.py").write_text(PYTEST.replace('"Ctrl-C"', '""'))
    environment = {**os.environ, "CHAOS_RUN": mark, "PYTHONPATH": str(Path(__file__).parent)}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--sim={engine}"]
    program = subprocess.Popen(
        [*command, "--reps=50", "--sim-output=out"],
        cwd=folder,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    time.sleep(rng.uniform(0.5, 12.0))
    tally.check(program.poll() is None, f"{title}: pytest ended by itself")
    os.killpg(program.pid, number)
    program.wait()
    tally.check(not left("CHAOS_RUN", mark, 5.0, tally), f"{title}: processes were left behind")
    records = folder / "out" / "records.jsonl"
    if records.is_file():
        reading = RunFolder.of(records).read()
        numbers = [record.repetition for record in reading.records]
        tally.check(numbers == list(range(1, len(numbers) + 1)), f"{title}: records {numbers}")
        tally.check(all(r.ok for r in reading.records), f"{title}: a record is not ok")
    shutil.rmtree(folder, ignore_errors=True)


def left(variable: str, value: str, patience: float, tally: Tally) -> int:
    """How many processes with this in their environment are still there after a while [s]."""
    until = time.monotonic() + patience
    while True:
        found = []
        for process in psutil.process_iter():
            with suppress(psutil.Error):
                if process.environ().get(variable, "").startswith(value):
                    found.append(process)
        if not found or time.monotonic() > until:
            break
        time.sleep(0.1)
    for process in found:
        print("    LEFT:", process, flush=True)
        process.kill()
    tally.orphans += len(found)
    return len(found)


def check_tables(folder: Path, tally: Tally) -> None:
    """The table's counts are those of what happened."""
    reading = RunFolder(folder).read()
    tally.check(not reading.problems, f"records: {reading.problems}")
    tally.check(len(reading.records) == tally.truth.total(), f"{len(reading.records)} records")
    (summary,) = summarise(reading.records, {"falling": Falling().metrics})
    found: Counter[tuple[str, str, str]] = Counter()
    for row in summary.rows:  # one a configuration: each fault has an adapter with its settings
        counts = {"ok": row.finished, "failed": row.failed, "interrupted": row.interrupted}
        for status, count in counts.items():
            found[row.simulator, row.mode, status] += count
    for key in sorted(found | tally.truth):
        print(f"{' '.join(key)}: {found[key]}")
        told = f"the table says {found[key]} of {' '.join(key)}, not {tally.truth[key]}"
        tally.check(found[key] == tally.truth[key], told)


def main(repetitions: str = "300", seed: str = "1") -> int:
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's & leaves it ignored
    rng, tally, displays = random.Random(int(seed)), Tally(), Displays()
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        os.environ.pop(name, None)
    folder = Path(tempfile.mkdtemp(prefix="simbench-chaos-"))
    count = int(repetitions)
    plan = [FAULTS[k % len(FAULTS)] for k in range(count)]
    rng.shuffle(plan)
    run = reaper.new_mark().partition(".")[0]
    began = time.monotonic()
    for number, fault in enumerate(plan, start=1):
        window = fault.name == "display killed"
        engine = rng.choice(WINDOWS if window else list(ADAPTERS))
        title = f"{number} {engine} {fault.name}"
        print(title, flush=True)
        started = time.monotonic()
        if fault.name in OF_PYTEST:
            killed(engine, OF_PYTEST[fault.name], title, rng, tally)
        else:
            case = Case(
                "chaos::test_falling",
                engine,
                "gui" if window else "headless",
                "tuned",
                f"chaos_faults:{engine}",
                folder,
                environment={"CHAOS": fault.name, "CHAOS_AT": str(rng.uniform(0.0, 0.5))},
                display=displays if window else None,
                timeout=TIMEOUT,
                stall_timeout=WINDOW_STALL if window else STALL,
                memory_limit=MEMORY if fault.name == "memory up to the limit" else None,
            )
            one(case, fault, number, rng, tally)
        displays.close()
        took = time.monotonic() - started
        tally.seconds.append((took, title))
        tally.check(took < TIMEOUT + SLACK, f"{title}: {took:.1f} s")
        reaper_only = left(reaper.VARIABLE, f"{run}.", 0.0, tally)
        tally.check(not reaper_only, f"{title}: processes were left behind")
    check_tables(folder, tally)
    longest, title = max(tally.seconds)
    print(
        f"{count} repetitions with {len(FAULTS)} kinds of fault on {len(ADAPTERS)} engines in "
        f"{(time.monotonic() - began) / 60:.0f} min: {tally.lost} records lost, {tally.orphans} "
        f"processes left behind, longest {longest:.1f} s ({title}; limits {STALL:g} s of silence, "
        f"{TIMEOUT:g} s in all), {len(tally.wrong)} things wrong, {threading.active_count()} "
        f"threads and {psutil.Process().num_fds()} open files at the end"
    )
    print(*tally.wrong, sep="\n")
    shutil.rmtree(folder, ignore_errors=True)
    return 1 if tally.wrong else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
