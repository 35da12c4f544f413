"""Whatever a text holds, the medium that shows it shows text."""

from __future__ import annotations

import csv
import io
import unicodedata

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from pytest_simbench.ground.text import (
    BLANK,
    LONGEST_LABEL,
    LONGEST_LINE,
    for_csv,
    for_figure,
    for_markdown,
    for_terminal,
    in_one_line,
)
from tests.hostile import FORMULA, HOSTILE, PLAIN, parsed, tokens

# Characters that mean something somewhere, more often than chance would draw them.
TEXTS = st.one_of(
    st.sampled_from(HOSTILE),
    st.text(),
    st.text(st.characters(exclude_categories=())),
    st.text(st.sampled_from("[]()!#<>&;|*_`~\\-+=.1 ,:/@wWhtpGH$'\"\n\r\t\x1b\u202ea")),
    st.lists(st.sampled_from(HOSTILE), min_size=2, max_size=3).map("".join),
)


def examples(test: object) -> object:
    for text in HOSTILE:
        test = example(text)(test)  # type: ignore[arg-type]
    return test


@examples
@given(TEXTS)
def test_a_terminal_gets_no_control_character(text: str) -> None:
    shown = for_terminal(text)
    for char in shown.replace("\n", ""):
        assert unicodedata.category(char)[0] != "C"
        assert char.isprintable()
    assert all(len(line) <= LONGEST_LINE for line in shown.split("\n"))
    assert shown.count("\n") == text.count("\n")
    assert for_terminal(shown) == shown
    shown.encode()  # no lone surrogate


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=LONGEST_LINE))
def test_harmless_text_stays(text: str) -> None:
    assert for_terminal(text) == text


def test_what_is_cut_says_how_much_there_was() -> None:
    assert for_terminal("x" * 5_000_000).endswith("xxx... (5000000 characters)")


@examples
@given(TEXTS)
def test_one_line_is_one_line(text: str) -> None:
    shown = in_one_line(text)
    assert len(shown.splitlines()) <= 1
    assert shown == " ".join(shown.split())


@examples
@given(TEXTS)
def test_markdown_makes_nothing_of_it(text: str) -> None:
    shown = for_markdown(text)
    document = (
        f"# {shown}\n\n{shown}\n\n- {shown}\n- note: {shown}\n\n| {shown} | b |\n| :-- | --: |\n"
        f"| {for_markdown(text, cell=True)} | {shown} |\n"
    )
    found = parsed(document)
    kinds = [token.type for token in tokens(found)]
    assert set(kinds) <= PLAIN
    assert (kinds.count("heading_open"), kinds.count("bullet_list_open")) == (1, 1)
    assert (kinds.count("list_item_open"), kinds.count("table_open")) == (2, 1)
    assert (kinds.count("th_open"), kinds.count("td_open")) == (2, 2)
    inline = [token for token in found if token.type == "inline"]
    for token in inline[:3] if in_one_line(text) else ():  # shown as it is
        said = "".join(child.content for child in token.children or [])
        assert said.replace("\u200b", "") == in_one_line(text).replace("\u200b", "")


@pytest.mark.parametrize(
    ("text", "broken"),
    [
        ("see https://evil.example", "https:&#8203;//"),
        ("see ftp://evil.example", "ftp:&#8203;//"),
        ("see WWW.evil.example", "WWW&#8203;."),
        ("a@evil.example", "a@&#8203;evil"),
        ("@someone", "@&#8203;someone"),
        ("fix #12", r"fix \#&#8203;12"),
        ("GH-12", "GH-&#8203;12"),
    ],
)
def test_github_finds_no_link_and_no_mention(text: str, broken: str) -> None:
    assert broken in for_markdown(text)
    assert for_markdown(text).count(BLANK) == 1


def test_intervals_stay_readable() -> None:
    text = "93 / 99 / 100 [97, 100], -1.5e-05 [-2e-05, 0.1]"
    assert for_markdown(text) == text


@examples
@given(TEXTS)
def test_no_cell_is_a_formula(text: str) -> None:
    file = io.StringIO()
    csv.writer(file).writerow(map(for_csv, ["first", text, -1.5, text]))
    for delimiter in ",;":
        for row in csv.reader(io.StringIO(file.getvalue()), delimiter=delimiter):
            for cell in row:
                if cell != "-1.5":
                    assert cell.lstrip()[:1] not in FORMULA
    (row,) = csv.reader(io.StringIO(file.getvalue()))
    assert row[0] == "first"
    assert row[2] == "-1.5"
    assert for_csv("=1; @b-c") == "'=1;' @b-c"


@pytest.mark.parametrize("value", [-1, -1.5, True, None, float("nan")])
def test_numbers_stay_numbers(value: object) -> None:
    assert for_csv(value) is value


@examples
@given(TEXTS)
def test_labels_are_short(text: str) -> None:
    assert len(for_figure(text)) <= LONGEST_LABEL
    assert for_figure(text).isprintable()


def test_what_can_be_read_stays() -> None:
    """Beside what cannot, too."""
    assert for_terminal("\u00e4\x1b\u4e2d\u2003x\ty") == "\u00e4\\x1b\u4e2d x y"
    assert in_one_line("a\n b\u202e") == "a b\\u202e"


def test_how_a_long_line_ends() -> None:
    assert for_terminal("x" * 50, 50) == "x" * 50
    assert for_terminal("x" * 51, 50) == "x" * 31 + "... (51 characters)"
    assert len(for_terminal("\x1b" * 30, 50)) == 50
    assert for_terminal("a\r\nb\nc") == "a\nb\nc"
