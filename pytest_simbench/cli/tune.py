"""`simbench tune TARGET --sim NAME,...`: a search over settings of each, its front, one point, the
verdict."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from statistics import fmean
from typing import Any

from pytest_simbench.cli.asked import asked
from pytest_simbench.cli.main import INTERRUPTED
from pytest_simbench.cli.names import read_names
from pytest_simbench.cli.runs import RUNS
from pytest_simbench.cli.searching import BUDGET, begins_with, runs_in
from pytest_simbench.cli.selection import EVERY, Selection, check
from pytest_simbench.cli.tune_told import (
    Result,
    front_of,
    profile_of,
    progress,
    together,
    verdict_of,
)
from pytest_simbench.cli.values import BadInput, refusing
from pytest_simbench.cluster.executor import ClusterExecutor
from pytest_simbench.cluster.offers import Node, refusal
from pytest_simbench.cluster.pool import Pool
from pytest_simbench.experiment.executor import Executor, LocalExecutor
from pytest_simbench.experiment.variants import Variant
from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.records.paths import write_whole
from pytest_simbench.report.figures.drawing import FiguresUnavailable, Picture, write
from pytest_simbench.report.figures.front import draw
from pytest_simbench.report.files import shown
from pytest_simbench.simulator.registry import adapter, known
from pytest_simbench.tuning.judging import SEEDS, recommended
from pytest_simbench.tuning.search import Search, finished, folder_name, front, space_of
from pytest_simbench.tuning.several import named
from pytest_simbench.tuning.target import FINER
from pytest_simbench.tuning.trials import Candidate, Trials

SEARCHING = 0.75
"""Of the budget; the rest is for judging."""

FEWEST_JUDGED = 5
"""Seeds, however small the budget."""


def tune(
    target: str,
    sim: Sequence[str] | None = None,
    profile: Sequence[str] | None = None,
    budget: float | None = None,
    jobs: int | None = None,
    cluster: str | None = None,
    output: str | None = None,
    **more: Any,
) -> int:
    """Search for each simulator in turn, print, write profile and picture; the exit code. `more`
    are arguments of `_search`.

    Raises:
        BadInput, SimulatorError, DataError, ExecutorError: what cannot be; one sentence.
    """
    labels, files = begins_with(sim, profile)
    assert sim is not None  # or it was refused
    names, builds = read_names(known() if EVERY in sim else dict.fromkeys(sim), Path.cwd())
    several, results, left = len(names) > 1, [], []
    with _executor(jobs, cluster) as (executor, nodes):
        selected = {
            name: Selection(
                (name,), ("headless",), labels, pythons=builds, nodes=nodes, named=(name,),
                files=files,
            )
            for name in names
        }  # fmt: skip
        many = sum(not chosen.unusable(name) for name, chosen in selected.items())
        for name, chosen in selected.items():
            out = Path(output, name if several else "") if output else None
            options = [
                f"--sim-name={'='.join(filter(None, (name, builds.get(name))))}",
                f"--sim-profile={(profile or labels)[0]}",
                *([f"--sim-cluster={cluster}"] if cluster else []),
            ]
            if several:
                print(f"\n{name}", flush=True)
            try:
                seconds = (budget or BUDGET) / max(1, many)  # of those that are here
                done = _search(chosen, executor, target, options, seconds, out, **more)
            except (BadInput, SimulatorError) as problem:
                if not several:
                    raise
                left.append(f"{name} is left out: {problem}")
                print(for_terminal(left[-1]))
            except KeyboardInterrupt:
                print("interrupted; the same command goes on")
                return INTERRUPTED
            else:
                results.append(done)
    if not results:
        raise BadInput(f"none of {len(names)} simulators could be tuned")
    if several:
        print(for_terminal("\n".join(["", *together(results), *left])))
    return 0


@contextmanager
def _executor(jobs: int | None, cluster: str | None) -> Iterator[tuple[Executor, tuple[Node, ...]]]:
    """Where repetitions are carried out, and the nodes of a cluster."""
    if cluster is None:
        with closing(LocalExecutor(jobs or 1)) as executor:
            yield executor, ()
        return
    if jobs is not None:
        raise BadInput("--cluster: leave out --jobs; each node says itself how many (--slots)")
    with closing(Pool(cluster)) as pool:
        if problem := refusal(pool.nodes()):
            raise BadInput(f"--cluster={cluster}: {problem}")
        yield ClusterExecutor(pool), pool.nodes()


def _search(
    chosen: Selection,
    executor: Executor,
    target: str,
    options: Sequence[str],
    budget: float,
    output: Path | None,
    settings: Sequence[str] | None = None,
    cost: str | None = None,
    error: str | None = None,
    trials: int | None = None,
    seeds: int | None = None,
    seed: int | None = None,
) -> Result:
    """The search of one simulator; `options` are pytest's for it."""
    check(chosen, makes=False)
    (name,), (label,) = chosen.simulators, chosen.profiles
    case = chosen.case(Variant(name, "headless", label), test="tune", folder=Path())
    of_test, note = None, ""
    source: tuple[bytes, ...] = ()
    if "::" in target:
        found = asked(target, options)
        case = replace(found.experiment.case, trace="off", video="off")
        of_test, note = (found.experiment.asked, found.claims), found.failed
        source = (Path(target.partition("::")[0]).read_bytes(),)
    can = adapter(name).info.capabilities
    wanted = named(target, cost or "cpu_cost", error, seeds, SEEDS, can, of_test)
    base = chosen.settings(name, label, case.changes)
    space = space_of(base, settings, name)
    seed = 1 if seed is None else seed
    claims = [f"{metric.name} {claim}" for metric, claim in wanted.claims]
    parts = (name, target, label, wanted.cost, error, seeds, seed, *map(str, space), *claims)
    path = output or Path(RUNS) / folder_name((*parts, *source))
    with runs_in(path, executor, "tune") as runs:
        looks = Trials(wanted, replace(case, folder=path), runs)
        search = Search(looks, base, space, seed, progress(looks))
        over = ", ".join(dict.fromkeys(one.setting for one in space))
        print(for_terminal(f"{target} on {name}, from its profile {label}; over {over}"))
        if claims:
            print(for_terminal(f"claimed: {'; '.join(claims)}"))
        if note:
            print(for_terminal(f"what the test asks after this is not known: {note}"))
        if runs.resumed:
            print(
                f"goes on with {len(runs.resumed.records)} repetitions of {shown(path, Path.cwd())}"
            )
        done = search.run(SEARCHING * budget, trials)
        best, why = recommended(done, looks)
        halves = _judge(looks, done[0], best, (1 - SEARCHING) * budget)
        result = Result(looks, done, best, why, halves)
        print(for_terminal("\n".join(["", *front_of(result), "", *verdict_of(result)])))
        file = path / f"{name}.tuned.toml"
        with refusing(OSError, str(path)):
            if best is not done[0]:
                write_whole(path, file.name, profile_of(result).encode())
                print(f"profile: {shown(file, Path.cwd())}")
            elif not (case.file and file.exists() and file.samefile(case.file.path)):
                file.unlink(missing_ok=True)  # of an earlier call, with less budget
        today, *points = [(c.cost(), looks.error(c)) for c in (done[0], *finished(done))]
        line = [(c.cost(), looks.error(c)) for c in front(done, looks)]
        picture = Picture("front", partial(draw, points, line, today, wanted.cost, wanted.unit))
        with suppress(FiguresUnavailable), refusing(OSError, str(path)):
            print(f"picture: {shown(write(path, [picture])[0], Path.cwd())}")
    return result


def _judge(trials: Trials, today: Candidate, found: Candidate, seconds: float) -> list[Candidate]:
    """Both on the held-out half; of a task on as many seeds as the time is enough for."""
    if found is today:
        return []
    looks = trials.target.judged
    if not trials.target.laws:
        took: dict[str, list[float]] = {}  # by task
        for one, record in chain(today.records.items(), found.records.items()):
            took.setdefault(one.task.name, []).append(record.cost("total") or 0.1)
        each = (2 + FINER * trials.target.converged) * sum(map(fmean, took.values()))
        many = max(FEWEST_JUDGED, int(seconds * trials.runs.executor.slots / each))
        looks = tuple(look for look in looks if look.number < looks[0].number + many)
    return trials.judge(today, found, looks=looks)
