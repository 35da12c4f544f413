"""What a cluster costs a repetition beside its work: empty jobs on two nodes here.

    python benchmarks/cluster_dispatch.py [--jobs 10000] [--robot xarm7]

All but the simulator is real: the repeater's threads, a slot for each job, the job packed and sent,
a whole record sent back, read and written. The files of `--robot` go to the nodes too. Memory of
this process is looked at on the way.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import psutil
from common import REAL, arguments, case

from pytest_simbench.cluster.executor import ClusterExecutor
from pytest_simbench.cluster.pool import Pool
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repeater import Repeater
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.record import Record
from pytest_simbench.report.progress import Progress
from pytest_simbench.robot.registry import find
from pytest_simbench.tasks import Stacking
from tests.cluster.machines import Machines


def empty(line: str, job: Any, number: int) -> dict[str, Any]:
    """What a node does instead of `cluster.node.run`."""
    return {"record": line, "error": None, "log": b"x" * 500, "trace": None}


def main() -> None:
    given = arguments(__doc__, {}, jobs=10_000, robot="")
    with tempfile.TemporaryDirectory() as name, Machines(Path(name)) as machines:
        machines.wait("head")
        for node in "ab":
            machines.node(node, "--sim", "mujoco", "--slots", "8")
        machines.wait()
        robot = find(given.robot) if given.robot else None
        experiment = Experiment(case("mujoco", Path(name), robot=robot), Stacking())
        run = RunFolder(Path(name))
        run.lock()
        pool = Pool(machines.address)
        pool.call = partial(empty, REAL.read_text().splitlines()[0])
        memory: dict[int, int] = {}

        def keep(record: Record) -> None:
            run.append(replace(record, repetition=len(run.own) + 1))
            if len(run.own) % (given.jobs // 5) == 0:
                memory[len(run.own)] = round(psutil.Process().memory_info().rss / 1e6)

        repeater = Repeater(
            experiment, ClusterExecutor(pool), Progress(lambda text: None, is_tty=True), keep
        )
        began, cpu = time.monotonic(), time.process_time()
        repeater.run(range(1, given.jobs + 1))
        wall, cpu = (1e3 * (time.monotonic() - began), 1e3 * (time.process_time() - cpu))
        print(f"each job: {wall / given.jobs:.2f} ms, {cpu / given.jobs:.2f} ms of CPU here")
        print("MB of memory, by jobs:", memory)
        pool.close()
        run.close()


if __name__ == "__main__":
    main()
