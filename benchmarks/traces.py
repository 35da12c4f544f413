"""What keeping the motion of repetitions costs: CPU time beside the stepping's, and file size.

    python benchmarks/traces.py [SIMULATOR...]

Without names: every simulator of this environment. Sampling: what one sample of the stacking scene
takes in a bare loop, 50 times a simulated second, against stepping. Keeping: what joining, packing
and writing take in pytest's process, of the longest trace, one whole stacking (all 15 cubes, in
the first simulator). All in CPU seconds, since machines are shared.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from pathlib import Path

from stepping import loop, motion

from pytest_simbench.client.environments import missing
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import TRACE_PERIOD, Repetition
from pytest_simbench.recordings.trace import FOLDER, Trace
from pytest_simbench.simulator.registry import adapter, registered
from pytest_simbench.tasks import Stacking

SAMPLES, RUNS = 500, 5


class Timed(Repetition):
    """Takes the CPU time of keeping the trace."""

    keeping = 0.0

    def _write_trace(self, *, failed: bool) -> str:
        began = time.process_time()
        found = super()._write_trace(failed=failed)
        self.keeping = time.process_time() - began
        return found


def sampling(name: str) -> float:
    """CPU seconds of sampling over those of stepping."""
    found = []
    for _ in range(RUNS):
        sample, stepping = loop(name, samples=SAMPLES)
        found.append(sample * motion().duration / TRACE_PERIOD / stepping)
    return statistics.median(found)


def keeping(name: str) -> None:
    """One whole stacking, and what its trace cost."""
    with tempfile.TemporaryDirectory() as folder:
        case = Case.of(
            name, test="t", mode="headless", profile="tuned", folder=Path(folder), trace="on"
        )
        repetition = Timed(Experiment(case, Stacking()), 1)
        record, error = repetition.run()
        if error is not None:
            raise error
        (path,) = (Path(folder) / FOLDER).iterdir()
        trace = Trace.read(path)
        stepping = record.stepping["cpu"]
        print(
            f"{name}, a whole stacking: {trace.time[-1]:.0f} s in {len(trace.time)} samples of "
            f"{len(trace.free)} cubes, {path.stat().st_size / 1e6:.2f} MB; keeping it "
            f"{repetition.keeping:.3f} s, {100 * repetition.keeping / stepping:.2f} % of stepping"
        )


def main(names: list[str]) -> None:
    names = names or [n for n in registered() if not missing(adapter(n).info)]
    for name in names:
        print(f"{name}: sampling {100 * sampling(name):.2f} % of stepping", flush=True)
    keeping(names[0])


if __name__ == "__main__":
    main(sys.argv[1:])
