"""Repeatability in the terminal and in Markdown: replay, small perturbations, agreement."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from pytest_simbench.ground.text import for_markdown, for_terminal, in_one_line
from pytest_simbench.records.metrics import significant
from pytest_simbench.records.paths import write_whole
from pytest_simbench.records.repeatability import Line, read
from pytest_simbench.repeatability.agreement import LIMITS, Agreement, agreements
from pytest_simbench.repeatability.motions import GROWTH_TIMES
from pytest_simbench.repeatability.replay_result import Again
from pytest_simbench.report.markdown.run import table
from pytest_simbench.report.terminal.grid import Column, fill, render

Table = tuple[str, str, list[Column]]
"""Title, how to read it, columns."""

REPLAY = (
    "The same seed and commands again. same: every sampled bit, 50 times a second and at the end "
    "of each motion; else the simulated time of the first difference"
)
GROWTH = "How fast they part: largest distance of a cube from itself, so long after the first bit"
PERTURBATION = (
    "The smallest perturbation found that changes the outcome, what random ones up to a bound "
    "leave of it, and how a displacement grows under the same commands"
)
AGREEMENT = (
    "When the cubes of two simulators first differ by 1 mm / 1 cm, for the same seed; never: not "
    "while both episodes lasted"
)


MARKDOWN_NAME = "repeatability.md"


def write_tables(folder: Path, to: Path | None = None) -> tuple[list[Table], list[str]]:
    """The tables of what a run folder holds on repeatability, also as a file of Markdown.

    Args:
        folder: of the run.
        to: the folder for the file; None: there is none.

    Returns:
        The tables, and one sentence for each thing that is wrong.
    """
    try:
        found = read(folder)
        shown = tables(found.items, agreements(folder))
    except ValueError as error:
        return [], [str(error)]
    problems = [*found.problems, *found.refused]
    if shown and to is not None:
        path = to / MARKDOWN_NAME
        try:
            write_whole(to, MARKDOWN_NAME, render_markdown(shown).encode("utf-8", "replace"))
        except OSError as error:
            problems.append(f"{path} could not be written ({error.strerror or error})")
    return shown, problems


def tables(lines: Sequence[Line], agreements: Sequence[Agreement]) -> list[Table]:
    """All tables that there is something to tell in."""
    replays = [line for line in lines if line.kind == "replay"]
    found: list[Table] = []
    for task in dict.fromkeys(line.task for line in replays):
        ours = [line for line in replays if line.task == task]
        seeds = ", ".join(str(seed) for seed in dict.fromkeys(line.seed for line in ours))
        found.append((f"Replay: {task}, seed {seeds}", REPLAY, replay_columns(ours)))
        parted = [(line, again) for line in ours for again in _agains(line) if again.difference]
        if parted:
            found.append((f"Replay: {task}, growth", GROWTH, growth_columns(parted)))
    others = [line for line in lines if line.kind != "replay"]
    if others:
        found.append(("Perturbation", PERTURBATION, sentence_columns(others)))
    if agreements:
        found.append(("Agreement", AGREEMENT, matrix_columns(agreements)))
        found.append(("Agreement, in detail", "", detail_columns(agreements)))
    return found


def render_terminal(found: Sequence[Table], width: int) -> str:
    """Plain lines of at most `width` columns."""
    parts = []
    for title, note, columns in found:
        title = in_one_line(title)
        head = [title, "-" * len(title), *([fill(note, width)] if note else [])]
        parts.append("\n".join([*head, "", render(columns, width)]))
    return for_terminal("\n\n".join(parts))


def render_markdown(found: Sequence[Table]) -> str:
    """The same as GitHub Markdown."""
    parts = ["# Repeatability"]
    for title, note, columns in found:
        parts.append(f"## {for_markdown(title)}")
        if note:
            parts.append(for_markdown(f"{note}."))
        parts.append(table(columns))
    return "\n\n".join(parts) + "\n"


def _agains(line: Line) -> list[Again]:
    return [Again.from_wire(data) for data in line.result["again"]]


def replay_columns(lines: Sequence[Line]) -> list[Column]:
    """A row for each simulator, a column for each way of running again."""
    ways = list(dict.fromkeys(again.way for line in lines for again in _agains(line)))
    columns = [
        Column("simulator", [[line.label] for line in lines], left=True),
        Column("claims to repeat", [["yes" if line.result["claims"] else "no"] for line in lines]),
    ]
    for way in ways:
        cells = []
        for line in lines:
            found = {again.way: again for again in _agains(line)}
            cells.append([_cell(found[way])] if way in found else [""])
        columns.append(Column(way, cells))
    return columns


def _cell(again: Again) -> str:
    if again.failure:
        return "failed"
    if again.skipped:
        return "not run"
    if again.difference is None:
        return "same"
    return f"{again.difference.first:.2f} s"


def growth_columns(parted: Sequence[tuple[Line, Again]]) -> list[Column]:
    """A row for each way in which a simulator did not repeat itself."""
    found = [(line, again, again.difference) for line, again in parted if again.difference]
    columns = [
        Column(
            "simulator", [[f"{line.label}, {again.way}"] for line, again, _ in found], left=True
        ),
        Column("first at s", [[f"{d.first:.2f}"] for _, _, d in found]),
        Column("cube", [[d.body or "(robot)"] for _, _, d in found], left=True),
    ]
    for after in GROWTH_TIMES:
        gaps = [d.growth.get(after) for _, _, d in found]
        cells = [["" if gap is None else significant(1000 * gap)] for gap in gaps]
        columns.append(Column(f"mm at {after:g} s", cells))
    columns += [
        Column("mm at most", [[significant(1000 * d.largest)] for _, _, d in found]),
        Column("outcome", [[_outcome(again)] for _, again, _ in found], left=True),
    ]
    return columns


def _outcome(again: Again) -> str:
    return f"changed: {', '.join(again.changed)}" if again.changed else "the same"


def sentence_columns(lines: Sequence[Line]) -> list[Column]:
    """A sentence for each result."""
    kinds = {"search": "smallest", "stability": "random", "sensitivity": "growth"}
    return [
        Column("simulator", [[line.label] for line in lines], left=True),
        Column("task", [[line.task] for line in lines], left=True),
        Column("what", [[kinds.get(line.kind, line.kind)] for line in lines], left=True),
        Column("result", [[line.result["sentence"]] for line in lines], left=True, wrap=True),
    ]


def matrix_columns(agreements: Sequence[Agreement]) -> list[Column]:
    """Simulators against simulators."""
    names = list(dict.fromkeys(n for a in agreements for n in (a.first, a.second)))
    pairs: dict[tuple[str, str], Agreement] = {}
    for found in agreements:
        pairs[found.first, found.second] = pairs[found.second, found.first] = found
    columns = [Column("", [[name] for name in names], left=True)]
    for other in names:
        cells = [[_pair(pairs.get((name, other)), name == other)] for name in names]
        columns.append(Column(other, cells))
    return columns


def _pair(found: Agreement | None, itself: bool) -> str:
    if itself:
        return "-"
    if found is None:
        return ""
    times = [found.partings[limit] for limit in LIMITS]
    return " / ".join("never" if time is None else f"{time.time:.2f} s" for time in times)


def detail_columns(agreements: Sequence[Agreement]) -> list[Column]:
    """A row for each pair: when, which cube, and where in the world."""

    def cells(text: Callable[[Agreement], str]) -> list[list[str]]:
        return [[text(found)] for found in agreements]

    return [
        Column("pair", cells(lambda a: f"{a.first} and {a.second}"), left=True, wrap=True),
        Column("1 mm", cells(lambda a: _parting(a, LIMITS[0])), left=True, wrap=True),
        Column("1 cm", cells(lambda a: _parting(a, LIMITS[1])), left=True, wrap=True),
        Column("commands part", cells(_commands), left=True),
        Column("outcome", cells(lambda a: "the same" if a.same_outcome else "differs"), left=True),
    ]


def _parting(found: Agreement, limit: float) -> str:
    parting = found.partings[limit]
    return f"never in {found.until:.1f} s" if parting is None else str(parting)


def _commands(found: Agreement) -> str:
    return "never" if found.commands_part is None else f"{found.commands_part:.2f} s"
