"""Whether a wait that may end early (`tasks.waiting`) changes a count, and what it saves.

    python benchmarks/waits.py [SIMULATOR] [REPETITIONS] [--task stacking] [--profile default]

Bound: every count is the same as after the full wait of the same seed, from 400001 on. CPU seconds
are of the worker and this process.
"""

from __future__ import annotations

import os
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from common import arguments, case, spread

from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.tasks import Stacking, Throwing

if __name__ == "__main__":
    words = {"simulator": "mujoco", "repetitions": 3}
    given = arguments(__doc__, words, task="throwing", profile="tuned")
    task = Stacking() if given.task == "stacking" else Throwing()
    counts = [m.name for m in task.metrics if m.bounded or m.unit in ("cubes", "picks")]
    changed, waited, cost = 0, [], {True: [], False: []}
    with tempfile.TemporaryDirectory() as name:
        run = replace(case(given.simulator, Path(name), seed=400001), profile=given.profile)
        for number in range(1, given.repetitions + 1):
            found = {}
            for full in (True, False):
                began = sum(os.times()[:4])
                experiment = Experiment(run, replace(task, full_wait=full))
                found[full], _ = Repetition(experiment, number).run()
                cost[full].append(sum(os.times()[:4]) - began)
            whole, short = (
                [found[f].status, *map(found[f].metrics.get, counts)] for f in (True, False)
            )
            changed += whole != short
            wait = found[False].notes.wait
            told = f"{wait.seconds:.0f} s, {wait.bound or 'in full'}" if wait else "crashed"
            print(f"{number:3}: {told}{', COUNTS DIFFER' if whole != short else ''}", flush=True)
            waited += [wait.seconds] if wait else []
    for full, what in ((True, "in full"), (False, "as short as may be")):
        print(f"CPU seconds, {what}: {spread(cost[full], '.2f')}")
    print(f"waited {spread(waited or [0.0], '.0f')} s; counts differ in {changed} repetitions")
    sys.exit(changed > 0)
