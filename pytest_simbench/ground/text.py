r"""Text from elsewhere, made harmless for whatever shows it: one function for each medium.

Records, logs, adapters, test ids and file names may hold anything. Whoever writes to a medium
passes what it writes through that medium's function, so that no column and no message can forget
to. A text that is harmless already stays as it is.
"""

from __future__ import annotations

import re
from numbers import Number
from typing import Any

LONGEST_LINE = 2000
"""Characters of a line that are shown; more is nobody's message, and may be megabytes."""

LONGEST_LABEL = 100
"""Characters of a label in a picture."""

BLANK = "&#8203;"
"""A blank without width: it keeps GitHub from making links and mentions of parts of a text."""


def for_terminal(text: str, longest: int = LONGEST_LINE) -> str:
    r"""`text` as a terminal or a log may show it: printable characters and line ends.

    Escape sequences and other control characters, marks that reverse the direction of reading and
    lone surrogates are written as Python writes them (`\x1b`), any white space as a blank. A line
    of more than `longest` characters is cut and says so. No line is a command to a CI service that
    reads the log (GitHub, Azure).
    """
    return "\n".join(_line(line, longest) for line in text.replace("\r\n", "\n").split("\n"))


def in_one_line(text: str, longest: int = LONGEST_LINE) -> str:
    """The same for a place that holds a single line."""
    return _line(" ".join(text.split()), longest)


def for_markdown(text: str, *, cell: bool = False) -> str:
    """`text` in one line, so that Markdown (GitHub's too) shows it as it is.

    No picture, link, heading, list, HTML, formula or mention of a person comes of it. In a `cell`
    of a table no block can begin.
    """
    text = _MARKUP.sub(lambda found: found[0] if found[1] else f"\\{found[0]}", in_one_line(text))
    text = _LINKED.sub(rf"\g<0>{BLANK}", text)
    return text if cell else _BLOCK.sub(r"\g<0>\\", text)


def for_csv(value: Any) -> Any:
    """A cell: numbers as they are, a text in one line that no spreadsheet takes for a formula.

    What could begin one (OWASP, CSV injection) gets an apostrophe before it, also after a
    semicolon, which parts cells where the comma is the decimal point.
    """
    if value is None or isinstance(value, Number):
        return value
    return _FORMULA.sub(r"\g<0>'", in_one_line(str(value)))


def for_figure(text: str) -> str:
    """A label: one short line. Formulas are switched off where the picture is drawn."""
    return in_one_line(text, LONGEST_LABEL)


_NUMBER = r"-?[\d.]+(?:e[-+]?\d+)?"
_MARKUP = re.compile(rf"(\[{_NUMBER}, {_NUMBER}\](?![\[(:]))|[\\`*_<>~|$&#\[\]]")
"""An interval, `[97, 100]`, which is no link; or a character that may have a meaning."""

_LINKED = re.compile(r":(?=//)|@(?=\S)|\\#(?=\d)|\bGH-(?=\d)|www(?=\.)", re.IGNORECASE)
"""After what a link or a mention goes on, in text that is escaped already."""

_BLOCK = re.compile(r"^(?:\d{1,9}(?=[.)](?:\s|$))|(?=[-+=](?:[-+=\s]|$)))")
"""Where a backslash keeps a line from being a list or a rule."""

_COMMAND = re.compile(
    r":(?=:(?:add-[a-z]+|debug|echo|endgroup|error|group|notice|remove-matcher|save-state|set-[a-z]+"
    r"|stop-commands|warning)\b)|#(?=#(?:\[|vso\[))"
)
"""How a command begins, wherever wrapping may put it (GitHub: workflow commands, `##[` in older
runners; Azure: logging commands)."""

_FORMULA = re.compile(r"(?:^|;)(?=[\"\s]*[=+\-@\uff1d\uff0b\uff0d\uff20])")


def _line(text: str, longest: int) -> str:
    shown = _COMMAND.sub(lambda found: f"\\x{ord(found[0]):02x}", text[:longest])
    if not shown.isprintable():
        shown = "".join(
            char if char.isprintable() else " " if char.isspace() else ascii(char)[1:-1]
            for char in shown
        )
    if len(text) <= longest and len(shown) <= longest:
        return shown
    end = f"... ({len(text)} characters)"
    return shown[: longest - len(end)] + end
