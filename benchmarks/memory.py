"""Memory, threads and open files of the pytest process over many repetitions.

    python benchmarks/memory.py [REPETITIONS]

Bound: flat. Each repetition lets two cubes fall for a tenth of a second on MuJoCo.
"""

from __future__ import annotations

import tempfile
import threading
from pathlib import Path

import psutil
from common import arguments, case

from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from tests.tiny import Falling

if __name__ == "__main__":
    last = arguments(__doc__, {"repetitions": 200}).repetitions
    me = psutil.Process()
    with tempfile.TemporaryDirectory() as name:
        experiment = Experiment(case("mujoco", Path(name)), Falling(0.1))
        for number in range(1, last + 1):
            Repetition(experiment, number).run()
            if number in (1, 20, 50, 100, 150, 200, last):
                memory = me.memory_info().rss / 1e6
                print(
                    f"after {number:3d}: {memory:.1f} MB, {threading.active_count()} threads, "
                    f"{me.num_fds()} open files",
                    flush=True,
                )
