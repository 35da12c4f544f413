"""Time of a step and of a plan over the number of cubes, from 21 to 210.

    python benchmarks/cubes.py [--sim mujoco,pybullet] [--figure docs/pictures/cubes.png]

The 21 cubes of the stacking task stand on its table, all others on the ground behind it, and the
Panda stands still. A step is an engine's own with its tuned settings, by the worker's clock of CPU
time, over half a simulated second; the least of three such times, each in a fresh process. A plan
is a way to above one of the cubes on the table: inverse kinematics of the grasps, collision checks,
search and timing. No engine has a part in it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

from pytest_simbench.client.stopwatch import Stopwatch  # noqa: E402
from pytest_simbench.client.world import World  # noqa: E402
from pytest_simbench.experiment.case import Case  # noqa: E402
from pytest_simbench.experiment.experiment import Experiment  # noqa: E402
from pytest_simbench.experiment.repetition import Repetition  # noqa: E402
from pytest_simbench.records.metrics import Metric  # noqa: E402
from pytest_simbench.scene import Pose, Scene  # noqa: E402
from pytest_simbench.tasks import Jitter, Outcome, Stacking, Task  # noqa: E402
from pytest_simbench.tasks.base import CUBE_SIZE, Count, cube  # noqa: E402
from pytest_simbench.tasks.manipulator import Manipulator, tool_over, top_down_grasps  # noqa: E402

NUMBERS = (21, 42, 84, 126, 168, 210)
ROW = 14
WHITE = (1.0, 1.0, 1.0, 1.0)
SIMULATED = 0.5
"""Seconds of stepping."""

PLANS = 12

ROUNDS = 3


def scene(number: int) -> Scene:
    """The scene of the stacking task with so many cubes."""
    found = Stacking().scene(1, Jitter(0.0))
    more = [
        cube(
            f"more_{k:03d}",
            Pose.at(1.3 + 0.1 * (k // ROW), 0.1 * (k % ROW - ROW / 2), CUBE_SIZE / 2),
            WHITE,
        )
        for k in range(number - 21)
    ]
    return replace(found, bodies=(*found.bodies, *more))


@dataclass(frozen=True)
class Standing(Task):
    """So many cubes stand."""

    name: ClassVar[str] = "standing"
    study_timeout: ClassVar[float] = 600.0
    cubes: int = 21

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (Metric("standing", "standing", kind="share", of=self.cubes),)

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        return scene(self.cubes)

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        world.mark("start")
        world.wait(SIMULATED)
        world.mark("end")
        return Outcome({"standing": 1.0})


class Still:
    """A world as the planner sees it, in which nothing moves."""

    time = 0.0

    def __init__(self, scene: Scene) -> None:
        self.scene, self.stopwatch = scene, Stopwatch()
        self._poses = {body.name: body.pose for body in scene.bodies if body.name != "table"}

    def poses(self) -> dict[str, Pose]:
        return self._poses

    def pose(self, name: str) -> Pose:
        return self._poses[name]


class Ideal(Manipulator):
    """An arm that is where it is told to be."""

    def follow(self, trajectory: Any, log_period: float = 0.0) -> Any:
        self.arm = np.array(trajectory.position[-1][: self.model.arm])


def step(name: str, number: int, folder: Path) -> float:
    """CPU time of a step [s]."""
    case = Case.of(name, test=f"cubes{number}", mode="headless", profile="tuned", folder=folder)
    found = []
    for repetition in range(ROUNDS):
        record, error = Repetition(Experiment(case, Standing(number)), repetition + 1).run()
        if error is not None:
            raise error
        found.append(float(record.stepping["cpu"] / record.stepping["steps"]))
    return min(found)


def plan(number: int) -> float:
    """CPU time of a plan [s]."""
    world: Any = Still(scene(number))
    arm = Ideal(world, np.random.default_rng(1))
    names = [f"cube_{k:02d}" for k in range(1, 22)][:PLANS]
    began = time.process_time()
    for name in names:
        pose = world.pose(name)
        tools = [tool_over(pose, grasp.yaw) for grasp in top_down_grasps(pose)]
        _, above = arm._plan_choice(tools, ignored=(name,))
        arm.go_to(above, speed=arm.speeds.free)
    return (time.process_time() - began) / len(names)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--sim", default="mujoco,pybullet,sapien,drake,dart")
    parser.add_argument("--figure", type=Path)
    given = parser.parse_args()
    plans = [plan(number) for number in NUMBERS]
    print("cubes:", *NUMBERS)
    print("plan, ms:", *(f"{1e3 * seconds:.1f}" for seconds in plans), flush=True)
    steps: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as name:
        for simulator in given.sim.split(","):
            steps[simulator] = [step(simulator, number, Path(name)) for number in NUMBERS]
            told = (f"{1e3 * seconds:.3f}" for seconds in steps[simulator])
            print(f"step of {simulator}, ms:", *told, flush=True)
    if given.figure:
        draw(plans, steps, given.figure)


def draw(plans: list[float], steps: dict[str, list[float]], path: Path) -> None:
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
    for name, seconds in steps.items():
        left.loglog(NUMBERS, [1e3 * s for s in seconds], "o-", label=name)
    left.set(xlabel="cubes", ylabel="CPU time of a step [ms]")
    left.legend()
    right.plot(NUMBERS, [1e3 * s for s in plans], "o-")
    right.set(xlabel="cubes", ylabel="CPU time of a plan [ms]", ylim=(0, None))
    for axes in (left, right):
        axes.set_xticks(NUMBERS, [str(n) for n in NUMBERS])
        axes.minorticks_off()
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
