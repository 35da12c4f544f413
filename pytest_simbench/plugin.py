"""pytest's hooks. Loaded in every pytest run where the package is installed, so it stays light."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from pytest_simbench import options

if TYPE_CHECKING:
    from pytest_simbench.run import Run
    from pytest_simbench.selection import Selection

RUN = pytest.StashKey["Run"]()
SELECTION = pytest.StashKey["Selection"]()

MARKS = (
    "only_sim(*names): run only on these simulators",
    "skip_sim(*names, reason=): do not run on these simulators",
    "xfail_sim(name, reason=): expected to fail on this simulator",
    "needs(*capabilities): run only on simulators that have these capabilities",
    "reps(n): repetitions of this test, unless --reps is given",
    "sim_timeout(seconds): time-out of a repetition, unless --sim-timeout is given",
)


def pytest_addoption(parser: pytest.Parser) -> None:
    options.add_options(parser)


def pytest_configure(config: pytest.Config) -> None:
    for mark in MARKS:
        config.addinivalue_line("markers", mark)
    from pytest_simbench import fixtures

    config.pluginmanager.register(fixtures, "simbench-fixtures")
    if any(config.getoption(option.name) is not None for option in options.OPTIONS):
        selection(config)  # complain of bad input before anything is collected


def selection(config: pytest.Config) -> Selection:
    """What the user asked for, checked once."""
    if SELECTION not in config.stash:
        from pytest_simbench.selection import check_numbers, select

        check_numbers(config)
        config.stash[SELECTION] = select(config)
    return config.stash[SELECTION]


def run(config: pytest.Config) -> Run:
    """The run of this process."""
    if RUN not in config.stash:
        from pytest_simbench.run import Run

        config.stash[RUN] = Run(config)
    return config.stash[RUN]


def pytest_cmdline_main(config: pytest.Config) -> int | None:
    if config.getoption("sim_install"):
        return _install(config.getoption("sim_install"))
    if not config.getoption("sims_list"):
        return None
    from pytest_simbench.report.simulators import list_simulators

    for line in list_simulators(selection(config)):
        print(line)
    return 0


def _install(names: list[str]) -> int:
    from pytest_simbench.client.environments import Environment
    from pytest_simbench.simulator.errors import SimulatorError
    from pytest_simbench.simulator.registry import adapter

    try:
        for name in [part for text in names for part in text.split(",")]:
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
    from pytest_simbench.selection import number_mark, parameters

    node = metafunc.definition
    for name in ("reps", "sim_timeout"):
        number_mark(node, name)
    chosen = parameters(metafunc, selection(metafunc.config))
    metafunc.parametrize("sim_case", chosen, indirect=True, scope="session")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if "repeat" in getattr(item, "fixturenames", ()):
            from pytest_simbench.fixtures import worker_clock

            group = item.name.partition("[")[0]
            item.add_marker(pytest.mark.benchmark(timer=worker_clock, group=group))


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Tell an xdist worker which run folder all of them share."""
    node.workerinput["simbench_folder"] = str(run(node.config).folder.absolute())


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: Any) -> Any:
    outcome = yield
    if call.when == "call" and RUN in item.config.stash:
        lines = run(item.config).of_test(item.nodeid)
        if lines:
            outcome.get_result().simbench_records = lines


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    _received.extend(getattr(report, "simbench_records", ()))


_received: list[str] = []
"""Records that came with reports; taken over when the session ends."""


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    config = terminalreporter.config
    if _received:
        run(config).receive(_received)
        _received.clear()
    if RUN in config.stash:
        config.stash[RUN].summarise(terminalreporter)


def pytest_unconfigure(config: pytest.Config) -> None:
    if RUN in config.stash:
        config.stash[RUN].close()
