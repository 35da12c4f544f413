"""Perturbed runs of an experiment, each compared with the unperturbed one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pytest_simbench.client.errors import WorkerError
from pytest_simbench.client.tape import Tape
from pytest_simbench.repeatability.episode import Episode, Episodes, changed
from pytest_simbench.repeatability.perturbation import Perturbation
from pytest_simbench.tasks.base import Outcome, Task

Perturbations = tuple[Perturbation, ...]


@dataclass(frozen=True)
class Trial:
    """A perturbed run.

    Attributes:
        divergence: farthest that a cube goes another way than unperturbed [m]: its own
            displacement at the start does not count.
        changed: counts of the outcome that are not the same.
        effect: what the perturbation does, in words, "" when the outcome is the same.
        crash: error that ended the run, "" when none did.
        kept: of each count, how much is left: 1 when it is the same or better.
    """

    divergence: float
    changed: tuple[str, ...] = ()
    effect: str = ""
    crash: str = ""
    kept: float = 1.0

    @property
    def differs(self) -> bool:
        """Whether the outcome is another one."""
        return bool(self.changed or self.crash)


class Attack:
    """Perturbed runs of one experiment, each compared with the unperturbed one.

    No run is made twice: what is asked again is answered from memory, so that a simulator that is
    not deterministic cannot make Hypothesis find its examples flaky.

    Args:
        episodes: to be perturbed.
        examples: how many runs it may take, the unperturbed one not counted; more may be allowed
            later.
    """

    def __init__(self, episodes: Episodes, examples: int) -> None:
        self.episodes = episodes
        self.examples = examples
        self.base: Episode = episodes.run()
        self.trials: dict[Perturbations, Trial] = {}
        self.tapes: dict[Perturbations, Tape] = {}

    @property
    def exhausted(self) -> bool:
        return len(self.trials) >= self.examples

    def trial(self, perturbed: Perturbations) -> Trial | None:
        """The result of a perturbation; None when it is unknown and no more runs are allowed."""
        if perturbed not in self.trials:
            if self.exhausted:
                return None
            self.trials[perturbed] = self.run(perturbed)
        return self.trials[perturbed]

    def run(self, perturbed: Perturbations) -> Trial:
        """Run it, whether it was run before or not."""
        try:
            episode = self.episodes.run(perturbed)
        except WorkerError as error:
            kind = type(error).__name__
            return Trial(1.0, effect=f"ends in {kind}", crash=f"{kind}: {error.what}", kept=0.0)
        found = changed(self.base.counts, episode.counts)
        if found:
            self.tapes[perturbed] = episode.tape
        task = self.episodes.task
        return Trial(
            divergence(self.base, episode),
            tuple(found),
            effect(task, self.base.outcome, episode.outcome, found),
            kept=_kept(task, self.base, episode),
        )


def divergence(base: Episode, episode: Episode) -> float:
    """Largest difference between a cube's way from start to end here and there [m]."""
    ways = [
        e.motions[-1].bodies[-1, :, :3] - e.motions[0].bodies[0, :, :3] for e in (base, episode)
    ]
    return float(np.linalg.norm(ways[1] - ways[0], axis=1).max(initial=0.0))


def effect(task: Task, before: Outcome, after: Outcome, names: Sequence[str]) -> str:
    """What became of the outcome, in words: "topples tower 2"."""
    if not names:
        return ""
    words = task.change(before, after)
    if words:
        return words
    metrics = {metric.name: metric for metric in task.metrics}
    name = names[0]
    values = [
        "none" if value is None else metrics[name].format(value)
        for value in (before.metrics.get(name), after.metrics.get(name))
    ]
    return f"changes {metrics[name].title} from {values[0]} to {values[1]}"


def _kept(task: Task, base: Episode, episode: Episode) -> float:
    """The smallest share, over the counts that had something to lose, of what is left of it."""
    shares = [1.0]
    for metric in task.metrics:
        before, after = base.counts.get(metric.name), episode.counts.get(metric.name)
        if before and metric.better == "higher":
            shares.append(min(1.0, (after or 0.0) / before))
    return min(shares)
