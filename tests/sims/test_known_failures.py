"""The docs' table of laws that shipped engines break is that of the expected failures."""

from __future__ import annotations

from pathlib import Path

from pytest_simbench.simulator.registry import adapter
from pytest_simbench.testing import CHECKS
from pytest_simbench.testing.kit import read_expected_failures

EXPECTED = Path(__file__).with_name("expected_failures.txt")
PAGE = Path(__file__).parents[2] / "docs" / "extending" / "known_failures.md"


OTHERS = {"*": "other robots"}
"""Than the Panda, of whom a line without a robot is."""


def table() -> str:
    """The table as Markdown, sorted by law and engine."""
    rows = []
    for test, reason in read_expected_failures(EXPECTED).items():
        name, profile, *robot, law = test.split("-")
        assert (profile, law in CHECKS) == ("tuned", True)
        title = ", ".join([adapter(name).info.title, *(OTHERS.get(r, r) for r in robot)])
        rows.append(f"| `{law}` | {title} | {reason} |")
    return "\n".join(["| law | engine | what was found |", "|---|---|---|", *sorted(rows)])


def test_the_table_of_the_docs() -> None:
    assert PAGE.read_text("utf-8").endswith(f"\n\n{table()}\n"), f"write {table()}"
