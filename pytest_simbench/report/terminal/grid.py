"""Plain-text tables of a given width, laid out so that a narrow terminal still reads well."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rich.box import Box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from pytest_simbench.ground.text import for_terminal, in_one_line

GAP = 2
"""Blank columns between two columns of a table."""

PLAIN = Box("    \n    \n -- \n    \n    \n    \n    \n    \n", ascii=True)
"""One rule of hyphens under the heading and nothing else, so that logs stay readable."""


@dataclass(frozen=True)
class Column:
    """A heading and a cell for each row; a cell is one or more lines of printable characters.

    Attributes:
        group: columns of one group stay together where a table must be cut.
        wrap: whether long text may be wrapped (messages) instead of kept whole (numbers).
    """

    heading: str
    cells: Sequence[Sequence[str]]
    group: str = ""
    left: bool = False
    wrap: bool = False

    def __post_init__(self) -> None:
        cells = [[in_one_line(line) for line in cell] for cell in self.cells]
        object.__setattr__(self, "heading", in_one_line(self.heading))
        object.__setattr__(self, "cells", cells)

    def joined(self) -> Column:
        """The same with each cell in a single line."""
        lines = [[" ".join(line for line in cell if line)] for cell in self.cells]
        return Column(self.heading, lines, self.group, self.left, self.wrap)

    @property
    def width(self) -> int:
        lines = [*self.heading_lines, *(line for cell in self.cells for line in cell)]
        return max(cell_len(line) for line in lines)

    @property
    def heading_lines(self) -> list[str]:
        """The heading, in two lines where that makes the column narrower."""
        room = max((cell_len(line) for cell in self.cells for line in cell), default=0)
        for width in range(max(room, len(self.heading) // 2, 1), len(self.heading)):
            lines = textwrap.wrap(self.heading, width, break_long_words=False)
            if len(lines) <= 2 and all(len(line) <= width for line in lines):
                return lines
        return [self.heading]


def render(columns: Sequence[Column], width: int) -> str:
    """The table in `width` columns: the first column names the rows.

    Tried in this order: one line for each row; cells of several lines; one table for each group of
    columns; as many tables as it takes. Lines have no trailing blanks.
    """
    wraps = any(column.wrap for column in columns)
    single = [column.joined() for column in columns]
    if wraps or _fits(single, width):
        return _draw(single, width)
    if _fits(columns, width):
        return _draw(columns, width)
    label, rest = columns[0], columns[1:]
    parts: list[list[Column]] = []
    for column in rest:
        same = parts and parts[-1][-1].group == column.group
        if same and _fits([label, *parts[-1], column], width):
            parts[-1].append(column)
        else:
            parts.append([column])
    return "\n\n".join(_best([label, *part], width) for part in parts)


def fill(text: str, width: int, indent: str = "") -> str:
    """`text` wrapped to the width; every line but the first is indented."""
    lines = Text(for_terminal(text)).wrap(_console(width), max(20, width - len(indent)))
    return f"\n{indent}".join(line.plain.rstrip() for line in lines)


def capital(text: str) -> str:
    """A title with a large letter at its beginning."""
    return text[:1].upper() + text[1:]


def _best(columns: Sequence[Column], width: int) -> str:
    single = [column.joined() for column in columns]
    return _draw(single if _fits(single, width) else columns, width)


def _fits(columns: Iterable[Column], width: int) -> bool:
    widths = [column.width for column in columns]
    return sum(widths) + GAP * (len(widths) - 1) <= width


def _draw(columns: Sequence[Column], width: int) -> str:
    several = any(len(cell) > 1 for column in columns for cell in column.cells)
    # The box itself draws one blank between columns.
    table = Table(box=PLAIN, show_edge=False, pad_edge=False, padding=(0, GAP - 1, 0, 0))
    tallest = max(len(column.heading_lines) for column in columns)
    for column in columns:
        heading = column.heading_lines
        table.add_column(
            Text("\n".join([*[""] * (tallest - len(heading)), *heading])),
            justify="left" if column.left else "right",
            no_wrap=not column.wrap,
            overflow="fold",
            min_width=None if column.wrap else column.width,
        )
    for cells in zip(*(column.cells for column in columns), strict=True):
        table.add_row(*(Text("\n".join(cell)) for cell in cells))
    table.leading = 1 if several and len(columns[0].cells) > 1 else 0
    console = _console(width)
    console.print(table)
    text: str = console.file.getvalue()  # type: ignore[attr-defined]
    return "\n".join(line.rstrip() for line in text.splitlines())


def _console(width: int) -> Console:
    # No terminal and no colour system: never an escape code, whatever the environment asks for.
    return Console(
        file=io.StringIO(),
        width=width,
        force_terminal=False,
        color_system=None,
        legacy_windows=False,
    )
