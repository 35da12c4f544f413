"""How much of a task small perturbations leave, and how a millimetre grows with time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pytest_simbench.measure.intervals import Interval, interval, proportion
from pytest_simbench.measure.metrics import Metric, significant
from pytest_simbench.repeatability.attack import Attack, Perturbations
from pytest_simbench.repeatability.episode import Experiment
from pytest_simbench.repeatability.motions import gaps
from pytest_simbench.repeatability.perturbation import (
    QUANTITIES,
    Perturbation,
    described,
    perturbations,
)
from pytest_simbench.repeatability.search import bounds_in_words

SENSITIVITY_TIMES = (0.1, 1.0, 5.0, 20.0)
"""Simulated times at which sensitivity is told [s]."""

KEPT = Metric("kept", "kept", kind="share", of=1, doc="what a perturbed run keeps of the outcome")


@dataclass(frozen=True)
class Stability:
    """What random perturbations up to a bound left of a task.

    Attributes:
        simulator: its name.
        kept: for each run, the share that was left of the outcome's counts, the worst of them.
        unchanged: how many runs gave the same outcome.
        bounds: largest changes, in words.
        worst: the perturbation that left least, and what it did, in words; "" when all was kept.
    """

    simulator: str
    kept: Sequence[float]
    unchanged: int
    bounds: str
    worst: str

    @property
    def share(self) -> Interval:
        """Mean of what was kept."""
        return interval(self.kept, KEPT)

    @property
    def same(self) -> Interval:
        """Share of the runs whose outcome was the same."""
        return proportion(self.unchanged, len(self.kept))

    @property
    def sentence(self) -> str:
        """For the report."""
        share, n = self.share, len(self.kept)
        text = (
            f"kept {significant(100 * share.mean)} % [{100 * share.low:.0f}, {100 * share.high:.0f}] within "
            f"{self.bounds}; the same outcome in {self.unchanged} of {n}"
        )
        return f"{text}; worst: {self.worst}" if self.worst else text

    def assert_kept_at_least(self, least: float) -> None:
        """Raise AssertionError when the data show that less than `least` of the task is kept: the
        whole 95 % interval of its mean lies below."""
        if self.share.high < least:
            raise AssertionError(
                f"{self.simulator}: at least {100 * least:g} % should be kept, but {self.sentence}"
            )

    def to_wire(self) -> dict[str, Any]:
        """Plain data for the run's records."""
        return {
            "kept": list(self.kept),
            "unchanged": self.unchanged,
            "bounds": self.bounds,
            "worst": self.worst,
            "sentence": self.sentence,
        }


def stability(
    experiment: Experiment,
    bounds: Mapping[str, float] | None = None,
    *,
    examples: int = 20,
    at_most: int = 3,
    random_seed: int = 0,
) -> Stability:
    """Run an experiment under random perturbations.

    They are drawn by Hypothesis, which likes extremes: the bounds themselves come more often than
    a uniform draw would bring them.

    Args:
        experiment: to be perturbed.
        bounds: largest changes by quantity, see `perturbation.perturbations`.
        examples: how many runs, each with another perturbation.
        at_most: how many perturbations at once.
        random_seed: of Hypothesis.

    Raises:
        WorkerError: in the unperturbed run; a perturbed run that crashes keeps nothing.
    """
    import hypothesis
    from hypothesis import Phase, given, settings

    attack = Attack(experiment, examples)

    @hypothesis.seed(random_seed)
    @settings(max_examples=examples, deadline=None, database=None, phases=(Phase.generate,))
    @given(perturbations(experiment.scene(), bounds, at_most=at_most))
    def drawn(perturbed: Perturbations) -> None:
        attack.trial(perturbed)

    drawn()
    trials = attack.trials
    worst = min(trials, key=lambda perturbed: trials[perturbed].kept)
    lost = trials[worst].kept < 1
    return Stability(
        experiment.handle.case.simulator,
        tuple(trial.kept for trial in trials.values()),
        sum(not trial.differs for trial in trials.values()),
        bounds_in_words(experiment, bounds),
        f"{described(worst)} {trials[worst].effect}" if lost else "",
    )


@dataclass(frozen=True)
class Sensitivity:
    """How far apart the cubes are after a small displacement, per unit of it.

    Attributes:
        simulator: its name.
        perturbation: the displacement, in words.
        ratio: by simulated time [s]: largest distance between a cube with and without it, over the
            displacement (mm per mm); None where the episode was over.
        largest: of that ratio at any time.
    """

    simulator: str
    perturbation: str
    ratio: Mapping[float, float | None]
    largest: float

    @property
    def sentence(self) -> str:
        """For the report."""
        parts = [f"{significant(r)} at {t:g} s" for t, r in self.ratio.items() if r is not None]
        most = significant(self.largest)
        return f"mm per mm after {self.perturbation}: {', '.join(parts)}; most {most}"

    def assert_below(self, most: float, until: float) -> None:
        """Raise AssertionError when the ratio exceeds `most` at one of the times up to `until`."""
        for time, ratio in self.ratio.items():
            if time <= until and ratio is not None and not ratio < most:
                raise AssertionError(
                    f"{self.simulator}: {self.sentence}; expected below {most:g} until {until:g} s"
                )

    def to_wire(self) -> dict[str, Any]:
        """Plain data for the run's records."""
        return {
            "perturbation": self.perturbation,
            "ratio": {f"{time:g}": value for time, value in self.ratio.items()},
            "largest": self.largest,
            "sentence": self.sentence,
        }


def sensitivity(experiment: Experiment, perturbation: Perturbation) -> Sensitivity:
    """Displace one cube by a little and send the same commands.

    The commands are those of the unperturbed run, so what grows is the simulator's own.

    Raises:
        WorkerError: whatever happened to the worker.
        ValueError: a perturbation that is no displacement.
    """
    if QUANTITIES[perturbation.quantity].unit != "mm":
        raise ValueError(f"sensitivity is told per millimetre, not for {perturbation}")
    base = experiment.run()
    moved = experiment.run([perturbation], play=base.tape)
    between = gaps(base.motions, moved.motions)
    size = abs(perturbation.amount)
    found = {time: between.after(time) for time in SENSITIVITY_TIMES}
    return Sensitivity(
        experiment.handle.case.simulator,
        str(perturbation),
        {time: None if gap is None else gap / size for time, gap in found.items()},
        float(between.largest().max()) / size,
    )
