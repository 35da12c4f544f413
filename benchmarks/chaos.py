"""Faults of every kind at random moments, on real engines: what is lost, left behind, or hangs?

    python benchmarks/chaos.py [REPETITIONS] [SEED]

Each repetition is a tiny task on one of four engines with one fault, drawn at random, of those in
chaos_faults.py; what happens in the run (Ctrl-C, killed pytest, killed display) is done here. Told
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
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar
from unittest.mock import Mock

import numpy as np
import psutil
from chaos_faults import ENGINES, FAULTS
from common import arguments, case

from pytest_simbench.client import reaper
from pytest_simbench.client.display import Displays
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repeater import Repeater
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.record import Record
from pytest_simbench.report.model.summary import summarise
from pytest_simbench.tasks.base import Count, Outcome
from tests import tiny

STALL, WINDOW_STALL, TIMEOUT, MEMORY = 5.0, 12.0, 15.0, 200.0
"""Limits of every repetition: silence [s], the same with a window, which takes seconds to open with
software rendering, time from launch [s], memory [MB]."""

SLACK = 15.0
"""Wall time beyond the limits for noticing, closing (10 s at most) and recording [s]."""

ANYWHERE = ("", "ProtocolError", "OutOfMemory", "DisplayLost", "KeyboardInterrupt")
"""Causes that may be seen in any phase; all others in that of the motion."""

OF_PYTEST = {"SIGKILL of pytest": signal.SIGKILL, "SIGTERM of pytest": signal.SIGTERM}
CTRL_C = {"Ctrl-C": 1, "Ctrl-C three times": 3}
WINDOWS = ("mujoco", "pybullet", "dart")
"""Engines whose window needs nothing but a display."""

WRONG: list[str] = []
TRUTH: Counter[tuple[str, str, str]] = Counter()
"""What the tables have to tell: simulator, mode and status."""


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


def check(fine: bool, sentence: str) -> None:
    if not fine:
        WRONG.append(sentence)
        print(f"    WRONG: {sentence}", flush=True)


def interrupt(times: int) -> None:
    """Interrupt the main thread, once or more."""
    for _ in range(times):
        _thread.interrupt_main()
        time.sleep(0.01)


def one(case: Case, name: str, number: int, title: str, moment: float) -> None:
    """One repetition with one fault, in this process; Ctrl-C comes at a moment [s]."""
    kept: list[Record] = []
    folder, fault, times = RunFolder(case.folder), FAULTS[name], CTRL_C.get(name, 0)

    def keep(record: Record) -> None:
        kept.append(record)
        folder.append(record)

    experiment = Experiment(case, Falling(fault=name))
    folder.describe(experiment.task)
    repeater = Repeater(experiment, LocalExecutor(1), Mock(), keep)  # progress is not watched
    thread = threading.Timer(moment if times else 0.0, interrupt, (times,))
    try:
        thread.start()
        repeater.run([number])
        thread.join()
        check(not times, f"{title}: Ctrl-C got lost")
    except KeyboardInterrupt:
        check(bool(times), f"{title}: an interrupt came from nowhere")
    check(len(kept) == 1, f"{title}: {len(kept)} records")
    for record in kept[:1]:
        error = record.error
        cause, message, phase = (error.type, error.message, error.phase) if error else [""] * 3
        found = record.status, cause
        check(found == (fault.status, fault.cause[0]), f"{title}: {found}: {message[:300]}")
        check(fault.cause[1] in message, f"{title}: the message is {message[:300]!r}")
        check(len(message) < 3000, f"{title}: a message of {len(message)} characters")
        check(phase == "fall" or cause in ANYWHERE, f"{title}: in the phase {phase}")
        check(record.seed == case.seed + number - 1, f"{title}: seed {record.seed}")
        TRUTH[case.simulator, case.mode, fault.status] += 1


PYTEST = """
from chaos import Falling
def test_falling(repeat):
    repeat(Falling())
"""


def killed(engine: str, number: int, title: str, moment: float) -> None:
    """A pytest of its own, killed at a moment [s] of its second repetition or before."""
    folder = Path(tempfile.mkdtemp(prefix="simbench-chaos-"))
    (folder / "test_chaos.py").write_text(PYTEST)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--sim={engine}"]
    command += ["--reps=50", "--sim-output=out"]
    marked = {**os.environ, "CHAOS_RUN": folder.name, "PYTHONPATH": str(Path(__file__).parent)}
    quiet: Any = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    program = subprocess.Popen(command, cwd=folder, env=marked, start_new_session=True, **quiet)
    time.sleep(moment)
    check(program.poll() is None, f"{title}: pytest ended by itself")
    with suppress(ProcessLookupError):
        os.killpg(program.pid, number)
    program.wait()
    none_left("CHAOS_RUN", folder.name, 5.0, title)
    if (folder / "out" / "records.jsonl").is_file():
        records = RunFolder(folder / "out").read().records
        numbers = [record.repetition for record in records]
        check(numbers == list(range(1, len(numbers) + 1)), f"{title}: records {numbers}")
        check(all(record.ok for record in records), f"{title}: a record is not ok")
    shutil.rmtree(folder, ignore_errors=True)


def none_left(variable: str, value: str, patience: float, title: str) -> None:
    """After a while [s], no process with this in its environment is there; else it is ended."""
    until = time.monotonic() + patience
    while True:
        environments = {p: p.info["environ"] or {} for p in psutil.process_iter(["environ"])}
        found = [p for p, env in environments.items() if env.get(variable, "").startswith(value)]
        if not found or time.monotonic() > until:
            break
        time.sleep(0.1)
    for process in found:
        check(False, f"{title}: {process} was left behind")
        process.kill()


def check_tables(folder: Path) -> None:
    """The table's counts are those of what happened."""
    reading, found = RunFolder(folder).read(), Counter[tuple[str, str, str]]()
    check(not reading.problems, f"records: {reading.problems}")
    check(len(reading.records) == TRUTH.total(), f"{len(reading.records)} records")
    for row in (
        row
        for summary in summarise(reading.records, reading.metrics, reading.references)
        for row in summary.rows
    ):
        counts = {"ok": row.finished, "failed": row.failed, "interrupted": row.interrupted}
        for status, count in counts.items():  # each fault has a row, as it has an adapter
            found[row.simulator, row.mode, status] += count
    print(*(f"{' '.join(key)}: {count}" for key, count in sorted(found.items())), sep="\n")
    check(+found == TRUTH, f"the tables tell that instead of {sorted(TRUTH.items())}")


def main() -> None:
    given = arguments(__doc__, {"repetitions": 300, "seed": 1})
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's & leaves it ignored
    rng, displays, longest = random.Random(given.seed), Displays(), (0.0, "")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        os.environ.pop(name, None)
    folder = Path(tempfile.mkdtemp(prefix="simbench-chaos-"))
    plan = [list(FAULTS)[k % len(FAULTS)] for k in range(given.repetitions)]
    rng.shuffle(plan)
    run, began = reaper.new_mark().partition(".")[0], time.monotonic()
    for number, name in enumerate(plan, start=1):
        window, started = name == "display killed", time.monotonic()
        engine = rng.choice(WINDOWS if window else ENGINES)
        title = f"{number} {engine} {name}"
        print(title, flush=True)
        if name in OF_PYTEST:
            killed(engine, OF_PYTEST[name], title, rng.uniform(0.5, 12.0))
        else:
            faulty = replace(
                case(engine, folder, timeout=TIMEOUT),
                mode="gui" if window else "headless",
                adapter=f"chaos_faults:{engine}",
                environment={"CHAOS": name, "CHAOS_AT": str(rng.uniform(0.0, 0.5))},
                display=displays if window else None,
                stall_timeout=WINDOW_STALL if window else STALL,
                memory_limit=MEMORY if name == "memory up to the limit" else None,
            )
            one(faulty, name, number, title, rng.uniform(0.5, 6.0))
        displays.close()
        longest = max(longest, (time.monotonic() - started, title))
        none_left(reaper.VARIABLE, f"{run}.", 0.0, title)
    check(longest[0] < TIMEOUT + SLACK, f"{longest[1]}: {longest[0]:.1f} s")
    check_tables(folder)
    print(
        f"{len(plan)} repetitions with {len(FAULTS)} kinds of fault on {len(ENGINES)} engines in "
        f"{(time.monotonic() - began) / 60:.0f} min: longest {longest[0]:.1f} s ({longest[1]}; "
        f"limits {STALL:g} s of silence, {TIMEOUT:g} s in all), {len(WRONG)} things wrong, "
        f"{threading.active_count()} threads and {psutil.Process().num_fds()} open files at the end"
    )
    shutil.rmtree(folder, ignore_errors=True)
    if WRONG:
        raise SystemExit("\n".join(WRONG))


if __name__ == "__main__":
    main()
