"""How much of a stacking repetition is not stepping: launch, load, plan, messages, records.

    python benchmarks/overhead.py [SIMULATOR] [REPETITIONS]

Bound: under 15 % on MuJoCo.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from common import arguments, case

from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.tasks import Stacking

if __name__ == "__main__":
    given = arguments(__doc__, {"simulator": "mujoco", "repetitions": 3})
    with tempfile.TemporaryDirectory() as name:
        experiment = Experiment(case(given.simulator, Path(name)), Stacking())
        for number in range(1, given.repetitions + 1):
            record, error = Repetition(experiment, number).run()
            if error is not None:
                raise error
            seconds = record.seconds
            share = 100 * (1 - seconds["step"] / seconds["total"])
            parts = ", ".join(f"{key} {value:.2f} s" for key, value in seconds.items())
            print(f"seed {record.seed}: {share:.1f} % is not stepping ({parts})", flush=True)
