"""What the plugin knows of one pytest run: one object a config, none of a module."""

from __future__ import annotations

import pytest

from pytest_simbench.plugin.session import session_of
from tests.plugin.conftest import Configure


def test_what_one_run_received_is_not_of_the_next(configure: Configure) -> None:
    report = pytest.TestReport("test", ("", 0, ""), {}, "passed", None, "call")
    report.simbench = ["a record"]
    first, second = (session_of(configure()) for _ in range(2))
    first.pytest_runtest_logreport(report)
    assert (first._received, second._received) == (["a record"], [])
