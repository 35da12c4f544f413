"""What a repetition costs beside its stepping, and whether this process grows with repetitions.

    python benchmarks/overhead.py [SIMULATOR] [REPETITIONS]
    python benchmarks/overhead.py mujoco 200 --task falling

Bounds: under 15 % of a MuJoCo stacking is launch, load, plan, messages and records; memory, threads
and open files are flat, best seen of two cubes that fall for a tenth of a second.
"""

from __future__ import annotations

import tempfile
import threading
from pathlib import Path

import psutil
from common import arguments, case

from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.tasks import Stacking
from tests.tiny import Falling

if __name__ == "__main__":
    given = arguments(__doc__, {"simulator": "mujoco", "repetitions": 3}, task="stacking")
    me, task = psutil.Process(), Falling(0.1) if given.task == "falling" else Stacking()
    with tempfile.TemporaryDirectory() as name:
        experiment = Experiment(case(given.simulator, Path(name)), task)
        for number in range(1, given.repetitions + 1):
            record, error = Repetition(experiment, number).run()
            if error is not None:
                raise error
            share = 100 * (1 - record.seconds["step"] / record.seconds["total"])
            parts = ", ".join(f"{key} {value:.2f} s" for key, value in record.seconds.items())
            print(
                f"{number:3}: {share:.1f} % is not stepping ({parts}); "
                f"{me.memory_info().rss / 1e6:.1f} MB, {threading.active_count()} threads, "
                f"{me.num_fds()} open files",
                flush=True,
            )
