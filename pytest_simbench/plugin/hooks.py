"""pytest's hooks. Loaded in every pytest run where the package is installed, so it stays light."""

from __future__ import annotations

import os
import sys
from collections.abc import Collection, Generator
from typing import TYPE_CHECKING, Any

import pytest

from pytest_simbench.plugin import harmless, options, spellings

if TYPE_CHECKING:
    from pytest_simbench.plugin.compare import Comparison
    from pytest_simbench.plugin.run import Run
    from pytest_simbench.plugin.selection import Selection

RUN = pytest.StashKey["Run"]()
SELECTION = pytest.StashKey["Selection"]()
COMPARISON: pytest.StashKey[Comparison] = pytest.StashKey()
SAVED = pytest.StashKey[list[dict[str, Any]]]()
PROBLEMS = pytest.StashKey[list[str]]()
"""What is wrong with marks, found while tests are made of them; told when all are."""

MARKS = (
    "only_sim(*names): run only on these simulators",
    "skip_sim(*names, reason=): do not run on these simulators",
    "xfail_sim(name, reason=): expected to fail on this simulator",
    "needs(*capabilities): run only on simulators that have these capabilities",
    "reps(n): repetitions of this test, unless --reps is given",
    "sim_timeout(seconds): time-out of a repetition, unless --sim-timeout is given",
)


NAMING = ("sim_name", "sim_profile", "sim_set", "sim_python", "sim_spec")
"""Options whose values name simulators: they are held against the adapters, which takes imports."""


def pytest_addoption(parser: pytest.Parser, pluginmanager: pytest.PytestPluginManager) -> None:
    """Only where a conftest has loaded us (`pytest_plugins`), which is later than the next hook."""
    pluginmanager.register(harmless, "simbench-harmless")
    config = pluginmanager.get_plugin("pytestconfig")
    if config is not None and any(map(is_conftest, pluginmanager.get_plugins())):
        spellings.register(parser, config)


def is_conftest(plugin: object) -> bool:
    """Whether a plugin is a conftest.py."""
    return os.path.basename(getattr(plugin, "__file__", None) or "") == "conftest.py"


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_load_initial_conftests(
    early_config: pytest.Config, parser: pytest.Parser, args: list[str]
) -> Generator[None, Any, Any]:
    """Register the options when all plugins and conftests have taken the names they want."""
    ours = spellings.without_ours(args)
    if ours != args:
        known = early_config.known_args_namespace
        known.file_or_dir = parser.parse_known_args(ours).file_or_dir
    try:
        return (yield)
    finally:  # also where a conftest does not import: --help goes on then
        spellings.register(parser, early_config)


def pytest_configure(config: pytest.Config) -> None:
    for mark in MARKS:
        config.addinivalue_line("markers", mark)
    from pytest_simbench.plugin import fixtures

    config.pluginmanager.register(fixtures.beside(config.pluginmanager), "simbench-fixtures")
    if config.getoption("help") or config.getoption("version"):
        return
    options.values(config)  # complain of bad input before anything is collected
    if options.mentioned(config, NAMING) or any(
        options.given(config, option.name) for option in options.OPTIONS
    ):
        selection(config)


def selection(config: pytest.Config) -> Selection:
    """What the user asked for, checked once."""
    if SELECTION not in config.stash:
        from pytest_simbench.plugin.selection import select

        config.stash[SELECTION] = select(config)
    return config.stash[SELECTION]


def run(config: pytest.Config) -> Run:
    """The run of this process."""
    if RUN not in config.stash:
        from pytest_simbench.plugin.run import Run

        config.stash[RUN] = Run(config)
    return config.stash[RUN]


@pytest.hookimpl(optionalhook=True)
def pytest_benchmark_compare_machine_info(config: pytest.Config, compared_benchmark: Any) -> None:
    """Keep the saved run that `--benchmark-compare` chose; of several, the newest comes last."""
    config.stash.setdefault(SAVED, []).append(compared_benchmark)


@pytest.hookimpl(tryfirst=True)  # before xdist starts its workers
def pytest_sessionstart(session: pytest.Session) -> None:
    """Complain of a bad baseline, limit, threshold or run folder before anything runs."""
    config = session.config
    if options.given(config, "sim_threshold"):
        from pytest_simbench.plugin.thresholds import bad_value

        if wrong := bad_value(options.value(config, "sim_threshold")):
            raise pytest.UsageError(wrong)
    named = any(options.given(config, name) for name in ("sim_output", "sim_resume"))
    if named and not (hasattr(config, "workerinput") or config.option.collectonly):
        run(config).claim()
    asked = options.value(config, "sim_compare_fail") or options.value(config, "sim_baseline")
    if hasattr(config, "workerinput") or not (asked or SAVED in config.stash):
        return
    from pytest_simbench.plugin.compare import prepare

    comparison = prepare(config, config.stash.get(SAVED, []))
    if comparison is not None:
        config.stash[COMPARISON] = comparison


def pytest_cmdline_main(config: pytest.Config) -> int | None:
    if options.given(config, "sim_install"):
        return _install(options.value(config, "sim_install"))
    if options.given(config, "sim_merge"):
        options.values(config)
        from pytest_simbench.plugin.merge import merge_runs

        return merge_runs(config)
    if options.given(config, "sim_report"):
        options.values(config)
        from pytest_simbench.plugin.merge import report_runs

        return report_runs(config)
    if not options.given(config, "sim_list"):
        return None
    from pytest_simbench.report.simulators import list_simulators

    for line in [*list_simulators(selection(config)), *spellings.foreign(config)]:
        print(line)
    return 0


def _install(names: list[str]) -> int:
    from pytest_simbench.client.environments import Environment
    from pytest_simbench.simulator.errors import SimulatorError
    from pytest_simbench.simulator.registry import adapter

    try:
        for name in names:
            environment = Environment.of(adapter(name).info)
            if environment.problem:
                environment.create()
            print(f"{name}: {environment.info.title} {environment.version()} is ready")
    except SimulatorError as error:
        raise pytest.UsageError(str(error)) from None
    return 0


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "sim_case" not in metafunc.fixturenames:
        return
    from pytest_simbench.plugin.selection import NOTHING, number_mark, parameters

    node, config = metafunc.definition, metafunc.config
    try:
        for name in ("reps", "sim_timeout"):
            number_mark(node, name)
        chosen = parameters(metafunc, selection(config))
    except pytest.UsageError as error:
        if hasattr(config, "workerinput"):  # the end of an xdist worker would be an internal error
            raise
        config.stash.setdefault(PROBLEMS, []).append(str(error))
        chosen = [NOTHING]
    metafunc.parametrize("sim_case", chosen, indirect=True, scope="session")


@pytest.hookimpl(tryfirst=True)  # before -k and -m leave out tests
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if problems := config.stash.get(PROBLEMS, []):
        raise pytest.UsageError("\n".join(dict.fromkeys(problems)))
    timed = [item for item in items if "simbench_rounds" in _fixtures(item)]
    if timed:
        _time_by_workers(config, timed)


def _time_by_workers(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Have pytest-benchmark, where it is at work, take the workers' seconds as its time."""
    from pytest_simbench.plugin.fixtures import has_benchmark
    from pytest_simbench.plugin.worker_clock import worker_clock

    for item in items if has_benchmark(config.pluginmanager) else ():
        group = item.name.partition("[")[0]
        item.add_marker(pytest.mark.benchmark(timer=worker_clock, group=group))


def pytest_report_collectionfinish(config: pytest.Config, items: list[pytest.Item]) -> list[str]:
    """Which of our options go by another name here, where there are tests of simulators."""
    ours = any("sim_case" in _fixtures(item) for item in items)
    return spellings.foreign(config) if ours else []


def _fixtures(item: pytest.Item) -> Collection[str]:
    found: Collection[str] = getattr(item, "fixturenames", ())
    return found


def pytest_collection_finish(session: pytest.Session) -> None:
    """Complain of a run folder that the ini file names, if a test needs one, before it runs."""
    config = session.config
    if hasattr(config, "workerinput") or config.option.collectonly:
        return
    if any("sim_case" in _fixtures(item) for item in session.items):
        run(config).claim()


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Tell an xdist worker which run folder all of them share, and why it cannot be used."""
    this = run(node.config)
    this.problem = this.problem or this.occupied()
    node.workerinput["simbench_folder"] = str(this.folder.path.absolute())
    node.workerinput["simbench_problem"] = this.problem


def _skipping_unavailable() -> Generator[None, Any, Any]:
    """A test that asks for what this machine lacks is skipped, with the reason."""
    try:
        return (yield)
    except Exception as error:
        errors = sys.modules.get("pytest_simbench.client.errors")
        if errors is not None and isinstance(error, errors.Unavailable):
            pytest.skip(error.what)
        raise


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, Any, Any]:
    return (yield from _skipping_unavailable())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, Any, Any]:
    return (yield from _skipping_unavailable())


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: Any) -> Any:
    outcome = yield
    if call.when == "call" and RUN in item.config.stash:
        this = run(item.config)
        lines = this.of_test(item.nodeid)
        if lines:
            outcome.get_result().simbench = lines


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    found = getattr(report, "simbench", None)
    if found:
        _received.append(found)


_received: list[list[str]] = []
"""Records that came with reports; taken over when the session ends."""


@pytest.hookimpl(trylast=True)  # xdist has heard all its workers then
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Compare with the baseline; a metric that is worse than allowed fails the run, and so does a
    threshold of a metric that no test has."""
    config = session.config
    for found in _received:
        run(config).receive(found)
    _received.clear()
    if RUN not in config.stash or hasattr(config, "workerinput"):
        return
    this = run(config)
    this.complete()
    if COMPARISON in config.stash and this.reading.records:
        comparison = config.stash[COMPARISON]
        comparison.make(this.reading)
        if comparison.failed and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED
    this.check_thresholds(session)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    config = terminalreporter.config
    if hasattr(config, "workerinput"):  # an xdist worker has a reporter too, which nobody reads
        return
    comparison = config.stash.get(COMPARISON, None)
    if RUN in config.stash:
        markdown = comparison.markdown() if comparison else ""
        config.stash[RUN].summarise(terminalreporter, markdown)
    if comparison:
        terminalreporter.write_sep("=", "comparison with the baseline")
        terminalreporter.write_line(comparison.text(terminalreporter._tw.fullwidth))


def pytest_unconfigure(config: pytest.Config) -> None:
    if RUN in config.stash:
        config.stash[RUN].close()
