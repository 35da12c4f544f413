"""What the plugin knows of one pytest run: one object a config, none of a module."""

from __future__ import annotations

import pytest

from pytest_simbench.plugin.session import session_of


def test_each_config_has_one_of_its_own(
    pytestconfig: pytest.Config, pytester: pytest.Pytester
) -> None:
    other = pytester.parseconfig()
    session = session_of(other)
    assert session is session_of(other)
    assert session is not session_of(pytestconfig)
    assert (session.config, session.begun) == (other, False)


def test_what_one_run_received_is_not_of_the_next(
    pytestconfig: pytest.Config, pytester: pytest.Pytester
) -> None:
    report = pytest.TestReport("test", ("", 0, ""), {}, "passed", None, "call")
    report.simbench = ["a record"]  # type: ignore[attr-defined]
    first, second = (session_of(pytester.parseconfig()) for _ in range(2))
    first.pytest_runtest_logreport(report)
    assert (first._received, second._received) == (["a record"], [])
