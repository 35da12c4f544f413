"""Find the numbers of a controller on one engine, by the cross-entropy method.

    python -m pytest_simbench.suites.policies.train pushing --sim mujoco --seed 0

Each generation draws sets of numbers around the mean, lets each act on the same episodes, and goes
on with mean and spread of the best. Episodes have seeds from `FIRST` on; none is published.
"""

from __future__ import annotations

import argparse
import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np
from pytest_simbench.suites.policies.picking import Pick
from pytest_simbench.suites.policies.pushing import Push
from pytest_simbench.suites.test_transfer import TASKS

from pytest_simbench.client.errors import Where, WorkerError
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.motion.kinematics import Servo
from pytest_simbench.tasks import Jitter

FIRST = 900_000
"""Seed of the first episode of the first training; each training has ten thousand of its own."""

BEST = 4
"""Sets of numbers of a generation that the next one is drawn from."""


class Engine:
    """One engine in one worker; one that died is replaced."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.process: WorkerProcess | None = None

    def outcome(self, policy, seed: int) -> tuple[float, float]:
        """Success, and the distance from the goal [m], of one episode."""
        task = TASKS[policy.task](policy)
        if self.process is None or not self.process.alive:
            where = Where(self.case.simulator, self.case.mode)
            self.process = WorkerProcess(self.case.launch("train"), where)
        try:
            self.process.construct(self.case.profile)
            world = World(self.process, task.scene(seed, Jitter()), kinematics=Servo)
            found = task.perform(world, seed, lambda done, of: None).metrics
        except WorkerError:
            self.close()
            return 0.0, 1.0
        return found["success"], found["distance"]

    def close(self) -> None:
        if self.process is not None:
            self.process.kill()


def score(engine: Engine, policy, seeds) -> tuple[float, float]:
    """Share of successes, and what is improved: that, less the mean distance in decimetres."""
    found = np.array([engine.outcome(policy, seed) for seed in seeds])
    success, distance = found.mean(axis=0)
    return float(success), float(success - 10 * min(distance, 0.2))


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("task", choices=("pushing", "picking"))
    parser.add_argument("--sim", required=True)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--population", type=int, default=16)
    parser.add_argument("--generations", type=int, default=8)
    parser.add_argument("--episodes", type=int, default=8)
    chosen = parser.parse_args(arguments)
    controller = {"pushing": Push, "picking": Pick}[chosen.task]
    name, rng = f"{chosen.sim}-{chosen.seed}", np.random.default_rng(chosen.seed)
    low, high = np.array(list(controller.bounds.values())).T
    mean, spread = (low + high) / 2, (high - low) / 3
    first = FIRST + 10_000 * chosen.seed
    with tempfile.TemporaryDirectory() as folder:
        case = Case.of(chosen.sim, test="train", mode="headless", profile="tuned",
                       folder=Path(folder))  # fmt: skip
        with closing(Engine(case)) as engine:
            for generation in range(chosen.generations):
                drawn = rng.normal(mean, spread, (chosen.population, len(mean)))
                drawn = np.clip(drawn, low, high)
                seeds = range(first, first + chosen.episodes)
                first = seeds.stop
                found = []
                for row in drawn:
                    found.append(score(engine, controller(name, map(float, row)), seeds))
                best = np.argsort([-value for _, value in found])[:BEST]
                mean, spread = drawn[best].mean(axis=0), drawn[best].std(axis=0)
                spread = np.maximum(spread, 0.02 * (high - low))
                successes = [found[number][0] for number in best]
                print(f"{name} generation {generation + 1}: best {np.round(successes, 2)}, mean of "
                      f"all {np.mean([one for one, _ in found]):.2f}", flush=True)  # fmt: skip
    print(f'"numbers": ({", ".join(f"{number:.4g}" for number in mean)}),')


if __name__ == "__main__":
    main()
