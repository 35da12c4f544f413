"""One experiment, one seed: run as often as it takes, changed or not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from pytest_simbench.client.motion import Motion
from pytest_simbench.client.tape import Operation, Tape, TapedWorld
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.repeatability.perturbation import Perturbation, controller_delay, perturbed
from pytest_simbench.scene import Scene
from pytest_simbench.tasks.base import Outcome, Task

PERIOD = 0.02
"""Sampling of joints and bodies [s]. Comparisons bit by bit see these samples, and the
state at the end of every operation."""


@dataclass(frozen=True)
class Episode:
    """What one run of a task gave.

    Attributes:
        counts: those of its metrics that count things: what "the outcome" means here.
        motions: their samples, see `TapedWorld.motions`.
        left_at: when the task asked for something else than the tape that was played [s].
    """

    outcome: Outcome
    counts: Mapping[str, float | None]
    tape: Tape
    motions: Sequence[Motion]
    bodies: Sequence[str]
    left_at: float | None


@dataclass(frozen=True)
class Episodes:
    """The first seed of an experiment, run as often as it takes, changed or not.

    Attributes:
        experiment: what is run; it has the seed.
        handle: of its simulator; one worker serves all runs.
    """

    experiment: Experiment
    handle: SimulatorHandle

    @property
    def task(self) -> Task:
        """The version of the task that the experiment runs."""
        return self.experiment.task

    def scene(self) -> Scene:
        """The scene of the first seed, not perturbed."""
        return self.experiment.scene(self.experiment.seed())

    def run(
        self,
        perturbations: Sequence[Perturbation] = (),
        *,
        play: Tape | None = None,
        before: Callable[[TapedWorld, Operation], None] | None = None,
        handle: SimulatorHandle | None = None,
    ) -> Episode:
        """Run it once.

        Args:
            play: commands to be sent in place of those that the task plans.
            before: called before each operation.

        Raises:
            WorkerError: whatever happened to the worker.
        """
        scene = perturbed(self.scene(), perturbations)
        delay, worker = controller_delay(perturbations), handle or self.handle
        with worker.episode(scene, period=PERIOD, play=play, before=before, delay=delay) as world:
            outcome = self.task.perform(world, self.experiment.seed(), lambda done, total: None)
        return Episode(
            outcome,
            counts(self.task, outcome),
            world.tape,
            world.motions,
            [body.name for body in scene.free_bodies],
            world.left_at,
        )


def counts(task: Task, outcome: Outcome) -> dict[str, float | None]:
    """The counting metrics of an outcome: shares, and yes or no. Lengths and speeds are never the
    same twice once a bit differs; a count says whether it mattered."""
    return {m.name: outcome.metrics.get(m.name) for m in task.metrics if m.bounded}


def changed(before: Mapping[str, float | None], after: Mapping[str, float | None]) -> list[str]:
    """Names of the counts that are not the same."""
    return [name for name, value in before.items() if after.get(name) != value]
