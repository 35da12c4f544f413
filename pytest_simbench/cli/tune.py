"""`simbench tune TARGET --sim NAME`: a search over settings, its front, one point, the verdict."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator, Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from pytest_simbench.cli.main import INTERRUPTED
from pytest_simbench.cli.runs import RUNS, printed
from pytest_simbench.cli.selection import Selection, check, profiles_of
from pytest_simbench.cli.values import BadInput, refusing
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.resumed import NotResumed, Resumed
from pytest_simbench.experiment.variants import USUAL, Variant
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.measure.intervals import Interval
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.metrics import significant
from pytest_simbench.records.paths import FolderError, write_whole
from pytest_simbench.records.record import RecordError
from pytest_simbench.report.figures.drawing import FiguresUnavailable, drawing, write
from pytest_simbench.report.figures.front import draw
from pytest_simbench.report.files import shown
from pytest_simbench.simulator.profile_file import write_profile
from pytest_simbench.simulator.ranges import in_words
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tuning.judging import SEEDS, judged, recommended
from pytest_simbench.tuning.search import Search, folder_name, front, space_of
from pytest_simbench.tuning.target import FIRST_CHOSEN, FIRST_JUDGED
from pytest_simbench.tuning.target import target as target_of
from pytest_simbench.tuning.trials import Candidate, Trials

BUDGET = 1800.0
"""[s]"""

SEARCHING = 0.75
"""Of the budget; the rest is for judging."""

FEWEST_JUDGED = 5
"""Seeds, however small the budget."""


def tune(
    target: str,
    sim: str | None = None,
    profile: Sequence[str] | None = None,
    settings: Sequence[str] | None = None,
    cost: str | None = None,
    error: str | None = None,
    budget: float | None = None,
    trials: int | None = None,
    seeds: int | None = None,
    seed: int | None = None,
    output: str | None = None,
) -> int:
    """Search, print, write the profile and the picture; the exit code.

    Raises:
        BadInput, SimulatorError: what cannot be; one sentence.
    """
    chosen, variant = selected(sim, profile)
    can = adapter(variant.simulator).info.capabilities
    wanted = target_of(target, cost or "cpu_cost", error, seeds or 4, SEEDS, can)
    name, base = variant.simulator, chosen.settings(variant.simulator, variant.profile)
    space = space_of(base, settings, name)
    budget, seed = budget or BUDGET, 1 if seed is None else seed
    parts = (name, target, variant.profile, wanted.cost, error, seeds, seed, *map(str, space))
    path = Path(output) if output else Path(RUNS) / folder_name(parts)
    with closing(locked(path)) as folder, closing(LocalExecutor(1)) as executor:
        with refusing(RecordError):
            resumed = Resumed(folder) if folder.holds_run else None
        case = chosen.case(variant, test="tune", folder=path)
        looks = Trials(wanted, case, executor, printed(True), folder, resumed)
        search = Search(looks, base, space, seed, _told(looks))
        over = ", ".join(dict.fromkeys(one.setting for one in space))
        print(for_terminal(f"{target} on {name}, from its profile {variant.profile}; over {over}"))
        if resumed:
            print(f"goes on with {len(resumed.records)} repetitions of {shown(path, Path.cwd())}")
        try:
            with refusing(NotResumed):
                done = search.run(SEARCHING * budget, trials)
                found, why = recommended(done, looks)
                halves = _judge(looks, done[0], found, (1 - SEARCHING) * budget)
        except KeyboardInterrupt:
            print("interrupted; the same command goes on")
            return INTERRUPTED
        lines = [*_front(done, found, looks), "", *_verdict(halves, found, why, looks)]
        print(for_terminal("\n".join(["", *lines])))
        if found is not done[0]:
            text = _profile(found, case, looks, why)
            write_whole(path, f"{name}.tuned.toml", text.encode())
            print(f"profile: {shown(path / f'{name}.tuned.toml', Path.cwd())}")
        points = [(c.cost(), looks.error(c)) for c in done if not c.ended and c.costs]
        best = [(c.cost(), looks.error(c)) for c in front(done, looks)]
        with suppress(FiguresUnavailable), drawing():
            figure = draw(points, best, points[0], wanted.cost, wanted.unit)
            print(f"picture: {shown(write(path, [('front', figure)])[0], Path.cwd())}")
    return 0


def selected(sim: str | None, profile: Sequence[str] | None) -> tuple[Selection, Variant]:
    if sim is None:
        raise BadInput("name a simulator: --sim NAME (simbench list tells which there are)")
    labels, files = profiles_of(profile or (USUAL,))
    if len(labels) > 1:
        raise BadInput("give one profile: the search begins with it")
    chosen = Selection((sim,), ("headless",), labels, named=(sim,), files=files)
    check(chosen, makes=False)
    return chosen, Variant(sim, "headless", labels[0])


def locked(path: Path) -> RunFolder:
    folder = RunFolder(path)
    with refusing(FolderError):
        folder.lock()
    return folder


def _told(trials: Trials) -> Any:
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


def _judge(trials: Trials, today: Candidate, found: Candidate, seconds: float) -> list[Candidate]:
    """Both on the held-out half; of a task on as many seeds as the time is enough for."""
    if found is today:
        return []
    looks = trials.target.judged
    if not trials.target.deterministic:
        took = [r.seconds["total"] for one in (today, found) for r in one.records.values()]
        each = 2 * sum(took) / len(took)
        looks = looks[: max(FEWEST_JUDGED, int(seconds / each))]
    return trials.judge(today, found, looks=looks)


def _front(done: Sequence[Candidate], found: Candidate, trials: Trials) -> Iterator[str]:
    today, best = done[0], front(done, trials)
    ended = [one.ended for one in done if one.ended]
    hopeless = sum(why.startswith("hopeless") for why in ended)
    yield (
        f"{len(done) - 1} candidates: {len(ended) - hopeless} failed, {hopeless} were stopped as "
        f"hopeless; cost is {trials.target.cost}"
    )
    rows = [("", "cost", "error", "settings")]
    for one in [*best, *([] if today in best else [today])]:
        mark = "recommended" if one is found else "today" if one is today else ""
        changed = (f"{key}={in_words(value)}" for key, value in one.changes.items())
        error = significant(trials.error(one))
        rows.append((mark, significant(one.cost()), error, " ".join(changed) or "today's"))
    yield from aligned(rows)


def aligned(rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """Rows of a table, its columns one below the other."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "  ".join(text.ljust(w) for text, w in zip(row, widths, strict=True)).rstrip()


def _verdict(
    halves: Sequence[Candidate], found: Candidate, why: str, trials: Trials
) -> Iterator[str]:
    yield f"recommended: {found.name if halves else 'today'}: {why}"
    if not halves:
        return
    if not trials.target.judged:
        yield "not judged: none of these laws has other parameters"
        return
    of = judged(halves[0], halves[1], trials.target)
    cheaper = "cost not told apart"
    if of.cheaper is not None:
        cheaper = f"cost divided by {_interval(of.cheaper)}"
    worse = f" (more by {_interval(of.worse_by)})" if of.worse_by else ""
    yield (
        f"held-out half: {of.verdict}: error {significant(of.before)} today, "
        f"{significant(of.after)} then{worse}; {of.reason}; {cheaper}"
    )


def _interval(of: Interval) -> str:
    return f"{significant(of.mean)} [{significant(of.low)}, {significant(of.high)}]"


def _profile(found: Candidate, case: Any, trials: Trials, why: str) -> str:
    """The text of the profile file."""
    target = trials.target
    record = next(iter(found.records.values()))
    chosen: dict[str, Any] = {"by": f"simbench tune {target.name}", "reason": why}
    if target.deterministic:
        chosen["laws"] = [look.task.name for look in target.chosen]
    else:
        last = len(target.chosen) - 1
        chosen["seeds"] = [[target.chosen[0].task.name, FIRST_CHOSEN, FIRST_CHOSEN + last]]
        chosen["judged_from"] = FIRST_JUDGED
    chosen |= {"versions": dict(record.versions), "commit": _commit()}
    changes = {**case.changes, **found.changes}
    return write_profile(case.base, case.simulator.partition("==")[0], changes, chosen)


def _commit() -> str:
    """Of the working directory, if it is one of git's."""
    with suppress(OSError):
        words = ["git", "describe", "--always", "--dirty", "--abbrev=12"]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        return done.stdout.strip()
    return ""
