"""Memory, threads and open files of the pytest process over many repetitions.

python benchmarks/memory.py 200
"""

from __future__ import annotations

import sys
import tempfile
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import psutil

from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.tasks.base import Count, Jitter, Outcome, Task, cube


@dataclass(frozen=True)
class Falling(Task):
    """A cube falls for a tenth of a second."""

    name: ClassVar[str] = "falling"
    study_timeout: ClassVar[float] = 60.0

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return ()

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        return Scene("falling", (cube("cube", Pose.at(0, 0, 0.1), (1, 1, 1, 1)),))

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        world.wait(0.1)
        return Outcome()


def main(repetitions: str = "200") -> None:
    folder = Path(tempfile.mkdtemp())
    case = Case.of("mujoco", test="memory", mode="headless", profile="tuned", folder=folder)
    me = psutil.Process()
    for number in range(1, int(repetitions) + 1):
        Repetition(Experiment(case, Falling()), number).run()
        if number in (1, 20, 50, 100, 150, 200) or number == int(repetitions):
            print(
                f"after {number:3d}: {me.memory_info().rss / 1e6:.1f} MB, "
                f"{threading.active_count()} threads, {me.num_fds()} open files",
                flush=True,
            )


if __name__ == "__main__":
    main(*sys.argv[1:])
