"""A task on several simulators, without pytest: the same records in the same kind of folder."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing
from os import PathLike
from pathlib import Path
from typing import Any

from pytest_simbench.api.result import Run
from pytest_simbench.cli import values as read
from pytest_simbench.cli.names import read_names
from pytest_simbench.cli.runs import RUNS, printed
from pytest_simbench.cli.selection import (
    EVERY,
    Selection,
    check,
    checked_task,
    profiles_of,
    robots_of,
)
from pytest_simbench.cli.values import BadInput, BadValue, expect, refusing
from pytest_simbench.client.display import Displays
from pytest_simbench.client.errors import DisplayError, ExecutorError, Unavailable, WorldParityError
from pytest_simbench.experiment.case import PROTOCOLS
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment, JitterError
from pytest_simbench.experiment.repeater import Repeater
from pytest_simbench.experiment.resumed import NotResumed, Resumed, run_to_resume
from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.paths import FolderError, new_name
from pytest_simbench.records.record import RecordError
from pytest_simbench.records.tuned_on import FIRST_SEED
from pytest_simbench.report.files import write_outcome
from pytest_simbench.report.model.outcome import RunOutcome, begun, looks_at
from pytest_simbench.scene import Robot
from pytest_simbench.scene.policy import LoopError
from pytest_simbench.simulator.registry import adapter, known
from pytest_simbench.tasks.base import Task
from pytest_simbench.tasks.recorded import look_anew

REFUSED = (SimulatorError, RecordError, DisplayError, NotResumed, ExecutorError, JitterError)
"""What becomes bad input, in its own words."""


def run(
    task: Task,
    simulators: str | Iterable[str] = EVERY,
    reps: int | None = None,
    *,
    protocol: str = "fast",
    seed: int = FIRST_SEED,
    jitter: float = 1.0,
    profile: str = "tuned",
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    robot: str | Path | Robot | None = None,
    gui: bool = False,
    jobs: int | str = 1,
    timeout: float | None = None,
    folder: str | Path | None = None,
    resume: bool = False,
    quiet: bool = False,
) -> Run:
    """Repeat a task on simulators, one after the other, as `pytest` does with a test `test_TASK`.

    A repetition that crashes is recorded, and the next one begins. What a simulator cannot do at
    all stands in `Run.problems`, and the others go on. Ctrl-C (in a notebook: interrupt) keeps the
    records and ends the workers.

    Args:
        task: `Throwing()`, for instance.
        simulators: names, as `--sim` has them; all that are ready here by default.
        reps: repetitions on each; default: the task's own number, else the protocol's, 20.
        protocol: `fast`, `paper` (as the study) or `smoke` (smallest).
        seed: of the first repetition; the next ones follow.
        jitter: scale of the start jitter; 1 is 1 mm and 1 degree.
        profile: of the settings: `default`, `tuned`, `real`, a TOML file; several with commas
            between them.
        settings: that are changed, for each simulator: `{"mysim": {"timestep": 0.001}}`.
        robot: that does the task: a name, a robot file, or a robot; default: the task's own.
        gui: in the simulators' own windows.
        jobs: repetitions at once, or `auto`.
        timeout: of a repetition [s]; default: the task's own.
        folder: of the run; default: a new one in `.simbench`.
        resume: complete the run in `folder`, or the newest in `.simbench`.
        quiet: show no progress.

    Raises:
        BadInput: what cannot be, in one sentence with the valid choices.
    """
    how = {
        "protocol": PROTOCOLS[_read("protocol", protocol, read.choice(*PROTOCOLS))],
        "seed": _read("seed", seed, read.SEED),
        "jitter": _read("jitter", jitter, read.JITTER),
        "timeout": None if timeout is None else _read("timeout", timeout, read.SECONDS),
    }
    wanted = None if reps is None else _read("reps", reps, read.REPETITIONS)
    at_once = _read("jobs", jobs, read.jobs)
    look_anew()
    task, chosen = checked_task(task, "run"), _chosen(simulators, profile, settings, robot, gui)
    with (
        closing(_locked(folder, resume)) as place,
        closing(Displays()) as displays,
        closing(LocalExecutor(at_once)) as executor,
        refusing(REFUSED),
    ):
        resumed = Resumed(place) if resume else None
        problems = resumed.repair() if resumed else []
        if gui:
            displays.environment()  # there may be none
            how["display"] = displays
        for experiment in _experiments(task, chosen, problems, folder=place.path, **how):
            found = resumed.take(experiment, wanted) if resumed else {}
            place.take_over(found.values())
            place.describe(experiment.task)
            write_outcome(place.path, begun(place.path))
            repeater = Repeater(experiment, executor, printed(quiet), place.append, resumed=resumed)
            try:
                repeater.up_to(experiment.repetitions(wanted), found)
            except (Unavailable, WorldParityError, LoopError) as error:
                told = getattr(error, "what", error)  # without the place, where it has one
                problems.append(f"{experiment.case.simulator}: {told}")
            except (KeyboardInterrupt, Exception) as error:  # Ctrl-C, or a fault of the task
                error.add_note(f"records are kept: folder={str(place.path)!r}, resume=True goes on")
                raise
        contents = place.scan()
        problems += [*place.flush(), *contents.problems]
        if not contents.records:
            raise BadInput(f"nothing was simulated: {'; '.join(problems or contents.refused)}")
        looks = looks_at(place.path, resumed.records if resumed else (), contents.records)
        problems.append(write_outcome(place.path, RunOutcome(looks=looks)))
        return Run(place.path, contents, [*problems, *contents.refused])


def _read(name: str, value: object, form: Callable[[str], Any]) -> Any:
    """A value, read as the option of that name is."""
    try:
        return form(str(value))
    except BadValue as error:
        raise BadInput(error.sentence(name)) from None


def _chosen(
    simulators: str | Iterable[str],
    profile: str,
    settings: Mapping[str, Mapping[str, Any]] | None,
    robot: str | Path | Robot | None,
    gui: bool,
) -> Selection:
    """What is asked for, checked."""
    expect("simulators", simulators, Iterable, "give names of simulators, or leave it out")
    text = simulators if isinstance(simulators, str) else ",".join(map(str, simulators))
    asked = _read("simulators", text, read.simulators)
    example: dict[str, Any] = {asked[0]: {"timestep": 0.001}}
    by_name = "give those of each simulator by its name"
    expect("settings", settings or {}, Mapping, f"{by_name}, for instance {example}")
    for name, changes in (settings or {}).items():
        if not isinstance(changes, Mapping):
            example = {asked[0]: {name: changes}}
            raise BadInput(f"settings: {by_name}: {example}")
    with refusing(SimulatorError):
        names, builds = read_names([name for name in asked if name != EVERY], Path.cwd())
        profiles, files = profiles_of(_read("profile", profile, read.profiles))
        every = known() if EVERY in asked else []
        chosen = Selection(
            tuple(dict.fromkeys([*every, *names])),
            ("gui" if gui else "headless",),
            profiles,
            settings or {},
            builds,
            robots={robot.name: robot} if isinstance(robot, Robot) else robots_of(robot, "robot"),
            named=tuple(names),
            files=files,
        )
        check(chosen, makes=False)
    if len(chosen.robots) > 1:
        raise BadInput(f"robot={robot}: give one of {', '.join(filter(None, chosen.robots))}")
    if not (ready := chosen.ready()).simulators:
        raise BadInput("no simulator is ready here: `simbench list` says how to get one")
    return ready


def _experiments(
    task: Task, chosen: Selection, problems: list[str], **how: Any
) -> Iterator[Experiment]:
    """The task on each simulator that can do it; `problems` takes why another one cannot."""
    (mode,), function = chosen.modes, f"test_{task.name}"
    for variant in (v for name in chosen.simulators for v in chosen.variants(name, mode)):
        reason = chosen.missing(variant.simulator, variant.profile)
        if not reason and mode not in adapter(variant.simulator).info.modes:
            reason = f"{variant.simulator} has no window"
        if reason:
            problems.append(reason)
            continue
        test = f"{function}[{variant.id_with(len(chosen.profiles))}]"
        experiment = Experiment(chosen.case(variant, test=test, function=function, **how), task)
        if problem := experiment.problem():
            raise BadInput(f"robot: {problem}")
        yield experiment


def _locked(folder: str | Path | None, resume: bool) -> RunFolder:
    """The folder of the run, this process's own; complains of one that holds another run."""
    expect("folder", folder or "", (str, PathLike), "give the path of a folder, or leave it out")
    path = Path(folder) if folder else None  # empty: the default, as on pytest's command line
    with refusing((FolderError, NotResumed)):
        found = run_to_resume(path, Path(RUNS)) if resume else path or new_name(Path(RUNS))
        place = RunFolder(found)
        place.lock()
    if place.holds_run and not resume:
        place.release()
        raise BadInput(f"{found} already holds a run: give resume=True, or another folder")
    return place
