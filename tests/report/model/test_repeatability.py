"""Repeatability as a reader sees it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_simbench.records.repeatability import Again, Line
from pytest_simbench.repeatability.agreement import Agreement, Parting
from pytest_simbench.report.markdown.run import render_tables as render_markdown
from pytest_simbench.report.model.repeatability import tables
from pytest_simbench.report.terminal.parts import render_tables as render_terminal

AGAINS = (
    Again(way="after a reset"),
    Again(
        way="fresh process", first=1.234, body="cube_1", growth={"1": 0.0015, "5": 0.00999},
        largest=0.3, changed=["hit"],
    ),
    Again(way="with a window", skipped="no display"),
    Again(way="restored", failure="WorkerExited: x"),
)  # fmt: skip


def line(kind: str, simulator: str, **result: object) -> Line:
    return Line(kind, "t::x", simulator, "headless", "tuned", "throwing", 7, {}, {}, result)


LINES = [
    line("replay", "mujoco", claims=True, again=[AGAINS[0].to_wire()]),
    line("replay", "wobbly", claims=False, again=[again.to_wire() for again in AGAINS]),
    line("search", "mujoco", sentence="0.7 mm in x of cube_12 topples tower 2"),
]
AGREEMENTS = [
    Agreement(
        ("throwing, seed 7, test_x", ""),
        "mujoco headless tuned",
        "wobbly headless tuned",
        {0.001: Parting(0.5, "cube_1", (0.1, 0.2, 0.3)), 0.01: None},
        2.5,
        9.0,
        False,
    )
]


@pytest.mark.parametrize("width", [80, 100, 140])
def test_terminal(width: int) -> None:
    text = render_terminal(tables(LINES, AGREEMENTS), width)
    flat = " ".join(text.split())
    assert max(map(len, text.splitlines())) <= width
    assert text.isascii()
    for part in (
        "Replay: throwing, seed 7",
        "1.23 s",
        "not run",
        "failed",
        "changed: hit",
        "cube_12",
        "0.50 s / never",
        "2.50 s",
        "never in 9.0 s",
    ):
        assert part in flat


def test_the_row_says_it_all() -> None:
    text = render_terminal(tables(LINES, []), 140)
    rows = [row.split() for row in text.splitlines()]
    assert ["mujoco", "headless", "tuned", "yes", "same"] in rows
    assert [
        *["wobbly", "headless", "tuned", "no", "same", "1.23", "s", "not", "run", "failed"]
    ] in rows
    growth = next(row for row in text.splitlines() if "fresh process" in row and "cube_1" in row)
    assert growth.split()[-7:] == ["1.23", "cube_1", "1.5", "9.99", "300", "changed:", "hit"]


def test_no_table_without_content() -> None:
    assert tables([], []) == []
    assert [table.title for table in tables(LINES[:1], [])] == ["Replay: throwing, seed 7"]


def test_each_test_and_seed_has_tables_of_its_own() -> None:
    """One test's difference stood where the last one's was: a throw that parts was "never"."""
    never = replace(AGREEMENTS[0], partings={0.001: None, 0.01: None})
    others = [("throwing, seed 7, test_x", "{}"), ("throwing, seed 8, test_x", "")]
    found = tables([], [*AGREEMENTS, *(replace(never, what=what) for what in others)])
    titles = [f"Agreement: {words}" for words, _ in (AGREEMENTS[0].what, *others)]
    assert [table.title for table in found[::2]] == titles
    cells = [table.columns[2].cells[0].lines[0] for table in found[::2]]
    assert cells == ["0.50 s / never", "never / never", "never / never"]


def test_a_simulator_of_several_tests_or_seeds_is_told_apart() -> None:
    again = [Again(way="fresh process", first=1.0, body="a", growth={}, largest=0.1).to_wire()]
    ours = line("replay", "mujoco", claims=True, again=again)
    found = tables([ours, replace(ours, test="t::y"), replace(ours, seed=8)], [])
    assert [table.title for table in found] == [
        "Replay: throwing, seed 7", "Replay: throwing, seed 7, growth",
        "Replay: throwing, seed 8", "Replay: throwing, seed 8, growth",
    ]  # fmt: skip
    name = "mujoco headless tuned"
    assert [cell.lines[0] for cell in found[0].columns[0].cells] == [f"{name}, x", f"{name}, y"]
    assert [cell.lines[0] for cell in found[1].columns[0].cells] == [
        f"{name}, {test}, fresh process" for test in "xy"
    ]
    assert [cell.lines[0] for cell in found[2].columns[0].cells] == [name]


def test_markdown() -> None:
    text = render_markdown("Repeatability", tables(LINES, AGREEMENTS))
    assert text.startswith("# Repeatability\n\n## Replay: throwing, seed 7\n")
    assert "| mujoco headless tuned | yes | same |" in text
    assert "| wobbly headless tuned | 0.50 s / never | - |" in text
