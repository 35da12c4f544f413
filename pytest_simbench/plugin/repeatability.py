"""What the fixtures `replay` and `perturb` do, and the tables at the end of the run."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.client.display import Displays
from pytest_simbench.client.errors import DisplayError
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.ground.names import file_name
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.records.repeatability import NAME, Kind, Line, append
from pytest_simbench.records.series import short, step_text
from pytest_simbench.repeatability import search, stability
from pytest_simbench.repeatability.agreement import FOLDER, Sample
from pytest_simbench.repeatability.episode import Episodes
from pytest_simbench.repeatability.perturbation import Perturbation
from pytest_simbench.repeatability.replay import Replay, replay
from pytest_simbench.repeatability.search import Finding
from pytest_simbench.repeatability.stability import Sensitivity, Stability
from pytest_simbench.report.files import write_tables
from pytest_simbench.report.terminal.parts import render_tables as render_terminal
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks.base import Task


def replayed(experiment: Experiment, displays: Displays, jobs: int, **options: Any) -> Replay:
    """Run the first seed of an experiment, and again in every way.

    Args:
        displays: for a window, if the case has none.
        jobs: how many workers may run side by side.
        options: of `replay`.
    """
    case, info = experiment.case, adapter(experiment.case.simulator).info
    other_mode = _other_mode(case, info.modes, displays)
    with ExitStack() as stack:

        def handle(case: Case) -> SimulatorHandle:
            return stack.enter_context(closing(SimulatorHandle(case)))

        episodes = Episodes(experiment, handle(case))
        result = replay(
            episodes,
            capabilities=info.capabilities,
            fresh=handle(case),
            other_mode=other_mode if isinstance(other_mode, str) else handle(other_mode),
            jobs=jobs,
            **options,
        )
    task, label = episodes.task, f"{case.simulator} {case.mode} {case.profile}"
    robot = case.robot.name if case.robot else ""
    step = step_text(case.changes["timestep"]) if case.own_timestep else ""
    sample = replace(
        Sample.of(result.first, label, task.name, case.seed),
        test=", ".join(filter(None, (short(case.function), case.variant, robot, step))),
        parameters=json.dumps(task.parameters()),
    )
    name = file_name(short(case.test), case.test, task.name, sample.parameters)
    try:
        sample.save(case.folder, f"{FOLDER}/{name}.npz")
    except OSError as error:  # a full disk hides no result
        warnings.warn(f"{name}.npz is not compared with other simulators: {error}", stacklevel=2)
    _keep("replay", episodes, result.to_wire())
    return result


def _other_mode(case: Case, modes: tuple[str, ...], displays: Displays) -> Case | str:
    """The same in the mode that the test does not run in, or why there is none."""
    other = "headless" if case.mode == "gui" else "gui"
    if other not in modes:
        return f"{case.simulator} has no window"
    if other == "headless":
        return replace(case, mode=other, display=None)
    try:
        displays.environment()
    except DisplayError as reason:
        return str(reason)
    return replace(case, mode=other, display=displays)


def _keep(kind: Kind, episodes: Episodes, result: Mapping[str, Any]) -> None:
    case, constructed = episodes.experiment.case, episodes.handle.constructed
    line = Line(
        kind,
        case.test,
        case.simulator,
        case.mode,
        case.profile,
        episodes.task.name,
        case.seed,
        {**constructed.settings, **episodes.experiment.task.parameters()},
        constructed.versions,
        result,
    )
    for problem in append(case.folder, line).problems:  # a full disk hides no result
        warnings.warn(problem, stacklevel=2)


@dataclass(frozen=True)
class Perturber:
    """One task in one simulator, to be perturbed; what `perturb(task)` gives."""

    episodes: Episodes
    strict: bool

    @property
    def task(self) -> Task:
        """The task that is run: the version that `--protocol` asks for."""
        return self.episodes.task

    def search(self, bounds: Mapping[str, float] | None = None, **options: Any) -> Finding:
        """The smallest perturbation that changes the outcome, see `search.search`."""
        finding = search.search(self.episodes, bounds, **options)
        _keep("search", self.episodes, search.to_wire(finding))
        return finding

    def stability(self, bounds: Mapping[str, float] | None = None, **options: Any) -> Stability:
        """What random perturbations leave, see `stability.stability`."""
        if self.episodes.experiment.case.protocol.smallest:
            options["examples"] = min(5, options.get("examples", 5))
        result = stability.stability(self.episodes, bounds, **options)
        result = replace(result, strict=self.strict)
        _keep("stability", self.episodes, result.to_wire())
        return result

    def sensitivity(self, body: str, steps: int = 1, **options: Any) -> Sensitivity:
        """Growth of a displacement of a body by `steps` times 0.1 mm in x. Takes `moments=` in
        place of those that the task declares."""
        displaced = Perturbation("x", steps, body)
        result = stability.sensitivity(self.episodes, displaced, **options)
        _keep("sensitivity", self.episodes, result.to_wire())
        return result


def summarise(reporter: pytest.TerminalReporter, folder: Path) -> None:
    """Print the tables of what is in the run folder, and write them there."""
    found, problems = write_tables(folder, folder)
    if found:
        reporter.write_sep("=", "repeatability")
        reporter.write_line(render_terminal(found, reporter._tw.fullwidth))
        problems.append(f"\nresults on repeatability: {folder / NAME}")
    for line in problems:
        reporter.write_line(for_terminal(line))
