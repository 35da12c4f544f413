"""What is said of a search: its progress, its front, the verdict, the profile."""

from __future__ import annotations

import subprocess
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from pytest_simbench.experiment.identity import settings
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.ground.versions import base_name
from pytest_simbench.measure.intervals import Interval
from pytest_simbench.records.metrics import significant
from pytest_simbench.report.terminal.grid import aligned
from pytest_simbench.simulator.profile_file import write_profile
from pytest_simbench.simulator.settings import in_words
from pytest_simbench.tasks.measured import MeasuredTask
from pytest_simbench.tuning.judging import Judgement, judged
from pytest_simbench.tuning.search import front
from pytest_simbench.tuning.target import FIRST_CHOSEN
from pytest_simbench.tuning.trials import Candidate, Trials


@dataclass(frozen=True)
class Result:
    """A search that has ended.

    Attributes:
        done: its candidates, today's first.
        found: the recommended one, and why.
        halves: today's and that one on the held-out half; empty where there is nothing to judge.
    """

    trials: Trials
    done: Sequence[Candidate]
    found: Candidate
    why: str
    halves: Sequence[Candidate]

    @cached_property
    def judgement(self) -> Judgement | None:
        """On the held-out half, if there is one."""
        if not (self.halves and self.halves[0].records):
            return None
        return judged(self.halves[0], self.halves[1], self.trials.target)


def progress(trials: Trials) -> Any:
    """A line for each candidate that joins the front, and for each tenth."""
    count = 0

    def tell(one: Candidate, best: Sequence[Candidate]) -> None:
        nonlocal count
        count += 1
        if one in best or count % 10 == 0:
            least = min(best, key=trials.error)
            ended = one.ended or ("joins the front" if one in best else "beaten")
            print(
                for_terminal(
                    f"{one.name}: {_point(one, trials)}, {ended}; front of {len(best)}, cheapest "
                    f"{_point(best[0], trials)}, truest {_point(least, trials)}"
                ),
                flush=True,
            )

    return tell


def _point(one: Candidate, trials: Trials) -> str:
    return f"cost {significant(one.cost())} error {significant(trials.error(one))}"


def front_of(of: Result) -> Iterator[str]:
    """The points that no other beats."""
    trials, done = of.trials, of.done
    today, best = done[0], front(done, trials)
    ended = [one.ended for one in done if one.ended]
    hopeless = sum(why.startswith("hopeless") for why in ended)
    yield (
        f"{len(done) - 1} candidates: {len(ended) - hopeless} failed, {hopeless} were stopped as "
        f"hopeless; cost is {trials.target.cost}"
    )
    rows, own = [("", "cost", "error", "settings")], settings(trials.case)
    for one in [*best, *([] if today in best else [today])]:
        mark = "recommended" if one is of.found else "today" if one is today else ""
        others = {key: value for key, value in one.changes.items() if value != own.get(key)}
        changed = (f"{key}={in_words(value)}" for key, value in others.items())
        error = significant(trials.error(one))
        rows.append((mark, significant(one.cost()), error, " ".join(changed) or "today's"))
    yield from aligned(rows)


def verdict_of(of: Result) -> Iterator[str]:
    """The recommendation, and what the held-out half says of it."""
    kept = of.found is of.done[0]
    yield f"recommended: {'today' if kept else of.found.name}: {of.why}"
    found = [record for one in (*of.done, *of.halves) for record in one.records.values()]
    if len(cpus := {str(record.host["cpu"]) for record in found if "cpu" in record.host}) > 1:
        kinds = ", ".join(sorted(cpus))
        yield f"costs do not compare: they are of several processors ({kinds}); take one kind"
    if (judgement := of.judgement) is None:
        if not kept:
            yield "not judged: there are no other parameters of these laws, or no other starts"
        return
    yield f"held-out half: {_told(judgement)}"
    for name, one in judgement.several.items():
        yield f"  {name}: {_told(one)}"


def together(results: Iterable[Result]) -> Iterator[str]:
    """A line for each simulator: cost and error on the held-out half, where it is judged."""
    rows = [("simulator", "cost today", "error", "cost then", "error", "factor", "verdict")]
    for of in results:
        known = of.judgement
        old, new = of.halves if known else (of.done[0], of.found)
        errors = (known.before, known.after) if known else map(of.trials.error, (old, new))
        before, after = map(significant, errors)
        verdict = known.verdict if known else "as today" if old is new else "not judged"
        costs = significant(old.cost()), significant(new.cost())
        factor = significant(old.cost() / new.cost())
        rows.append((of.trials.case.simulator, costs[0], before, costs[1], after, factor, verdict))
    yield from aligned(rows)


def _told(of: Judgement) -> str:
    if of.several:
        return f"{of.verdict}:"
    cheaper = f"cost divided by {_interval(of.cheaper)}" if of.cheaper else "cost not told apart"
    worse = f" (more by {_interval(of.worse_by)})" if of.worse_by else ""
    return (
        f"{of.verdict}: error {significant(of.before)} today, {significant(of.after)} then{worse}; "
        f"{of.reason}; {cheaper}"
    )


def _interval(of: Interval) -> str:
    return f"{significant(of.mean)} [{significant(of.low)}, {significant(of.high)}]"


def profile_of(of: Result) -> str:
    """The text of the profile file."""
    target, case, found = of.trials.target, of.trials.case, of.found
    chosen: dict[str, Any] = {"by": f"simbench tune {target.name}", "reason": of.why}
    chosen["held_out"] = of.judgement.verdict if of.judgement else "not judged"
    before = case.file.chosen_on if case.file else ()
    seeds = [[one.task, one.first, one.last] for one in before]
    motions = {}
    for part in target.parts:
        task = part.chosen[0].task
        numbers = [look.number + FIRST_CHOSEN - 1 for look in part.chosen]
        if part.laws:
            chosen["laws"] = list(dict.fromkeys(look.task.name for look in part.chosen))
        elif isinstance(task, MeasuredTask):
            motions[task.data] = sorted(task.real(seed).number for seed in numbers)
        else:
            seeds.append([task.name, numbers[0], numbers[-1]])
            if part.judged:
                chosen["judged_from"] = part.first_judged + part.judged[0].number - 1
    if motions:
        chosen["motions"] = motions
    versions = next(iter(found.records.values())).versions
    chosen |= {"seeds": seeds, "versions": dict(versions)}
    if commit := _commit():
        chosen["commit"] = commit
    changes = {**case.changes, **found.changes}
    return write_profile(case.base, base_name(case.simulator), changes, chosen)


def _commit() -> str:
    """Of the working directory, if it is one of git's."""
    with suppress(OSError):
        words = ["git", "describe", "--always", "--dirty", "--abbrev=12"]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        return done.stdout.strip()
    return ""
