"""Faults of every kind at random moments, on real engines: what is lost, left behind, or hangs?

    python benchmarks/chaos.py [REPETITIONS] [SEED]

Each repetition is a tiny task on one of four engines with one fault, drawn at random; all faults
are in chaos_faults.py, what happens in the run (Ctrl-C, killed pytest, killed display) is done
here. Told at the end: records lost or with the wrong status, cause or seed; processes left behind;
repetitions that took longer than their limits allow; differences between the tables and the truth.
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
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np
import psutil
from chaos_faults import ADAPTERS, FAULTS, Fault
from common import arguments

from pytest_simbench.client import reaper
from pytest_simbench.client.display import Displays
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repeater import Repeater
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.record import Record
from pytest_simbench.report.files import summaries_of
from pytest_simbench.tasks.base import Count, Outcome
from tests import tiny

STALL, TIMEOUT, MEMORY = 5.0, 15.0, 200.0
"""Limits of every repetition: silence [s], time from launch [s], memory [MB]."""

WINDOW_STALL = 12.0
"""Where a window opens, which takes seconds with software rendering [s]."""

SLACK = 15.0
"""Wall time beyond the limits for noticing, closing (10 s at most) and recording [s]."""

ANYWHERE = ("", "ProtocolError", "OutOfMemory", "DisplayLost", "KeyboardInterrupt")
"""Causes that may be seen in any phase; all others in that of the motion."""

OF_PYTEST = {"SIGKILL of pytest": signal.SIGKILL, "SIGTERM of pytest": signal.SIGTERM}
CTRL_C = {"Ctrl-C": 1, "Ctrl-C three times": 3}
WINDOWS = ("mujoco", "pybullet", "dart")
"""Engines whose window needs nothing but a display."""


@dataclass(frozen=True)
class Falling(tiny.Falling):
    """Two cubes fall for 0.6 s; faults come at a random moment of the first 0.5 s."""

    study_timeout: ClassVar[float] = TIMEOUT

    fault: str = "none"

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        with world.phase("fall"):
            if FAULTS[self.fault].when == "later":  # and then send more than a pipe holds
                time.sleep(1.0)
                world.process.request("read_back", ballast=np.zeros(1_000_000))
            if self.fault == "display killed":
                for child in psutil.Process().children():
                    if child.name() == "Xvfb":
                        child.kill()
            if self.fault in (*CTRL_C, "slow"):
                world.wait(1e6)
        return super().perform(world, seed, count)


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


def interrupt(times: int, after: float) -> None:
    """Interrupt the main thread a moment from now, once or more."""
    time.sleep(after)
    for _ in range(times):
        _thread.interrupt_main()
        time.sleep(0.01)


def one(case: Case, name: str, number: int, rng: random.Random, tally: Tally) -> None:
    """One repetition with one fault, in this process."""
    kept: list[Record] = []
    folder, fault, title = RunFolder(case.folder), FAULTS[name], f"{number} {case.simulator} {name}"

    def keep(record: Record) -> None:
        kept.append(record)
        folder.append(record)

    experiment, times = Experiment(case, Falling(fault=name)), CTRL_C.get(name, 0)
    folder.describe(experiment.task)
    repeater = Repeater(experiment, LocalExecutor(1), Silent(), keep)  # type: ignore[arg-type]
    thread = threading.Thread(target=interrupt, args=(times, rng.uniform(0.5, 6.0)))
    try:
        if times:
            thread.start()
        repeater.run([number])
        if times:
            thread.join()
        tally.check(not times, f"{title}: Ctrl-C got lost")
    except KeyboardInterrupt:
        tally.check(bool(times), f"{title}: an interrupt came from nowhere")
    tally.lost += len(kept) != 1
    tally.check(len(kept) == 1, f"{title}: {len(kept)} records")
    for record in kept[:1]:
        check_record(record, fault, title, tally)
        tally.check(record.seed == case.seed + number - 1, f"{title}: seed {record.seed}")
        tally.truth[case.simulator, case.mode, fault.status] += 1


def check_record(record: Record, fault: Fault, title: str, tally: Tally) -> None:
    """Status, cause and phase are those of the fault."""
    error = record.error
    found = (record.status, error.type if error else "")
    message, phase = (error.message, error.phase) if error else ("", "")
    tally.check(found == (fault.status, fault.cause[0]), f"{title}: {found}: {message[:300]}")
    tally.check(fault.cause[1] in message, f"{title}: the message is {message[:300]!r}")
    tally.check(len(message) < 3000, f"{title}: a message of {len(message)} characters")
    tally.check(phase == "fall" or found[1] in ANYWHERE, f"{title}: in the phase {phase}")


PYTEST = """
from chaos import Falling
def test_falling(repeat):
    repeat(Falling())
"""


def killed(engine: str, number: int, title: str, rng: random.Random, tally: Tally) -> None:
    """A pytest of its own, killed at a random moment of its second repetition or before."""
    folder, mark = Path(tempfile.mkdtemp(prefix="simbench-chaos-")), uuid.uuid4().hex
    (folder / "test_chaos.py").write_text(PYTEST)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--sim={engine}"]
    program = subprocess.Popen(
        [*command, "--reps=50", "--sim-output=out"],
        cwd=folder,
        env={**os.environ, "CHAOS_RUN": mark, "PYTHONPATH": str(Path(__file__).parent)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    time.sleep(rng.uniform(0.5, 12.0))
    tally.check(program.poll() is None, f"{title}: pytest ended by itself")
    with suppress(ProcessLookupError):
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
    found: Counter[tuple[str, str, str]] = Counter()
    for row in (row for summary in summaries_of(reading) for row in summary.rows):
        counts = {"ok": row.finished, "failed": row.failed, "interrupted": row.interrupted}
        for status, count in counts.items():  # each fault has a row, as it has an adapter
            found[row.simulator, row.mode, status] += count
    for key in sorted(found | tally.truth):
        print(f"{' '.join(key)}: {found[key]}")
        told = f"the table says {found[key]} of {' '.join(key)}, not {tally.truth[key]}"
        tally.check(found[key] == tally.truth[key], told)


def main() -> int:
    given = arguments(__doc__, {"repetitions": 300, "seed": 1})
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's & leaves it ignored
    rng, tally, displays = random.Random(given.seed), Tally(), Displays()
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        os.environ.pop(name, None)
    folder = Path(tempfile.mkdtemp(prefix="simbench-chaos-"))
    plan = [list(FAULTS)[k % len(FAULTS)] for k in range(given.repetitions)]
    rng.shuffle(plan)
    run, began = reaper.new_mark().partition(".")[0], time.monotonic()
    for number, name in enumerate(plan, start=1):
        window, started = name == "display killed", time.monotonic()
        engine = rng.choice(WINDOWS if window else list(ADAPTERS))
        title = f"{number} {engine} {name}"
        print(title, flush=True)
        if name in OF_PYTEST:
            killed(engine, OF_PYTEST[name], title, rng, tally)
        else:
            case = Case(
                "chaos::test_falling",
                engine,
                "gui" if window else "headless",
                "tuned",
                f"chaos_faults:{engine}",
                folder,
                environment={"CHAOS": name, "CHAOS_AT": str(rng.uniform(0.0, 0.5))},
                display=displays if window else None,
                timeout=TIMEOUT,
                stall_timeout=WINDOW_STALL if window else STALL,
                memory_limit=MEMORY if name == "memory up to the limit" else None,
            )
            one(case, name, number, rng, tally)
        displays.close()
        took = time.monotonic() - started
        tally.seconds.append((took, title))
        tally.check(took < TIMEOUT + SLACK, f"{title}: {took:.1f} s")
        own = left(reaper.VARIABLE, f"{run}.", 0.0, tally)
        tally.check(not own, f"{title}: processes were left behind")
    check_tables(folder, tally)
    longest, title = max(tally.seconds)
    print(
        f"{len(plan)} repetitions with {len(FAULTS)} kinds of fault on {len(ADAPTERS)} engines in "
        f"{(time.monotonic() - began) / 60:.0f} min: {tally.lost} records lost, {tally.orphans} "
        f"processes left behind, longest {longest:.1f} s ({title}; limits {STALL:g} s of silence, "
        f"{TIMEOUT:g} s in all), {len(tally.wrong)} things wrong, {threading.active_count()} "
        f"threads and {psutil.Process().num_fds()} open files at the end"
    )
    print(*tally.wrong, sep="\n")
    shutil.rmtree(folder, ignore_errors=True)
    return 1 if tally.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
