"""What every report draws: sections of sentences and tables, whose cells carry their verdict."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import InitVar, dataclass, field, replace

from pytest_simbench.ground.text import in_one_line
from pytest_simbench.records.record import Who

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?")


@dataclass(frozen=True)
class Cell:
    """One cell.

    Attributes:
        lines: of printable characters; the first stands out.
        sort: what its column is sorted by; None: by the text.
        verdict: `ahead`, `behind`, `apart`, `same`, `open` (see `answer.Standing`), or empty where
            nothing was compared.
        of: what the row is of, in the cell that names it: the page's filters show and hide by it;
            None where they do not concern it.
    """

    lines: Sequence[str]
    sort: float | None = None
    verdict: str = ""
    of: Who | None = None

    @classmethod
    def made(cls, given: Content) -> Cell:
        """Of text: it is sorted by the number that it begins with."""
        found = (
            given if isinstance(given, Cell) else cls([given] if isinstance(given, str) else given)
        )
        lines = [in_one_line(line) for line in found.lines]
        leading = _NUMBER.match(lines[0]) if lines and found.sort is None else None
        return replace(found, lines=lines, sort=float(leading[0]) if leading else found.sort)

    @property
    def text(self) -> str:
        """The whole in a single line."""
        return " ".join(line for line in self.lines if line)


Content = str | Sequence[str] | Cell
"""What a cell is made of: one line, several, or the cell itself."""


@dataclass(frozen=True)
class Column:
    """A heading and a cell for each row.

    Attributes:
        content: of the cells.
        group: columns of one group stay together where a table must be cut.
        left: whether it holds text, which begins at the left.
        wrap: whether long text may be wrapped (messages) instead of kept whole (numbers).
        note: how to read the column.
        above: whether a cell may stand above its rows, on a line of its own, where the table is
            too wide.
    """

    heading: str
    content: InitVar[Iterable[Content]]
    group: str = ""
    left: bool = False
    wrap: bool = False
    note: str = ""
    above: bool = False
    cells: tuple[Cell, ...] = field(init=False)

    def __post_init__(self, content: Iterable[Content]) -> None:
        object.__setattr__(self, "heading", in_one_line(self.heading))
        object.__setattr__(self, "cells", tuple(map(Cell.made, content)))

    def joined(self) -> Column:
        """The same with each cell in a single line."""
        return replace(self, content=[replace(cell, lines=[cell.text]) for cell in self.cells])


@dataclass(frozen=True)
class Table:
    """A table, its title, and how to read it; the first column names the rows."""

    title: str
    columns: Sequence[Column]
    note: str = ""


@dataclass(frozen=True)
class Section:
    """All that is told of one thing.

    Attributes:
        title: of the section, which is that of its first table too.
        sentences: the answer.
        tables: those with columns are drawn, the first without its title.
        notes: what a reader must know besides.
        of: a short name, which the terminal puts before the titles of further tables.
    """

    title: str
    sentences: Sequence[str] = ()
    tables: Sequence[Table] = ()
    notes: Sequence[str] = ()
    of: str = ""


def listed(texts: Sequence[str], most: int = 0) -> str:
    """`a, b and c`; of more than `most` + 1 (0: any number) the first ones and how many more."""
    shown = list(texts)
    if most and len(shown) > most + 1:
        shown = [*shown[:most], f"{len(shown) - most} more"]
    return " and ".join([", ".join(shown[:-1]), shown[-1]]) if len(shown) > 1 else "".join(shown)


def names(places: Sequence[Sequence[str]], form: str = "{} ({})", between: str = ", ") -> list[str]:
    """Short names of (simulator, mode, profile, ...): mode and profile only where they differ, what
    follows only where there is any."""
    several = [len({place[k] for place in places}) > 1 for k in (1, 2)] if places else []
    found = []
    for simulator, mode, profile, *rest in places:
        parts = [part for part, shown in zip((mode, profile), several, strict=True) if shown]
        parts += filter(None, rest)
        found.append(form.format(simulator, between.join(parts)) if parts else simulator)
    return found


def capital(text: str) -> str:
    """A title with a large letter at its beginning."""
    return text[:1].upper() + text[1:]
