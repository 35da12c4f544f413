"""What keeping the motion of repetitions costs: CPU time beside the stepping's, and file size.

    python benchmarks/traces.py [SIMULATOR...]

Without names: every simulator of this environment. Sampling: what one sample of the stacking scene
takes in a bare loop, 50 times a simulated second, against stepping. In case of a failure: 10 times
a simulated second, less the look at the state that the worker takes as often anyway. Keeping: what
joining, packing and writing take in pytest's process, of the longest trace, one whole stacking (all
15 cubes, in the first simulator). All in CPU seconds, since machines are shared.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from pathlib import Path

from stepping import loop, motion

from pytest_simbench.client.environments import missing
from pytest_simbench.client.world import TRACE_PERIOD
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.recordings.trace import FOLDER, Trace
from pytest_simbench.simulator.registry import adapter, registered
from pytest_simbench.tasks import Stacking
from pytest_simbench.worker.stepping import CHECK_PERIOD

SAMPLES, RUNS = 500, 5


class Timed(Repetition):
    """Takes the CPU time of keeping the trace."""

    keeping = 0.0

    def _write_trace(self, *, failed: bool) -> str:
        began = time.process_time()
        found = super()._write_trace(failed=failed)
        self.keeping = time.process_time() - began
        return found


def sampling(name: str) -> tuple[float, float, float]:
    """CPU seconds of sampling over those of stepping: of a repetition that is kept in any case, and
    of one that is kept if it fails; and CPU seconds of one sample."""
    first, other, samples = [], [], []
    for _ in range(RUNS):
        sample, look, stepping = loop(name, samples=SAMPLES)
        first.append(sample * motion().duration / TRACE_PERIOD / stepping)
        other.append((sample - look) * motion().duration / CHECK_PERIOD / stepping)
        samples.append(sample)
    return statistics.median(first), statistics.median(other), statistics.median(samples)


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
        first, other, sample = sampling(name)
        print(
            f"{name}: a sample {1e6 * sample:.0f} us; sampling {100 * first:.2f} % of stepping, in "
            f"case of a failure {100 * other:.2f} %",
            flush=True,
        )
    keeping(names[0])


if __name__ == "__main__":
    main(sys.argv[1:])
