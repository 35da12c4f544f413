"""How the claims of `test_claims.py` are judged: each is asked of every engine that it names, under
several settings, and gets one verdict.

- **A part** of a claim is one number of one engine, with a limit that was fixed before it was run.
- **A way** is a configuration in which a part is asked: the claim's own settings and ours, the time
  step and a half of it. Parameters or starts are drawn by the seed.
- A part holds, or does not hold, where all its ways agree (`measure.verdicts`). A claim holds where
  all its parts hold, and does not hold where one does not. Else it cannot be decided.

A claim that does not hold fails its test, as any claim does (docs/gate.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import wraps
from typing import Any

import numpy as np
import pytest

from pytest_simbench.client.world import World
from pytest_simbench.experiment.variants import Variant
from pytest_simbench.laws import Law
from pytest_simbench.laws.base import held_out
from pytest_simbench.measure.intervals import interval
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.measure.verdicts import Bound, Judgement, Verdict, confidence, judge
from pytest_simbench.plugin.cases import case_of
from pytest_simbench.plugin.repeat_fixture import RepeatFixture, claim_of
from pytest_simbench.plugin.session import session_of
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Scene
from pytest_simbench.simulator.registry import settings_of
from pytest_simbench.tasks.base import Count, Jitter, Outcome, Task

HOLDS, FAILS, OPEN = "holds", "does not hold", "cannot be decided"
OF = {"PASS": HOLDS, "FAIL": FAILS}
"""What a verdict on one way says of its claim."""

DRAWS = 8
"""Of a law's parameters."""

FAR = 1000.0
"""How much worse than a world that holds is one that diverged."""


def verdict(parts: Mapping[str, Iterable[str]]) -> str:
    """Of a claim, from the verdicts (PASS, FAIL, UNDECIDED) on all ways of each part."""
    found = {OF.get(next(iter(w)), OPEN) if len(w) == 1 else OPEN for w in map(set, parts.values())}
    if FAILS in found:
        return FAILS
    return HOLDS if found == {HOLDS} else OPEN


@dataclass(frozen=True)
class Drawn(Task):
    """A law whose parameters the seed draws: evenly between its own and its other ones.

    Attributes:
        law: with its own parameters.
        other: the same law with other ones; None: the held-out ones, and where there are none the
            law is as it is.
        repetitions: draws.
    """

    law: Law
    other: Law | None = None
    repetitions: int = DRAWS
    study_timeout = Law.study_timeout
    shares_worker = True

    @property
    def name(self) -> str:
        return self.law.name

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return self.law.metrics

    def drawn(self, seed: int) -> Law:
        """The law of a repetition."""
        other, share = self.other or held_out(self.law) or self.law, np.random.default_rng(seed)
        changed = {}
        for item in fields(self.law):
            a, b = getattr(self.law, item.name), getattr(other, item.name)
            if a != b:
                drawn = np.add(a, share.random(np.shape(a)) * np.subtract(b, a)).tolist()
                changed[item.name] = tuple(drawn) if isinstance(a, tuple) else drawn
        return replace(self.law, **changed)

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        return self.drawn(seed).build()

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        return self.drawn(seed).perform(world, seed, count)


class Referee:
    """Asks engines, and judges what they say."""

    def __init__(self, node: pytest.Item) -> None:
        self.node = node
        self.session = session_of(node.config)
        self.parts: dict[str, list[str]] = {}
        self.told: list[str] = []
        self.asked: dict[int, RepeatFixture] = {}

    def ask(
        self, task: Task, simulator: str, profile: str = "tuned", finer: float = 1, **settings: Any
    ) -> ResultSet:
        """Repeat a task on a simulator with settings changed, its step divided by `finer`."""
        selection = self.session.selection
        if selection.named and simulator not in selection.simulators:
            pytest.skip(f"this claim is about {simulator}, which --sim does not name")
        if reason := selection.missing(simulator, profile):
            pytest.skip(reason)
        if finer != 1:
            own = settings_of(simulator, profile, settings).timestep
            settings["timestep"] = own / finer
        step = settings.get("timestep") or settings_of(simulator, profile, settings).timestep
        others = [f"{k}={v}" for k, v in settings.items() if k != "timestep"]
        way = " ".join([profile, *others, f"{1000 * step:.3g} ms"])
        case = case_of(
            self.node.config, Variant(simulator, "headless", profile), self.node, settings
        )
        number = len(self.asked) + 1
        id_ = f"{self.node.nodeid}[{number}-{simulator}-{way}-{task.name}]"
        case = replace(case, test=id_, function=self.node.nodeid, variant=way)
        repeat = RepeatFixture(self.node, case, self.session.run)
        result = repeat(task)
        self.asked[id(result)] = repeat
        return result

    def rule(self, part: str, of: ResultSet, metric: str | Metric, claim: Bound,
             values: Sequence[float] | None = None) -> None:  # fmt: skip
        """Judge a part in the way in which `of` was asked.

        Args:
            metric: of the task, or what `values` are of.
            values: in place of the metric's, one of each repetition.
        """
        if isinstance(metric, str):
            metric = replace(of.metric(metric), resolution=0.0)
            values = of.values(metric.name)
        found = interval(list(values or ()), metric, confidence(metric))
        judged = judge(claim, found)
        if of.crashed and not metric.bounded and metric is not RATIO:
            # what did not finish speaks for nobody
            judged = Judgement(Verdict.NOT_JUDGED, claim, found)
        line = claim_of(self.asked[id(of)].case, of, metric, judged)
        line = replace(line, variant=f"{part}: {line.variant}", test=f"{line.test} {part}")
        self.session.run.folder.claim(line)
        self.parts.setdefault(part, []).append(line.verdict)
        self.told.append(f"{line.verdict} {line.variant}: {metric.name} {found.mean:.4g}, {claim}")

    def decide(self) -> None:
        """Fail where the claim does not hold."""
        if (found := verdict(self.parts)) == FAILS:
            pytest.fail(f"{found}: " + "; ".join(self.told), pytrace=False)
        print(found, *self.told, sep="\n")


@pytest.fixture(name="referee")
def of_a_claim(request: pytest.FixtureRequest) -> Referee:
    """Of one claim."""
    return Referee(request.node)


def claim(by: str, words: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """A test of a claim: who says what. Its docstring says what is measured, and its limits."""

    def of(test: Callable[..., None]) -> Callable[..., None]:
        @wraps(test)
        def asked(referee: Referee, **others: Any) -> None:
            test(referee, **others)
            referee.decide()

        vars(asked).update(by=by, words=words)
        return asked

    return of


def broken(result: ResultSet) -> list[float]:
    """1 for each repetition in which a law is broken or the world diverges, else 0."""
    return [float(not r.ok or (r.metrics.get("ratio") or 0.0) > 1) for r in result.records]


BROKEN = Metric("broken", "broken", better=None, kind="yes_no")
RATIO = Metric("ratio", "ratio", better=None, least=0.0, resolution=0.0)


def over(a: ResultSet, b: ResultSet, metric: str = "error") -> list[float]:
    """A metric of one over that of another, seed by seed. A world that diverged is `FAR` times as
    far off as one that did not, and so is one that is off at all beside one that is not."""
    first, second = a.by_seed(metric), b.by_seed(metric)
    both = [(first[seed], second[seed]) for seed in first if seed in second]
    found = [x / y if y else FAR if x else 1.0 for x, y in both]
    lost = [{r.seed for r in each.crashed} if metric == "error" else set() for each in (a, b)]
    return found + [FAR] * len(lost[0] - lost[1]) + [1 / FAR] * len(lost[1] - lost[0])
