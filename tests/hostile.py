"""Texts that a stranger might send, and what must not come of them."""

from __future__ import annotations

import csv
import io
import re
import unicodedata

from markdown_it import MarkdownIt
from markdown_it.token import Token

HOSTILE = (
    "\x1b]0;owned\x07\x1b[2J\x1b[31mred", "50 %\r100 %", "a\x08\x08b", "\u202egpj.exe", "\ud800",
    "![x](http://evil/x.png)", "[x](javascript:alert(1))", "# big", "<img src=x onerror=y>",
    "<script>", "a | b", "`c`", "*d* _e_ ~~f~~", "$x^2$", "@someone", "fix #12, GH-7",
    "https://evil.example", "www.evil.example", "me@evil.example", "[x]: http://evil", "![97, 100]",
    "[97, 100](http://evil)", "[97, 100][1, 2]", "- item", "+ item", "1. item", "2) item", "===",
    "---", "- - -", "> quote", "```\ncode", "~~~", "&lt;b&gt;", "&amp;", "a\\", "\\[x](y)",
    "=1+1", "+1", "-1", "@SUM(A1)", "\t=1", "\r=1", ' "=1"', "a;=1", 'a; "=1"', "\uff1d1",
    "[red]x[/red]", "a\n\n# b", "x\x00y", "\u2028\u2029\x85", "A" * 5000, "\x1b" * 5000, "",
    "a\n::error::owned", "::add-mask::x", "x " * 40 + "::stop-commands::x", "##[error]",
    "##vso[x]y", "  ::warning file=a::b",
)  # fmt: skip

FORMULA = tuple("=+-@\t\r\uff1d\uff0b\uff0d\uff20")
"""What begins a formula in a spreadsheet (OWASP, CSV injection), wide forms too."""


def parsed(document: str) -> list[Token]:
    """What Markdown makes of a document; no link may be defined in it."""
    environment: dict[str, object] = {}
    found = MarkdownIt("commonmark").enable(["table", "strikethrough"]).parse(document, environment)
    assert not environment.get("references")
    return found


def tokens(found: list[Token]) -> list[Token]:
    return [t for token in found for t in (token, *tokens(token.children or []))]


PLAIN = {
    "bullet_list_open", "list_item_open", "paragraph_open", "inline", "text", "text_special",
    "paragraph_close", "list_item_close", "bullet_list_close", "heading_open", "heading_close",
    "table_open", "thead_open", "tr_open", "th_open", "th_close", "tr_close", "thead_close",
    "tbody_open", "td_open", "td_close", "tbody_close", "table_close",
}  # fmt: skip
"""What our own headings, lists, paragraphs and tables are made of."""


COMMAND = re.compile(r"(?m)^\s*::[a-z-]+.*?::|##\[|##vso\[")
"""What GitHub's and Azure's runners take for a command in a log."""


def assert_harmless_terminal(text: str) -> None:
    """Nothing but printable characters and line ends; no command to a CI service."""
    assert not COMMAND.search(text)
    for char in text.replace("\n", ""):
        assert unicodedata.category(char)[0] != "C", repr(char)
        assert char.isprintable(), repr(char)


def assert_harmless_markdown(text: str) -> None:
    """Headings, paragraphs, lists and tables of plain text."""
    assert {token.type for token in tokens(parsed(text))} <= PLAIN
    for mark in ("://", "@s", "@e", "\\#1", "www."):
        assert mark not in text


def assert_harmless_csv(text: str) -> None:
    """No cell is a formula, whatever separates cells."""
    for delimiter in ",;":
        for row in csv.reader(io.StringIO(text), delimiter=delimiter):
            for cell in row:
                assert _is_number(cell) or not cell.lstrip().startswith(FORMULA), cell


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
