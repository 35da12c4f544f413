"""How much of a stacking repetition is not stepping: launch, load, plan, messages, records.

python benchmarks/overhead.py mujoco 3
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.tasks import Stacking


def main(name: str = "mujoco", repetitions: str = "3") -> None:
    folder = Path(tempfile.mkdtemp())
    case = Case.of(name, test="overhead", mode="headless", profile="tuned", folder=folder)
    for number in range(1, int(repetitions) + 1):
        record, error = Repetition(Experiment(case, Stacking()), number).run()
        if error is not None:
            raise error
        seconds = record.seconds
        share = 100 * (1 - seconds["step"] / seconds["total"])
        parts = ", ".join(f"{key} {value:.2f} s" for key, value in seconds.items())
        print(f"{name} seed {record.seed}: {share:.1f} % is not stepping ({parts})")


if __name__ == "__main__":
    main(*sys.argv[1:])
