"""The public conformance kit on every registered simulator, at its tuned settings."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from pytest_simbench.client.display import Displays
from pytest_simbench.simulator.registry import registered
from pytest_simbench.testing import ConformanceTest, conformance_checks


@pytest.fixture
def displays() -> Iterator[Displays]:
    displays = Displays()
    yield displays
    displays.close()


@conformance_checks(
    *registered(), expected_failures=Path(__file__).with_name("expected_failures.txt")
)
def test_conformance(
    check: ConformanceTest, displays: Displays, monkeypatch: pytest.MonkeyPatch
) -> None:
    if check.check.name == "window_changes_nothing":
        for name, value in displays.environment().items():
            monkeypatch.setenv(name, value)
    check()
