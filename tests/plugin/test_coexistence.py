"""The plugin beside others: options, ini names, marks and fixtures that somebody else has too."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import pytest

from pytest_simbench import __version__
from pytest_simbench.plugin.old_options import OLD_OPTIONS
from pytest_simbench.plugin.options import OPTIONS
from tests.plugin.inner import no_traceback, records, run_pytest

FLAGS = [flag for o in OPTIONS for flag in (o.flag, o.long) if flag]
FLAGS += [command.flag for command in OLD_OPTIONS]
INI = [name for option in OPTIONS for name in option.ini_names]

OWN = """
def pytest_addoption(parser):
    for flag in {flags!r}:
        parser.addoption(flag, action="store_true", dest="own_" + flag, help="the project's own")
    for name in {ini!r}:
        parser.addini(name, "the project's own", type="bool", default=True)
"""

TEST = """
FLAGS, INI = {flags!r}, {ini!r}

def test_own(pytestconfig):
    assert all(pytestconfig.getoption("own_" + flag) for flag in FLAGS)
    assert all(pytestconfig.getini(name) is True for name in INI)
"""

FALLING = """
from tests.tiny import Falling

def test_falling(repeat):
    assert len(repeat(Falling())) == 2
"""


@pytest.mark.parametrize("place", ["conftest", "before", "after"])
def test_any_of_our_names_may_be_somebody_else_s(pytester: pytest.Pytester, place: str) -> None:
    """All at once, in a conftest, in a plugin loaded before ours and in one loaded after it."""
    own = OWN.format(flags=FLAGS, ini=INI)
    pytester.makepyfile(test_own=TEST.format(flags=FLAGS, ini=INI))
    pytester.syspathinsert()
    early = () if place != "before" else ("-p", "other")
    pytester.makepyfile(**{"conftest" if place == "conftest" else "other": own})
    if place == "after":
        pytester.makeconftest("pytest_plugins = ['other']")
    run_pytest(pytester, "", *early, *FLAGS, passed=1)
    if place == "conftest":
        no_traceback(pytester.runpytest_subprocess("--help"))


def test_taken_short_names_leave_the_sure_ones(pytester: pytest.Pytester) -> None:
    short = [option.flag for option in OPTIONS if option.long]
    pytester.makeconftest(OWN.format(flags=short, ini=[name.lstrip("-") for name in short]))
    pytester.makepyfile(FALLING)
    pytester.makeini("[pytest]\nsim_jitter = 0\n")
    result = run_pytest(
        pytester,
        "--sim-name=mujoco --sim-protocol=fast --sim-headless --sim-robot=panda --sim-reps=2",
        "--sim-output=out",
        *short,
        passed=1,
    )
    for option in (option for option in OPTIONS if option.long):
        result.stdout.fnmatch_lines(
            [f"{option.flag} belongs to another plugin or to a conftest*{option.long} for*"]
        )
    record = records(pytester.path / "out")[0]
    assert record["mode"] == "headless"  # their --gui is not ours
    assert record["jitter"] == 0
    shown = pytester.runpytest_subprocess("--help").stdout.str()
    assert all(f"\n  {option.long}" in shown for option in OPTIONS if option.long)


def test_values_of_ours_are_no_folders_with_conftests(pytester: pytest.Pytester) -> None:
    """pytest looks for conftests before it knows our options: `out` in `--sim-output out`."""
    tests = pytester.mkdir("tests")
    (tests / "conftest.py").write_text("pytest_plugins = ['pytester']\n" + OWN.format(
        flags=["--their"], ini=[]))  # fmt: skip
    (tests / "test_it.py").write_text("def test_it(pytestconfig): assert pytestconfig.option\n")
    pytester.makeini("[pytest]\ntestpaths = tests\n")
    pytester.mkdir("out")
    words = "--reps 4 --sim mujoco --sim-output out --their --collect-only"
    result = run_pytest(pytester, "", *words.split())
    result.stdout.fnmatch_lines(["*1 test collected*"])


def test_a_flag_of_a_conftest_before_a_path(pytester: pytest.Pytester) -> None:
    tests = pytester.mkdir("tests")
    (tests / "conftest.py").write_text(OWN.format(flags=["--sim"], ini=[]))
    (tests / "test_it.py").write_text(TEST.format(flags=["--sim"], ini=[]))
    run_pytest(pytester, "--sim tests", passed=1)


@pytest.mark.parametrize("autoload", [True, False])
@pytest.mark.parametrize("place", ["conftest", "-p"])
def test_loaded_by_name(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, place: str, autoload: bool
) -> None:
    """In a conftest or with -p, whether pytest has loaded us by itself or not."""
    if not autoload:
        monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    named = "pytest_plugins = ['pytest_simbench.plugin']\n" if place == "conftest" else ""
    pytester.makeconftest(named + OWN.format(flags=["--gui"], ini=[]))
    pytester.makepyfile(FALLING)
    early = ("-p", "pytest_simbench.plugin") if place == "-p" else ()
    run_pytest(
        pytester,
        "--sim=mujoco --reps=2 --gui -Werror::pytest.PytestAssertRewriteWarning",
        *early,
        passed=1,
    )


def test_a_project_s_own_benchmark_fixture(pytester: pytest.Pytester) -> None:
    pytester.makeconftest("import pytest\n@pytest.fixture\ndef benchmark():\n    return 'ours'\n")
    pytester.makepyfile(FALLING)
    run_pytest(pytester, "--sim=mujoco --reps=2 -p no:benchmark", passed=1)


WITH_FIXTURES = "import pytest\n" + "".join(
    f"@pytest.fixture\ndef {name}():\n    return 'own'\n\n"
    for name in ("output_path", "repeat", "resources", "sim", "simulator", "threshold", "replay",
                 "perturb")
)  # fmt: skip


@pytest.mark.parametrize("place", ["conftest", "plugin"])
def test_fixtures_of_our_names(pytester: pytest.Pytester, place: str) -> None:
    """pytest-playwright has an `output_path`: every test of a browser would get ours."""
    pytester.syspathinsert()
    pytester.makepyfile(**{"conftest" if place == "conftest" else "other": WITH_FIXTURES})
    pytester.makepyfile(
        test_own="""
        def test_own(output_path, repeat, resources, sim, simulator, threshold, replay, perturb):
            assert {output_path, repeat, resources, sim, simulator, threshold} == {"own"}
            assert {replay, perturb} == {"own"}
        """
    )
    early = ("-p", "other") if place == "plugin" else ()
    run_pytest(pytester, "--strict-markers", *early, passed=1)
    assert not (pytester.path / ".simbench").exists()


def test_ours_under_another_name(pytester: pytest.Pytester) -> None:
    pytester.makeconftest(
        WITH_FIXTURES + "from pytest_simbench.plugin.fixtures import repeat as sim_repeat\n"
    )
    pytester.makepyfile(FALLING.replace("repeat", "sim_repeat"))
    run_pytest(pytester, "--sim=mujoco --reps=2", passed=1)


def test_an_unrelated_run_sees_nothing_of_us(pytester: pytest.Pytester) -> None:
    pytester.makeconftest(OWN.format(flags=["--gui"], ini=["reps"]))
    pytester.makepyfile(
        """
        import pytest
        pytestmark = [pytest.mark.reps("x"), pytest.mark.needs(3), pytest.mark.only_sim("nosuch")]

        def test_with_marks_of_our_names():
            pass
        """
    )
    result = run_pytest(pytester, "--gui --strict-markers", passed=1)
    assert "sim" not in result.stdout.str().replace("simbench", "").partition("collected")[2]
    assert not Path(pytester.path, ".simbench").exists()


def test_an_inner_run_leaves_the_metadata_of_packages(pytester: pytest.Pytester) -> None:
    """See `tests/conftest.py`: else all later inner runs of the process lack our options."""
    pytester.makepyfile(
        """
        import pytest

        def test_a_library_that_lists_packages_in_its_own_way():
            pytest.importorskip("importlib_metadata")
        """
    )
    assert pytester.inline_run("-p", "no:simbench").ret == 0
    assert version("pytest-simbench") == __version__
