"""Hypothesis profiles: there when they are asked for, never loaded by themselves."""

from __future__ import annotations

import subprocess
import sys

import pytest
from hypothesis import settings

from pytest_simbench.repeatability.profiles import PROFILES


@pytest.mark.parametrize("name", PROFILES)
def test_registered_with_no_deadline_and_no_silenced_check(name: str) -> None:
    profile = settings.get_profile(name)
    assert profile.deadline is None
    assert profile.print_blob
    assert tuple(profile.suppress_health_check) == ()
    assert profile.max_examples == PROFILES[name]["max_examples"]
    assert profile.derandomize == (name == "sim-ci")


def printed(code: str, **more: str) -> str:
    """By a process that has little of this one's environment."""
    environment = {"PATH": "/usr/bin:/bin", **more}
    command = [sys.executable, "-c", code]
    return subprocess.run(
        command, check=True, env=environment, cwd="/", capture_output=True, text=True
    ).stdout


def test_the_same_in_ci() -> None:
    """Hypothesis loads its own `ci` profile where `CI` is set: ours must not inherit from it."""
    code = "from hypothesis import settings; print(*map(settings.get_profile, %r), sep='\\n')"
    here, in_ci = (printed(code % list(PROFILES), **more) for more in ({}, {"CI": "true"}))
    assert "max_examples=500" in here
    assert here == in_ci


def test_importing_hypothesis_loads_none_of_them() -> None:
    printed(
        "from hypothesis import settings; settings.get_profile('sim-ci'); "
        "assert settings().max_examples == 100; assert settings().deadline is not None; "
        "import sys; assert 'numpy' not in sys.modules"
    )


def test_pytest_without_hypothesis_does_not_import_it(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import sys

        def test_it():
            assert "pytest_simbench.plugin.hooks" in sys.modules
            assert "hypothesis.core" not in sys.modules
        """
    )
    others = ("benchmark", "hypothesispytest")
    plugins = [part for name in others for part in ("-p", f"no:{name}")]
    pytester.runpytest_subprocess(*plugins).assert_outcomes(passed=1)


def test_the_user_chooses(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    pytester.makeconftest("")
    pytester.makepyfile(
        """
        from hypothesis import given, settings, strategies as st
        runs = []

        @given(st.integers())
        def test_it(number):
            runs.append(number)

        def test_count(pytestconfig):
            wanted = 10 if pytestconfig.getoption("hypothesis_profile") else 100
            assert len(runs) == wanted
        """
    )
    arguments = ("-p", "no:randomly", "-p", "no:cacheprovider")
    monkeypatch.delenv("CI", raising=False)
    monkeypatch.delenv("PYTEST_ADDOPTS")  # it is Hypothesis' plugin that is asked
    chosen = pytester.runpytest_subprocess("--hypothesis-profile=sim-dev", *arguments)
    chosen.assert_outcomes(passed=2)
    pytester.runpytest_subprocess(*arguments).assert_outcomes(passed=2)
