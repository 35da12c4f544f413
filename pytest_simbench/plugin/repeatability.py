"""The fixtures `replay` and `perturb`, and the tables at the end of the run.

Registered by the plugin; heavy imports happen late.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from pytest_simbench.plugin import options as session_options
from pytest_simbench.plugin.arguments import checked_task
from pytest_simbench.plugin.hooks import run
from pytest_simbench.records.text import for_terminal

if TYPE_CHECKING:
    from pytest_simbench.experiment.case import Case
    from pytest_simbench.experiment.handle import SimulatorHandle
    from pytest_simbench.plugin.run import Run
    from pytest_simbench.repeatability.episode import Episodes
    from pytest_simbench.repeatability.replay_result import Replay
    from pytest_simbench.repeatability.search import Finding
    from pytest_simbench.repeatability.stability import Sensitivity, Stability
    from pytest_simbench.tasks.base import Task

MARKDOWN_NAME = "repeatability.md"


@pytest.fixture
def replay(request: pytest.FixtureRequest, simbench_case: Case) -> Callable[[Task], Replay]:
    """Runs the first seed of a task again in every way: `replay(Throwing())`.

    Takes `moments=` in place of those that the task declares. The first run's motion is kept for
    the comparison between simulators.
    """
    from pytest_simbench.experiment.experiment import Experiment
    from pytest_simbench.repeatability import replay as replaying
    from pytest_simbench.repeatability.agreement import FOLDER, Sample
    from pytest_simbench.repeatability.episode import Episodes
    from pytest_simbench.simulator.info import Capability
    from pytest_simbench.simulator.registry import adapter

    def replay_task(task: Task, **options: Any) -> Replay:
        checked_task(task, "replay")
        case = simbench_case
        info = adapter(case.simulator).info
        with _Handles() as handle:
            episodes = Episodes(Experiment(case, task), handle(case))
            result = replaying.replay(
                episodes,
                claims=Capability.DETERMINISTIC in info.capabilities,
                capabilities=info.capabilities,
                fresh=handle(case),
                other_mode=_other_mode(run(request.config), case, info.modes, handle),
                jobs=session_options.value(request.config, "sim_jobs"),
                **options,
            )
        with suppress(OSError):
            sample = Sample.of(result.first, _label(case), episodes.task.name, case.seed)
            sample.save(case.folder / FOLDER / f"{case.short_name}.npz")
        _keep("replay", episodes, result.to_wire())
        return result

    return replay_task


class _Handles:
    """Handles of one test, closed at its end."""

    def __init__(self) -> None:
        self._made: list[SimulatorHandle] = []

    def __call__(self, case: Case) -> SimulatorHandle:
        from pytest_simbench.experiment.handle import SimulatorHandle

        self._made.append(SimulatorHandle(case))
        return self._made[-1]

    def __enter__(self) -> _Handles:
        return self

    def __exit__(self, *error: object) -> None:
        for handle in self._made:
            handle.close()


def _other_mode(
    this: Run, case: Case, modes: tuple[str, ...], handle: _Handles
) -> SimulatorHandle | str:
    """A handle in the mode that the test does not run in, or why there is none."""
    other = "headless" if case.mode == "gui" else "gui"
    if other not in modes:
        return f"{case.simulator} has no window"
    from pytest_simbench.client.errors import DisplayError

    if other == "gui":
        try:
            this.displays.environment()
        except DisplayError as reason:
            return str(reason)
    return handle(replace(case, mode=other, display=this.displays if other == "gui" else None))


def _label(case: Case) -> str:
    return f"{case.simulator} {case.mode} {case.profile}"


def _keep(kind: str, episodes: Episodes, result: Mapping[str, Any]) -> None:
    from pytest_simbench.records.repeatability import Line, append

    case, constructed = episodes.experiment.case, episodes.handle.constructed
    line = Line(
        kind,
        case.test,
        case.simulator,
        case.mode,
        case.profile,
        episodes.task.name,
        case.seed,
        {**constructed.settings, **episodes.experiment.parameters},
        constructed.versions,
        result,
    )
    for problem in append(case.folder, line).problems:  # a full disk hides no result
        warnings.warn(problem, stacklevel=2)


class Perturber:
    """One task in one simulator, to be perturbed; what `perturb(task)` gives."""

    def __init__(self, episodes: Episodes, strict: bool = False) -> None:
        self.episodes = episodes
        self.strict = strict

    @property
    def task(self) -> Task:
        """The task that is run: the version that `--protocol` asks for."""
        return self.episodes.task

    def search(self, bounds: Mapping[str, float] | None = None, **options: Any) -> Finding:
        """The smallest perturbation that changes the outcome, see `search.search`."""
        from pytest_simbench.repeatability import search

        finding = search.search(self.episodes, bounds, **options)
        _keep("search", self.episodes, search.to_wire(finding))
        return finding

    def stability(self, bounds: Mapping[str, float] | None = None, **options: Any) -> Stability:
        """What random perturbations leave, see `stability.stability`."""
        from pytest_simbench.repeatability import stability

        if self.episodes.experiment.case.protocol.smallest:
            options["examples"] = min(5, options.get("examples", 5))
        result = stability.stability(self.episodes, bounds, **options)
        result = replace(result, strict=self.strict)
        _keep("stability", self.episodes, result.to_wire())
        return result

    def sensitivity(self, body: str, steps: int = 1, **options: Any) -> Sensitivity:
        """Growth of a displacement of a body by `steps` times 0.1 mm in x. Takes `moments=` in
        place of those that the task declares."""
        from pytest_simbench.repeatability import stability
        from pytest_simbench.repeatability.perturbation import Perturbation

        displaced = Perturbation("x", steps, body)
        result = stability.sensitivity(self.episodes, displaced, **options)
        _keep("sensitivity", self.episodes, result.to_wire())
        return result


@pytest.fixture
def perturb(
    request: pytest.FixtureRequest, simbench_case: Case, sim_settings: dict[str, Any]
) -> Iterator[Callable[[Task], Perturber]]:
    """Perturbs the first seed of a task: `perturb(LeaningTowers()).search({"x": 0.01})`.

    All examples run in the session's worker (one of the test's own where it has `sim_settings`).
    """
    from pytest_simbench.experiment.experiment import Experiment
    from pytest_simbench.repeatability.episode import Episodes

    with _Handles() as handles:
        own = handles(simbench_case) if sim_settings else None
        handle = own or request.getfixturevalue("simbench_handle")

        strict = session_options.value(request.config, "sim_strict")

        def perturb_task(task: Task) -> Perturber:
            checked_task(task, "perturb")
            return Perturber(Episodes(Experiment(simbench_case, task), handle), strict)

        yield perturb_task


@pytest.hookimpl(trylast=True)
def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the tables, and write them to the run folder."""
    from pytest_simbench.plugin.hooks import RUN

    config = terminalreporter.config
    if RUN not in config.stash and not config.pluginmanager.has_plugin("dsession"):
        return
    folder = run(config).folder.path
    from pytest_simbench.records.repeatability import NAME

    if not (folder / NAME).is_file():
        return
    from pytest_simbench.records.repeatability import read
    from pytest_simbench.repeatability.agreement import agreements
    from pytest_simbench.report.repeatability import render_markdown, render_terminal, tables

    try:
        lines = read(folder)
        found = tables(lines.items, agreements(folder))
    except ValueError as error:
        terminalreporter.write_line(for_terminal(str(error)))
        return
    terminalreporter.write_sep("=", "repeatability")
    terminalreporter.write_line(render_terminal(found, terminalreporter._tw.fullwidth))
    for problem in (*lines.problems, *lines.refused):
        terminalreporter.write_line(for_terminal(problem))
    terminalreporter.write_line(for_terminal(f"\nresults on repeatability: {folder / NAME}"))
    with suppress(OSError):
        (folder / MARKDOWN_NAME).write_text(render_markdown(found), encoding="utf-8")
