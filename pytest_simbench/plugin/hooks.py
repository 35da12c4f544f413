"""pytest's hooks before there is a `SimSession`, which has the others, and of each test. Loaded in
every pytest run where the package is installed, so it stays light."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Generator
from typing import Any

import pytest

from pytest_simbench.plugin import inputs, old_options, registration, sanitise
from pytest_simbench.plugin.session import REPEATED, session_of

MARKS = (
    "only_sim(*names): run only on these simulators",
    "skip_sim(*names, reason=): do not run on these simulators",
    "xfail_sim(name, reason=): expected to fail on this simulator",
    "needs(*capabilities): run only on simulators that have these capabilities",
    "reps(n): repetitions of this test, unless --reps is given",
    "policies(task, *names): the test's `policy` is each of --policies for this task, or for none "
    "in particular; without that option, of the shipped ones those of these names",
    "repeats(parameter): the test repeats the task that this parameter holds; with --sim-jobs it "
    "may begin before the test does",
    "sim_conformance(kit): one test of each law of the conformance kit, see conformance_checks",
    "sim_timeout(seconds): time-out of a repetition, unless --sim-timeout is given",
    "sim_crashes(share): share of repetitions that may crash, unless --sim-crashes is given",
)


def pytest_addoption(parser: pytest.Parser, pluginmanager: pytest.PytestPluginManager) -> None:
    """Only where a conftest has loaded us (`pytest_plugins`), which is later than the next hook."""
    pluginmanager.register(sanitise, "simbench-sanitise")
    config = pluginmanager.get_plugin("pytestconfig")
    if config is not None and any(map(registration.is_conftest, pluginmanager.get_plugins())):
        registration.register(parser, config)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_load_initial_conftests(
    early_config: pytest.Config, parser: pytest.Parser, args: list[str]
) -> Generator[None, Any, Any]:
    """Register the options when all plugins and conftests have taken the names they want."""
    ours = registration.without_ours(args)
    if ours != args:
        known = early_config.known_args_namespace
        known.file_or_dir = parser.parse_known_args(ours).file_or_dir
    try:
        return (yield)
    finally:  # also where a conftest does not import: --help goes on then
        registration.register(parser, early_config)


def pytest_configure(config: pytest.Config) -> None:
    for mark in MARKS:
        config.addinivalue_line("markers", mark)
    from pytest_simbench.plugin import fixtures

    session = session_of(config)
    config.pluginmanager.register(session, "simbench-session")
    config.pluginmanager.register(fixtures.free_fixtures(config.pluginmanager), "simbench-fixtures")
    if not (config.getoption("help") or config.getoption("version")):
        session.check_options()
        inputs.run_suite(config)


def pytest_cmdline_main(config: pytest.Config) -> int | None:
    old = old_options.asked(config)
    return None if old is None else old_options.run_command(config, old)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup() -> Generator[None, Any, Any]:
    """A test that asks for what machine or simulator lacks is skipped, with the reason."""
    try:
        return (yield)
    except Exception as error:
        errors = sys.modules.get("pytest_simbench.client.errors")
        if errors is not None and isinstance(error, errors.Unavailable):
            pytest.skip(error.what)
        raise


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, Any, Any]:
    """So is one that asks for it later; one whose repetitions crashed fails."""
    found = yield from pytest_runtest_setup()
    if REPEATED in item.stash:
        item.stash[REPEATED].check_crashes()
    return found


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_keyboard_interrupt() -> Generator[None, Any, Any]:
    """A second Ctrl-C while pytest lists the calls of the first, which takes it a second, is the
    same wish: it would end pytest with its own traceback."""
    from pytest_simbench.experiment.interrupts import Interrupts

    with Interrupts() as interrupts:
        interrupts.hold()
        found = yield
        interrupts.forget()
    return found


@pytest.hookimpl(wrapper=True, tryfirst=True)  # around the summary and the last teardown, too
def pytest_sessionfinish(session: pytest.Session) -> Generator[None, Any, Any]:
    """Ctrl-C ends what is left to do with one sentence; a file that was asked for and could not be
    written fails the run."""
    ours = session_of(session.config)
    try:
        found = yield
    except KeyboardInterrupt:
        if not ours.begun or ours.in_worker:
            raise
        folder = ours.run.folder.path
        pytest.exit(
            f"interrupted while the report was made; the records are kept in {folder}, and "
            f"simbench report {shlex.quote(str(folder))} makes the report",
            returncode=pytest.ExitCode.INTERRUPTED,
        )
    if ours.begun and ours.run.unwritten and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
    return found
