"""From what the page tells to HTML: every text is escaped, and nothing is loaded from anywhere."""

from __future__ import annotations

import hashlib
import re
from base64 import b64encode
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined, Template
from markupsafe import Markup

from pytest_simbench import __version__
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.measure.watching import Step
from pytest_simbench.report.model import watched
from pytest_simbench.report.model.document import Cell, Section, Table, capital
from pytest_simbench.report.model.tables import COUNTED
from pytest_simbench.report.page.context import Shown

_LOG = re.compile(r"logs/[A-Za-z0-9_=-][A-Za-z0-9_.=-]*\.log")
"""A log in the run folder, as this package names them: it becomes a link, anything else a text."""

SYMBOLS = {"ahead": ("\u25b2", "ahead"), "behind": ("\u25bc", "behind"),
           "apart": ("\u2260", "differs, no direction is right"),
           "same": ("\u2248", "the same within 5 points"),
           "open": ("?", "not told apart, or not yet"), "": ("", "")}  # fmt: skip
"""Of the verdicts: what is seen without colours, and what is read aloud."""


def render(page: Shown) -> str:
    """The page as one HTML document, without a line that depends on when it was made."""
    style, script = _part("page.css"), _part("page.js")
    # No other script runs, whatever a text smuggled in; nothing is loaded.
    policy = (
        f"default-src 'none'; script-src 'sha256-{_digest(script)}'; style-src 'unsafe-inline'; "
        "img-src data:; base-uri 'none'; form-action 'none'"
    )
    given = {"style": Markup(style), "script": Markup(script), "policy": policy}
    return _template("page.html").render(page=page, **given)


def fragment(sections: Sequence[Section]) -> str:
    """Sections as a part of somebody else's page, a notebook's for instance."""
    return _template("sections.html").render(sections=sections)


def render_watch(steps: Sequence[Step], sentences: Sequence[str]) -> str:
    """The page of a watch: its steps, and what its last run did."""
    told, style = watched.section(steps, sentences), Markup(_part("page.css"))
    return _template("watch.html").render(told=told, steps=steps, style=style)


def _rows(found: Table) -> list[tuple[Cell, ...]]:
    """The rows of a table; texts stand in one line."""
    first, *others = found.columns
    shown = [first, *(column.joined() if column.left else column for column in others)]
    return list(zip(*(column.cells for column in shown), strict=True))


@cache
def _template(name: str) -> Template:
    """A template, with what all of them may call."""
    environment = Environment(
        loader=FunctionLoader(_part),
        autoescape=True,
        finalize=_text,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals.update(
        symbols=SYMBOLS,
        capital=capital,
        rows=_rows,
        svg=lambda picture: Markup(picture.svg),
        log_link=lambda log: log if _LOG.fullmatch(log) else "",
        counted=COUNTED,
        version=__version__,
    )
    return environment.get_template(name)


def _part(name: str) -> str:
    """A template, also from a zip file."""
    return (files(__package__) / "templates" / name).read_text(encoding="utf-8")


def _text(value: Any) -> Any:
    """Texts lose what is not to be seen; what was made safe on purpose stays as it is."""
    plain = isinstance(value, str) and not hasattr(value, "__html__")
    return for_terminal(value) if plain else value


def _digest(script: str) -> str:
    """Of the script as the page holds it, for its policy."""
    return b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
