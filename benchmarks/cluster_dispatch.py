"""What a cluster costs a repetition beside its work: 10,000 empty jobs on two nodes here.

    python benchmarks/cluster_dispatch.py [--jobs 10000] [--robot xarm7]

All but the simulator is real: the repeater's threads, a slot for each job, the job packed and sent,
a whole record sent back, read and written. Memory of this process is looked at on the way.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import psutil

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

from pytest_simbench.cluster.executor import ClusterExecutor  # noqa: E402
from pytest_simbench.cluster.pool import Pool  # noqa: E402
from pytest_simbench.experiment.case import Case  # noqa: E402
from pytest_simbench.experiment.experiment import Experiment  # noqa: E402
from pytest_simbench.experiment.repeater import Repeater  # noqa: E402
from pytest_simbench.records.folder import RunFolder  # noqa: E402
from pytest_simbench.records.record import Record  # noqa: E402
from pytest_simbench.report.terminal.progress import Progress  # noqa: E402
from pytest_simbench.robot.registry import find  # noqa: E402
from pytest_simbench.tasks import Stacking  # noqa: E402
from tests.cluster.machines import Machines  # noqa: E402

REAL = ROOT / "tests" / "measure" / "stacking_records.jsonl"
"""Real records, for their size."""


def empty(line: str, job: Any, number: int) -> dict[str, Any]:
    """What a node does instead of `cluster.node.run`."""
    return {"record": line, "error": None, "log": b"x" * 500, "trace": None}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=10_000)
    parser.add_argument("--robot", help="whose files go to the nodes; the Panda is there")
    given = parser.parse_args()
    jobs = given.jobs
    process = psutil.Process()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with Machines(folder) as machines:
            machines.wait("head")
            for node in "ab":
                machines.node(node, "--sim", "mujoco", "--slots", "8")
            machines.wait()
            case = Case.of("mujoco", test="t[m]", mode="headless", profile="tuned", folder=folder)
            if given.robot:
                case = replace(case, robot=find(given.robot))
            experiment = Experiment(case, Stacking())
            run = RunFolder(folder)
            run.lock()
            pool = Pool(machines.address)
            pool.call = partial(empty, REAL.read_text().splitlines()[0])
            memory: list[tuple[int, float]] = []

            def keep(record: Record) -> None:
                run.append(replace(record, repetition=len(run.own) + 1))
                if len(run.own) % (jobs // 5) == 0:
                    memory.append((len(run.own), process.memory_info().rss / 1e6))

            progress = Progress(lambda text: None, is_tty=True)
            began, cpu = time.monotonic(), time.process_time()
            Repeater(experiment, ClusterExecutor(pool), progress, keep).run(range(1, jobs + 1))
            wall, cpu = time.monotonic() - began, time.process_time() - cpu
            print(f"{jobs} jobs: {1e3 * wall / jobs:.2f} ms each, {1e3 * cpu / jobs:.2f} ms of CPU")
            print("MB of memory:", ", ".join(f"{n}: {mb:.0f}" for n, mb in memory))
            pool.close()
            run.close()


if __name__ == "__main__":
    main()
