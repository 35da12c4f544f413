"""Experiments on small tasks, in workers that are ended with the test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import pytest

from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.records.metrics import Metric
from pytest_simbench.repeatability.episode import Episodes
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.tasks import Jitter, LeaningTowers
from pytest_simbench.tasks.base import Count, Outcome, Randomness, Task, cube
from tests.conftest import ADAPTERS

WHITE = (1.0, 1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Tumbling(Task):
    """Three cubes fall upon each other, edge first, in three waits."""

    name: ClassVar[str] = "tumbling"
    study_timeout: ClassVar[float] = 60.0

    metrics: ClassVar[tuple[Metric, ...]] = (  # type: ignore[assignment]
        Metric("left", "left", kind="share", of=3),
    )

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        rng = Randomness.of(seed).start
        cubes = [
            cube(
                f"cube_{n}",
                jitter.disturbed(Pose.at(0.02 * n, 0.01 * n, 0.1 + 0.09 * n, yaw=0.3 * n), rng),
                WHITE,
            )
            for n in range(3)
        ]
        return Scene("tumbling", tuple(cubes))

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        for phase, seconds in (("fall", 0.05), ("fly", 0.05), ("land", 1.5)):
            with world.phase(phase):
                world.wait(seconds)
        left = sum(pose.position[0] < 0.02 for pose in world.poses().values())
        return Outcome({"left": left / 3})


@pytest.fixture
def handle_of(case: Case) -> Iterator[Callable[..., SimulatorHandle]]:
    """Makes handles: of a simulator by name, or of an adapter in `wrong`."""
    made: list[SimulatorHandle] = []

    def make(name: str = "mujoco", mode: str = "headless") -> SimulatorHandle:
        adapter = ADAPTERS.get(name, f"tests.repeatability.wrong:{name}")
        made.append(SimulatorHandle(replace(case, simulator=name, adapter=adapter, mode=mode)))
        return made[-1]

    yield make
    for handle in made:
        handle.close()


def first_seed(
    handle: SimulatorHandle, task: Task, *, seed: int = 1, jitter: float = 1.0
) -> Episodes:
    """Episodes of a task in the case of a handle."""
    return Episodes(Experiment(replace(handle.case, seed=seed, jitter=jitter), task), handle)


@pytest.fixture
def towers(handle_of: Callable[..., SimulatorHandle]) -> Callable[..., Episodes]:
    """One leaning tower in a simulator."""

    task = LeaningTowers(margins=(0.008,), settle=1.5)
    return lambda name="mujoco": first_seed(handle_of(name), task)


@pytest.fixture
def tumbling(handle_of: Callable[..., SimulatorHandle]) -> Callable[..., Episodes]:
    """Falling cubes in a simulator."""
    return lambda name="mujoco": first_seed(handle_of(name), Tumbling())
