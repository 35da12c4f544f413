"""The public conformance kit on every registered simulator, at its tuned settings; the laws of
robots with others than the Panda: one with a parallel hand, and one with a jaw; and the docs' table
of laws that engines break.

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

FILE = Path(__file__).with_name("expected_failures.txt")
EXPECTED = read_expected_failures(FILE)
PAGE = Path(__file__).parents[2] / "docs" / "extending" / "known_failures.md"


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


OTHERS = {"*": "other robots"}
"""Than the Panda, of whom a line without a robot is."""


def table() -> str:
    """The table as Markdown, sorted by law and engine."""
    rows = []
    for test, reason in EXPECTED.items():
        name, profile, *robot, law = test.split("-")
        assert (profile, law in CHECKS) == ("tuned", True)
        title = ", ".join([adapter(name).info.title, *(OTHERS.get(r, r) for r in robot)])
        rows.append(f"| `{law}` | {title} | {reason} |")
    return "\n".join(["| law | engine | what was found |", "|---|---|---|", *sorted(rows)])


def test_the_table_of_the_docs() -> None:
    assert PAGE.read_text("utf-8").endswith(f"\n\n{table()}\n"), f"write {table()}"
