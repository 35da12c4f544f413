"""Plain-text tables of a given width, laid out so that a narrow terminal still reads well."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby

from rich.box import Box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from pytest_simbench.ground.text import for_terminal
from pytest_simbench.report.model.document import Column, Content

GAP = 2
"""Blank columns between two columns of a table."""

NARROWEST = 16
"""Columns that text which may be wrapped must have beside the others."""

PLAIN = Box("    \n    \n -- \n    \n    \n    \n    \n    \n", ascii=True)
"""One rule of hyphens under the heading and nothing else, so that logs stay readable."""


def render(columns: Sequence[Column], width: int) -> str:
    """The table in `width` columns: the first column names the rows.

    Tried in this order: one line for each row; the first column's cells on lines of their own, if
    they may stand there; a table below each of those; cells of several lines; one table for each
    group of columns; as many tables as it takes. Lines have no trailing blanks.
    """
    single = [column.joined() for column in columns]
    if fits(single, width):
        return _draw(single, width)
    if columns[0].above and fits_below(single, width):
        return _below(single, width)
    kept = [column for column in single if not column.wrap]
    cut = any(_width(column) > width for column in kept)  # however it is laid out
    if columns[0].above and not cut:
        return "\n\n".join(_apart(single, width))
    if len(kept) < len(single) and (cut or fits(kept, width - NARROWEST)):
        return _draw(single, width)
    if fits(columns, width):
        return _draw(columns, width)
    label, rest = columns[0], columns[1:]
    parts: list[list[Column]] = []
    for column in rest:
        same = parts and parts[-1][-1].group == column.group
        if same and fits([label, *parts[-1], column], width):
            parts[-1].append(column)
        else:
            parts.append([column])
    return "\n\n".join(_best([label, *part], width) for part in parts)


def fill(text: str, width: int, indent: str = "") -> str:
    """`text` wrapped to the width; every line but the first is indented."""
    lines = Text(for_terminal(text)).wrap(_console(width), max(20, width - len(indent)))
    return f"\n{indent}".join(line.plain.rstrip() for line in lines)


def fits(columns: Iterable[Column], width: int) -> bool:
    """Whether the columns stand side by side in that width."""
    widths = [_width(column) for column in columns]
    return sum(widths) + GAP * (len(widths) - 1) <= width


def fits_below(columns: Sequence[Column], width: int) -> bool:
    """Whether they do where the first one's cells stand on lines of their own."""
    kept = [column for column in columns[1:] if not column.wrap]
    return fits(kept, width - (GAP if len(kept) == len(columns) - 1 else NARROWEST))


def _below(columns: Sequence[Column], width: int) -> str:
    """The table without its first column, whose cells stand above the rows that share them."""
    label, *rest = columns
    heads = [cell.text for cell in label.cells]
    begins = [k for k, head in enumerate(heads) if not k or head != heads[k - 1]]
    spread = []
    for column in rest:
        content: list[Content] = []
        for k, cell in enumerate(column.cells):
            content += [""] * (k in begins) + [cell]  # a blank line for what stands above
        spread.append(replace(column, content=content))
    above = (fill(heads[k], width, "  ") for k in begins)
    lines = _draw(spread, width - GAP).splitlines()
    return "\n".join(" " * GAP + line if line else next(above) for line in lines)


def _apart(columns: Sequence[Column], width: int) -> Iterator[str]:
    """A table for each run of rows that share the first column's cell, which stands above it."""
    label, *rest = columns
    for head, found in groupby(enumerate(label.cells), lambda row: row[1].text):
        rows = [k for k, _ in found]
        of = [replace(column, content=[column.cells[k] for k in rows]) for column in rest]
        yield f"{fill(head, width, '  ')}\n{render(of, width)}"


def _best(columns: Sequence[Column], width: int) -> str:
    single = [column.joined() for column in columns]
    return _draw(single if fits(single, width) else columns, width)


def _lines(column: Column) -> list[str]:
    return [line for cell in column.cells for line in cell.lines]


def _heading(column: Column) -> list[str]:
    """The heading, in two lines where that makes the column narrower."""
    room = max(map(cell_len, _lines(column)), default=0)
    for width in range(max(room, len(column.heading) // 2, 1), len(column.heading)):
        lines = textwrap.wrap(column.heading, width, break_long_words=False)
        if len(lines) <= 2 and all(len(line) <= width for line in lines):
            return lines
    return [column.heading]


def _width(column: Column) -> int:
    return max(map(cell_len, [*_heading(column), *_lines(column)]))


def _draw(columns: Sequence[Column], width: int) -> str:
    several = any(len(cell.lines) > 1 for column in columns for cell in column.cells)
    # The box itself draws one blank between columns.
    table = Table(box=PLAIN, show_edge=False, pad_edge=False, padding=(0, GAP - 1, 0, 0))
    headings = [_heading(column) for column in columns]
    tallest = max(map(len, headings))
    for column, heading in zip(columns, headings, strict=True):
        table.add_column(
            Text("\n".join([*[""] * (tallest - len(heading)), *heading])),
            justify="left" if column.left else "right",
            no_wrap=not column.wrap,
            overflow="fold",
            min_width=None if column.wrap else _width(column),
        )
    for cells in zip(*(column.cells for column in columns), strict=True):
        table.add_row(*(Text("\n".join(cell.lines)) for cell in cells))
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


def aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """A line for each row of short texts, its columns one below the other; what stands last in a
    row that is shorter than others may be long."""
    whole = max(map(len, rows))
    ends = [row if len(row) == whole else row[:-1] for row in rows]
    widths = [max(len(row[k]) for row in ends if k < len(row)) for k in range(whole)]
    for row in rows:
        yield "  ".join(text.ljust(w) for text, w in zip(row, widths, strict=False)).rstrip()
