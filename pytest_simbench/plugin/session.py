"""What the plugin knows of one pytest run: one object a config, which hooks and fixtures ask.

Imported at plugin load: standard library and pytest only; everything else is imported late.
"""

from __future__ import annotations

from collections.abc import Collection, Generator
from contextlib import suppress
from functools import cached_property
from typing import TYPE_CHECKING, Any

import pytest

from pytest_simbench.plugin import cluster, inputs, options, recording

if TYPE_CHECKING:
    from pytest_simbench.cli.selection import Selection
    from pytest_simbench.plugin.compare import Comparison
    from pytest_simbench.plugin.run import Run

NAMING = ("sim_name", "sim_robot", "sim_profile", "sim_set", "sim_python", "sim_spec")
"""Options whose values name simulators or robots: they are held against what is registered, which
takes imports."""


class SimSession:
    """One pytest process, from its options to its summary. Also a plugin: most of pytest's hooks
    are its own.

    Attributes:
        config: of the process.
        saved: contents of the pytest-benchmark files that `--benchmark-compare` chose.
        problems: what is wrong with marks, found while tests are made of them; told when all are.
        comparison: with the baseline, if there is one.
    """

    def __init__(self, config: pytest.Config) -> None:
        self.config = config
        self.saved: list[dict[str, Any]] = []
        self.problems: list[str] = []
        self.comparison: Comparison | None = None
        self._received: list[str] = []
        self._failed: dict[str, dict[str, Any]] = {}
        self._passed: set[str] = set()
        self._skipped: set[str] = set()
        self._exit_status: int = pytest.ExitCode.OK

    @cached_property
    def selection(self) -> Selection:
        """What the user asked for, checked once."""
        from pytest_simbench.plugin.selection import select

        return select(self.config)

    @cached_property
    def policies(self) -> list[Any]:
        """Those of `--policies`, read once."""
        from pytest_simbench.plugin.policies import read

        return read(self.config)

    @cached_property
    def run(self) -> Run:
        """The run of this process; it begins when somebody asks for it."""
        from pytest_simbench.plugin.run import Run

        return Run(self.config)

    @property
    def begun(self) -> bool:
        """Whether anybody has asked for the run."""
        return "run" in vars(self)

    @property
    def in_worker(self) -> bool:
        """Whether this process is a worker of pytest-xdist."""
        return hasattr(self.config, "workerinput")

    @property
    def _alone(self) -> bool:
        """Whether this process runs tests, or leads those that do."""
        return not (self.in_worker or self.config.option.collectonly)

    def check_options(self) -> None:
        """Complain of bad input before anything is collected."""
        config = self.config
        options.values(config)
        if options.mentioned(config, NAMING) or any(
            options.given(config, item.name) for item in options.OPTIONS
        ):
            _ = self.selection
        if options.mentioned(config, ["sim_policies"]):
            _ = self.policies

    @pytest.hookimpl(tryfirst=True)  # before xdist starts its workers
    def pytest_sessionstart(self) -> None:
        """Complain of a bad baseline, limit, threshold or folder before anything runs."""
        config = self.config
        if options.given(config, "sim_threshold"):
            from pytest_simbench.plugin.thresholds import bad_value, typed

            if wrong := bad_value(typed(config)):
                raise pytest.UsageError(wrong)
        if not self.in_worker:
            inputs.check(config)
            recording.check(config)
        named = any(options.given(config, name) for name in ("sim_output", "sim_resume"))
        if named and self._alone:
            self.run.lock()
        asked = options.value(config, "sim_compare_fail") or options.value(config, "sim_baseline")
        if not self.in_worker and (asked or self.saved):
            from pytest_simbench.plugin.compare import prepare

            named = options.value(config, "sim_baseline") is not None
            names = self.selection.simulators if named else ()
            self.comparison = prepare(config, self.saved, names)

    @pytest.hookimpl(optionalhook=True)
    def pytest_benchmark_compare_machine_info(self, compared_benchmark: Any) -> None:
        """Keep the saved run of `--benchmark-compare`; of several, the newest comes last."""
        self.saved.append(compared_benchmark)

    def pytest_generate_tests(self, metafunc: pytest.Metafunc) -> None:
        """Make a test of each simulator and mode, of each law of the conformance kit, of each robot
        where there are several, and of each policy."""
        wanted, marked = metafunc.fixturenames, metafunc.definition.get_closest_marker
        if "sim_case" in wanted:
            self._parametrize(metafunc)
        elif kit := marked("sim_conformance"):
            tests = kit.args[0].tests(self.selection.robots.values())
            metafunc.parametrize("check", [pytest.param(test, id=test.id) for test in tests])
        elif "simbench_robot" in wanted and self.selection.every_robot:
            robots = list(self.selection.robots)
            ids = [name or "panda" for name in robots]
            metafunc.parametrize("simbench_robot", robots, ids=ids, indirect=True, scope="session")
        if "policy" in wanted and marked("policies"):
            from pytest_simbench.plugin.policies import parametrize

            parametrize(metafunc, self.policies)

    def _parametrize(self, metafunc: pytest.Metafunc) -> None:
        """Make a test of each simulator and mode, as its marks say."""
        from pytest_simbench.plugin.marks import NOTHING, NUMBERS, number_mark, parameters

        try:
            for name in NUMBERS:
                number_mark(metafunc.definition, name)
            chosen = parameters(metafunc, self.selection)
        except pytest.UsageError as error:
            if self.in_worker:  # the end of an xdist worker would be an internal error
                raise
            self.problems.append(str(error))
            chosen = [NOTHING]
        names = ["sim_case"]
        if "simbench_robot" in metafunc.fixturenames and self.selection.every_robot:
            names.append("simbench_robot")
            chosen = [
                pytest.param(*case.values, case.values[0].robot, id=case.id, marks=case.marks)
                for case in chosen
            ]
        metafunc.parametrize(names, chosen, indirect=True, scope="session")

    @pytest.hookimpl(tryfirst=True)  # before -k and -m leave out tests
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Complain of marks, and have pytest-benchmark take the workers' seconds."""
        if self.problems:
            raise pytest.UsageError("\n".join(dict.fromkeys(self.problems)))
        if ours := [item for item in items if "sim_case" in fixtures_of(item)]:
            from pytest_simbench.plugin.marks import skip_what_parameters_need

            skip_what_parameters_need(ours)
        if timed := [item for item in items if "simbench_rounds" in fixtures_of(item)]:
            from pytest_simbench.plugin.benchmark import time_by_workers

            time_by_workers(self.config.pluginmanager, timed)

    def pytest_report_collectionfinish(self, items: list[pytest.Item]) -> list[str]:
        """Which of our options go by another name here, where there are tests of simulators."""
        ours = any("sim_case" in fixtures_of(item) for item in items)
        return options.taken_names(self.config) if ours else []

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Complain of a run folder that the ini file names, if a test needs one, before it runs."""
        if self._alone and any("sim_case" in fixtures_of(item) for item in session.items):
            self.run.lock()

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        """Tell an xdist worker which run folder all share, why it cannot be used, and where the
        slots of `--sim-jobs` are given out."""
        run = self.run
        if run.slots is not None:
            node.workerinput["simbench_slots"] = run.slots.address
        if options.mentioned(self.config, ["sim_output", "sim_history"]):  # no new folder
            with suppress(pytest.fail.Exception):  # for the tests that need it
                run.use()
        node.workerinput["simbench_folder"] = str(run.folder.path.absolute())
        node.workerinput["simbench_problem"] = run.problem

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item) -> Generator[None, Any, Any]:
        """Have a test's records travel with its report, to an xdist controller for instance; and of
        one that failed what it was of."""
        report = yield
        if not self.begun:
            return report
        if report.when == "call" and (lines := self.run.of_test(item.nodeid)):
            report.simbench = lines
        if report.when == "call" and REPEATED in item.stash:
            item.stash[REPEATED].ends.add(report.outcome)
        report.simbench_told = dict(self.run.told)
        if report.failed and hasattr(item, "callspec") and "sim_case" in fixtures_of(item):
            from pytest_simbench.plugin.marks import describe_failure

            report.simbench_failed = describe_failure(item, report, len(self.selection.profiles))
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep what came with a report until all tests have ended."""
        self._received += getattr(report, "simbench", ())
        if told := getattr(report, "simbench_told", None):
            self.run.told |= told
        if report.when == "setup":
            self._failed.pop(report.nodeid, None)  # of an earlier attempt
        failed = getattr(report, "simbench_failed", None)
        if failed and not self.in_worker:
            self._failed[report.nodeid] = failed
        if report.when == "call" and self.begun:
            self.run.judged.add(report.nodeid)
        if not report.failed and (report.when == "call" or hasattr(report, "wasxfail")):
            self._passed.add(report.nodeid)
        if report.skipped and not hasattr(report, "wasxfail"):
            self._skipped.add(report.nodeid)

    @pytest.hookimpl(trylast=True)  # xdist has heard all its workers then
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Compare with the baseline; a metric that is worse than allowed fails the run, and so do
        a limit that compared nothing and a threshold that no test asked for."""
        if self._received:
            self.run.receive(self._received)
        if self.in_worker:
            return
        if self.begun:
            self.run.judge(self._failed.values(), self._passed)
            self.run.complete()
        if self.comparison is not None and self._alone:
            from pytest_simbench.records.folder import RunContents

            reading = self.run.reading if self.begun else RunContents()
            if reading.records or self.comparison.typed:
                self.comparison.make(reading, self._skipped)
            if self.comparison.failed and session.exitstatus == pytest.ExitCode.OK:
                session.exitstatus = pytest.ExitCode.TESTS_FAILED
        if self.begun:
            self.run.check_thresholds(session)
        self._exit_status = session.exitstatus  # pytest gives the summary the one of before

    @pytest.hookimpl(optionalhook=True, wrapper=True)
    def pytest_benchmark_group_stats(self) -> Generator[None, Any, Any]:
        """Leave our benchmarks out of pytest-benchmark's table unless one of its options is
        given."""
        from pytest_simbench.plugin.benchmark import shown

        return shown(self.config, (yield))

    @pytest.hookimpl(wrapper=True, trylast=True)  # what is printed last is read first
    def pytest_terminal_summary(
        self, terminalreporter: pytest.TerminalReporter
    ) -> Generator[None, Any, Any]:
        """Tell the result, also where `--benchmark-compare-fail` raises."""
        try:
            return (yield)
        finally:
            if not self.in_worker:  # an xdist worker has a reporter too, which nobody reads
                self._summarise(terminalreporter)

    def _summarise(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Print the result, write the report, and say last where it is."""
        if self.begun:
            if self._exit_status == pytest.ExitCode.INTERRUPTED:
                self.run.tell_how_to_go_on()
            passed = self._exit_status == pytest.ExitCode.OK
            self.run.summarise(terminalreporter, self.comparison, passed)
        if self.comparison:
            terminalreporter.write_sep("=", "comparison with the baseline")
            terminalreporter.write_line(self.comparison.text(terminalreporter._tw.fullwidth))
        if self.begun or self.config.pluginmanager.has_plugin("dsession"):
            from pytest_simbench.records.repeatability import NAME

            if (self.run.folder.path / NAME).is_file():
                from pytest_simbench.plugin.repeatability import summarise

                summarise(terminalreporter, self.run.folder.path)
        if self.begun and self.run.page is not None:
            from pytest_simbench.report.files import where

            terminalreporter.write_line(where(self.run.page, self.config.invocation_params.dir))
        if self.begun and self.run.mistake:
            terminalreporter.write_line(f"ERROR: {self.run.mistake}", red=True)

    def pytest_unconfigure(self) -> None:
        """End what the run started."""
        cluster.leave(self.config)
        if self.begun:
            self.run.close()


REPEATED: pytest.StashKey[Any] = pytest.StashKey()
"""Of a test that repeats a task: its `RepeatFixture`."""

_SESSION = pytest.StashKey[SimSession]()


def session_of(config: pytest.Config) -> SimSession:
    """The one object of this config; it is made when it is first asked for."""
    if _SESSION not in config.stash:
        config.stash[_SESSION] = SimSession(config)
    return config.stash[_SESSION]


def fixtures_of(item: pytest.Item) -> Collection[str]:
    """Names of the fixtures that a test uses."""
    found: Collection[str] = getattr(item, "fixturenames", ())
    return found
