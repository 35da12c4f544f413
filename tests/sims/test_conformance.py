"""The public conformance kit on every registered simulator, at its tuned settings; the laws of
robots with others than the Panda: one with a parallel hand, and one with a jaw.

All robots in all engines are measured by hand: docs/extending/robots.md has the table.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from pytest_simbench.client.display import Displays
from pytest_simbench.motion.registry import find
from pytest_simbench.simulator.registry import adapter, registered
from pytest_simbench.testing import CHECKS, ConformanceTest, Subject, conformance_checks
from pytest_simbench.testing.kit import Kit, read_expected_failures
from pytest_simbench.testing.subject import close_workers

FILE = Path(__file__).with_name("expected_failures.txt")
EXPECTED = read_expected_failures(FILE)


@pytest.fixture(scope="module", autouse=True)
def workers_end() -> Iterator[None]:
    """A worker of PhysX takes a fifth of a core while it waits."""
    yield
    close_workers()


@pytest.fixture
def displays() -> Iterator[Displays]:
    displays = Displays()
    yield displays
    displays.close()


@conformance_checks(*registered(), expected_failures=FILE)
def test_conformance(
    check: ConformanceTest, displays: Displays, monkeypatch: pytest.MonkeyPatch
) -> None:
    if check.check.name == "window_changes_nothing":
        for name, value in displays.environment().items():
            monkeypatch.setenv(name, value)
    check()


LAWS = [law.name for law in CHECKS.values() if law.robot and law.name != "window_changes_nothing"]
"""A window takes half a minute, and is drawn with the Panda."""

TESTS = [
    test
    for engine, robot in (("mujoco", "ur5"), ("pybullet", "so101"))
    for test in Kit((Subject(adapter(engine)),), tuple(LAWS), EXPECTED).tests([find(robot)])
]


@pytest.mark.parametrize("check", [pytest.param(test, id=test.id) for test in TESTS])
def test_other_robots(check: ConformanceTest) -> None:
    check()
