"""How much of a task small perturbations leave, and how a millimetre grows with time."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pytest_simbench.measure.intervals import Interval, interval, proportion
from pytest_simbench.measure.results import InconclusiveWarning
from pytest_simbench.measure.verdicts import Verdict, at_least, confidence, judge
from pytest_simbench.records.metrics import Metric, significant
from pytest_simbench.repeatability.episode import Episodes
from pytest_simbench.repeatability.motions import gaps
from pytest_simbench.repeatability.perturbation import (
    QUANTITIES,
    Perturbation,
    described,
    perturbations,
)
from pytest_simbench.repeatability.search import Attack, Perturbations, bounds_in_words
from pytest_simbench.scene.checks import check_choice
from pytest_simbench.tasks import Moment

SENSITIVITY_TIMES = (0.1, 1.0, 5.0, 20.0)
"""Seconds after the task began at which sensitivity is told."""

KEPT = Metric("kept", "kept", kind="share", of=1, doc="what a perturbed run keeps of the outcome")


@dataclass(frozen=True)
class Stability:
    """What random perturbations up to a bound left of a task.

    Attributes:
        kept: for each run, the share that was left of the outcome's counts, the worst of them.
        bounds: largest changes, in words.
        worst: the perturbation that left least, and what it did, in words; "" when all was kept.
        strict: whether a claim that is not decided fails (`--sim-strict`).
    """

    simulator: str
    kept: Sequence[float]
    unchanged: int
    bounds: str
    worst: str
    strict: bool = False

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
        ends = f"[{100 * share.low:.0f}, {100 * share.high:.0f}]"
        text = (
            f"kept {significant(100 * share.mean)} % {ends} within {self.bounds}; "
            f"the same outcome in {self.unchanged} of {n}"
        )
        return f"{text}; worst: {self.worst}" if self.worst else text

    def assert_kept_at_least(self, least: float) -> None:
        """Raise AssertionError when the data show that less than `least` of the task is kept; warn,
        or fail where `strict`, when they do not decide. See `measure.verdicts`.
        """
        found = judge(at_least(least), interval(self.kept, KEPT, confidence(KEPT)))
        text = f"{self.simulator}: at least {significant(100 * least)} % should be kept, "
        if found.verdict is Verdict.REFUTED:
            raise AssertionError(f"{text}but {self.sentence}")
        if not found.verdict.decided:
            text += f"{found.verdict}: {self.sentence}, {found.advice}"
            if self.strict:
                raise AssertionError(f"{text} (--sim-strict)")
            warnings.warn(text, InconclusiveWarning, stacklevel=2)

    def to_wire(self) -> dict[str, Any]:
        """Plain data for the run's records."""
        own = {key: getattr(self, key) for key in ("unchanged", "bounds", "worst", "sentence")}
        return {**own, "kept": list(self.kept)}


def stability(
    episodes: Episodes,
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
        bounds: largest changes by quantity, see `perturbation.perturbations`.
        random_seed: of Hypothesis.

    Raises:
        AssertionError: the unperturbed run scored 0, of which nothing can be lost.
        WorkerError: in the unperturbed run; a perturbed run that crashes keeps nothing.
        ValueError: bounds or numbers that make no sense.
    """
    import hypothesis
    from hypothesis import Phase, given, settings

    strategy = perturbations(episodes.scene(), bounds, at_most=at_most)
    attack, simulator = Attack(episodes, examples), episodes.handle.case.simulator
    found = [attack.base.counts[m.name] for m in episodes.task.metrics if m.crashed == 0.0]
    if found and not any(found):
        raise AssertionError(
            f"{simulator}: the run without perturbations scored 0: none can be kept"
        )

    @hypothesis.seed(random_seed)
    @settings(max_examples=examples, deadline=None, database=None, phases=(Phase.generate,))
    @given(strategy)
    def drawn(perturbed: Perturbations) -> None:
        attack.trial(perturbed)

    drawn()
    trials = attack.trials
    worst = min(trials, key=lambda perturbed: trials[perturbed].kept)
    lost = trials[worst].kept < 1
    return Stability(
        simulator,
        tuple(trial.kept for trial in trials.values()),
        sum(not trial.effect for trial in trials.values()),
        bounds_in_words(episodes, bounds),
        f"{described(worst)} {trials[worst].effect}" if lost else "",
    )


@dataclass(frozen=True)
class Sensitivity:
    """How far apart the cubes are after a small displacement, per unit of it.

    Attributes:
        perturbation: the displacement, in words.
        ratio: by seconds after the task began, that is after its first motion began, or the world
            where nothing moves by itself: largest distance between a cube with and without the
            displacement, over it (mm per mm); None where the episode was over.
        until: by a moment's name the largest of that ratio until then, from the beginning of the
            world; None where the task never came to it.
        largest: of that ratio at any time.
        course: every sample, times as those of `ratio`, and the ratio.
    """

    simulator: str
    perturbation: str
    ratio: Mapping[float, float | None]
    largest: float
    until: Mapping[str, float | None] = field(default_factory=dict)
    course: Sequence[tuple[float, float]] = ()

    @property
    def sentence(self) -> str:
        """For the report."""
        parts = [f"{significant(r)} at {t:g} s" for t, r in self.ratio.items() if r is not None]
        parts += [f"{significant(r)} until {n}" for n, r in self.until.items() if r is not None]
        most = significant(self.largest)
        return f"mm per mm after {self.perturbation}: {', '.join(parts)}; most {most}"

    def assert_below(self, most: float, until: float | str) -> None:
        """Raise AssertionError when the ratio exceeds `most` before a time or a moment, or the
        task ended before.

        Args:
            until: seconds after the task began, or the name of one of the moments.

        Raises:
            ValueError: there is no such moment; lists those there are.
        """
        if isinstance(until, str):
            if until not in self.until:
                known = ", ".join(self.until) or "none"
                raise ValueError(f"no moment is named {until!r}; there are: {known}")
            judged, when = [self.until[until]], until
        else:
            told = [(t, r) for t, r in (*self.ratio.items(), *self.course) if r is not None]
            judged, when = [r for t, r in told if t <= until + 1e-9], f"{until:g} s"
            times = sorted({t for t, _ in told})[-2:]
            if times and (end := times[-1]) < until - (end - times[0]) - 1e-9:  # one sample less
                raise AssertionError(
                    f"{self.simulator}: the task ended after {end:g} s, before {when}"
                )
        found = [ratio for ratio in judged if ratio is not None]
        if not found:
            raise AssertionError(f"{self.simulator}: the task never came to {when}")
        if not max(found) < most:
            raise AssertionError(
                f"{self.simulator}: {self.sentence}; expected below {most:g} until {when}"
            )

    def to_wire(self) -> dict[str, Any]:
        """Plain data for the run's records."""
        own = {key: getattr(self, key) for key in ("perturbation", "largest", "sentence")}
        ratio = {f"{time:g}": value for time, value in self.ratio.items()}
        return {**own, "ratio": ratio, "until": dict(self.until)}


def sensitivity(
    episodes: Episodes, perturbation: Perturbation, moments: Sequence[Moment] | None = None
) -> Sensitivity:
    """Displace one cube by a little and send the same commands.

    The commands are those of the unperturbed run, so what grows is the simulator's own.

    Args:
        perturbation: in x or y.
        moments: until which the growth is told; by default those that the task declares.

    Raises:
        WorkerError: whatever happened to the worker.
        ValueError: a perturbation that is no displacement, or of no body.
    """
    names = [body.name for body in episodes.scene().bodies]
    check_choice(perturbation.body, "the body that is displaced", names)
    if QUANTITIES[perturbation.quantity].unit != "mm" or not perturbation.steps:
        raise ValueError(f"sensitivity is told per millimetre, not for {perturbation}")
    base = episodes.run()
    moved = episodes.run([perturbation], play=base.tape)
    between, size = gaps(base.motions, moved.motions), abs(perturbation.amount)
    gap = between.largest() / size
    # Simulated time at which each operation of the tape begins [s].
    starts = [float(motion.time[-1]) for motion in base.motions]
    began = next((t for t, o in zip(starts, base.tape, strict=False) if o.kind == "follow"), 0.0)
    ratios = {time: between.after(began + time) for time in SENSITIVITY_TIMES}
    until: dict[str, float | None] = {}
    for moment in episodes.task.moments if moments is None else moments:
        number = moment.place(base.tape)
        here = None if number is None else between.time <= starts[number] + 1e-9
        until[moment.name] = None if here is None else float(gap[here].max())
    return Sensitivity(
        episodes.handle.case.simulator,
        str(perturbation),
        {time: None if value is None else value / size for time, value in ratios.items()},
        float(gap.max()),
        until,
        list(zip((between.time - began).tolist(), gap.tolist(), strict=True)),
    )
