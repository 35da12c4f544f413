"""`simbench fit SCENE LOG --sim NAME --unknown KIND:NAME`: numbers of a scene that a log tells."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import chain
from pathlib import Path

from pytest_simbench.cli.main import INTERRUPTED
from pytest_simbench.cli.names import read_names
from pytest_simbench.cli.runs import RUNS
from pytest_simbench.cli.searching import BUDGET, begins_with, runs_in
from pytest_simbench.cli.selection import Selection, check
from pytest_simbench.cli.values import BadInput, refusing
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.scene_file import read_scene_file
from pytest_simbench.experiment.variants import Variant
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.recordings.logs import beyond, read_log
from pytest_simbench.records.metrics import significant
from pytest_simbench.records.paths import write_whole
from pytest_simbench.records.record import Record
from pytest_simbench.report.files import shown
from pytest_simbench.report.terminal.grid import aligned
from pytest_simbench.scene import SceneError
from pytest_simbench.scene.pair_friction import OF_PAIRS
from pytest_simbench.tasks import Fitting
from pytest_simbench.tuning.fitting import Fit, State
from pytest_simbench.tuning.search import folder_name
from pytest_simbench.tuning.target import FIRST_CHOSEN
from pytest_simbench.tuning.telling import Told
from pytest_simbench.tuning.telling import told as told_of
from pytest_simbench.tuning.unknowns import begun, unknowns

FILE = "file"
"""The profile that loads a user's file as it is, whatever the scene says."""

RESULT = "fitted.json"


def fit(
    scene: str,
    log: str,
    sim: str | None = None,
    profile: Sequence[str] | None = None,
    unknown: Sequence[Sequence[str]] | None = None,
    noise: float | None = None,
    budget: float | None = None,
    output: str | None = None,
) -> int:
    """Fit, print, write the values; the exit code.

    Raises:
        BadInput, SimulatorError: what cannot be; one sentence.
    """
    labels, files = begins_with(sim, profile)
    assert sim is not None  # or it was refused
    (sim,), builds = read_names([sim], Path.cwd())
    chosen = Selection((sim,), ("headless",), labels, pythons=builds, named=(sim,), files=files)
    check(chosen, makes=False)
    variant = Variant(sim, "headless", labels[0])
    world = read_scene_file(scene).scene
    told = read_log(log, world)
    for line in beyond(told, world):
        print(for_terminal(f"{log}: {line}"), file=sys.stderr)
    with refusing(SceneError, log):
        begun(world, told)
    sought = unknowns(list(chain.from_iterable(unknown or ())), world, told)
    parts = (variant.simulator, Path(scene).stem, variant.profile, told.digest, noise, *sought)
    path = Path(output) if output else Path(RUNS) / folder_name(parts, "fit")
    case = chosen.case(variant, test="fit", folder=path, seed=FIRST_CHOSEN)
    if case.base == FILE:
        raise BadInput("the profile file loads the scene as it is written; choose another to fit")
    with closing(LocalExecutor(1)) as executor, runs_in(path, executor, "fit") as runs:
        ends = time.monotonic() + (budget or BUDGET)

        def run(task: Fitting, name: str) -> Record:
            if time.monotonic() + runs.spent > ends:
                raise _OutOfTime
            test = f"fit[{case.simulator}-{case.mode}-{name}]"
            own = replace(case, test=test, function="fit", variant=name)
            return runs.records(Experiment(own, task), [1])[1]

        (path / RESULT).unlink(missing_ok=True)  # until it is told anew
        fitting = Fit(world, told, sought, noise, run)
        try:
            found = fitting.best()
            results = list(told_of(fitting, found))
        except (KeyboardInterrupt, _OutOfTime) as ended:
            late = isinstance(ended, _OutOfTime)
            why = "the budget is used up" if late else "interrupted"
            same = "the same command with a larger --budget" if late else "the same command"
            print(f"{why} after {fitting.looks} repetitions; {same} goes on")
            return INTERRUPTED
        print(for_terminal("\n".join(_lines(results, fitting, found))))
        with refusing(OSError, str(path)):
            write_whole(path, RESULT, _written(results, found).encode())
        print(f"values: {shown(path / RESULT, Path.cwd())}")
    return 0


class _OutOfTime(Exception):
    pass


def _lines(results: Sequence[Told], fitting: Fit, found: State) -> Iterator[str]:
    rows = [("", "value", "95 % interval", "scene", "")]
    for one in results:
        ends = f"{significant(one.low, 4)} to {significant(one.high, 4)}"
        determined = (significant(one.value, 4), ends) if not one.why else ("not determined", "")
        rows.append((one.unknown.name, *determined, significant(one.unknown.value, 4), one.why))
    yield from (*aligned(rows), "")
    assert fitting.first is not None  # it was looked at
    for metric in Fitting(fitting.scene, fitting.log).metrics:
        values = fitting.first.metrics.get(metric.name), found.record.metrics[metric.name]
        before, after = ("-" if value is None else significant(value) for value in values)
        yield f"{metric.title}: {before} {metric.unit} before, {after} {metric.unit} after"
    for name, times in fitting.misfit(found.columns).items():
        off = f"{name} is {significant(times)} times the noise off"
        yield f"{off}: no values were found that explain it"
    for name, text in _warned(results, found).items():
        yield f"{name} may be wrong where such surfaces touch: {text}"
    yield f"{fitting.looks} repetitions"


def _warned(results: Sequence[Told], found: State) -> dict[str, str]:
    """By the name of a friction that was sought: that pairs do not have the scene's."""
    told = "; ".join(text for text in found.record.deviations if text.startswith(OF_PAIRS))
    names = (one.unknown.name for one in results)
    return {name: told for name in names if told and name.startswith("friction:")}


def _written(results: Sequence[Told], found: State) -> str:
    rows: dict[str, dict[str, float | str]] = {
        one.unknown.name: {"value": one.value, "low": one.low, "high": one.high}
        for one in results
        if not one.why
    }
    for name, text in _warned(results, found).items():
        if name in rows:
            rows[name]["warning"] = text
    return json.dumps(rows, indent=1) + "\n"
