from __future__ import annotations

import pytest

from pytest_simbench.description.carried import Carried, markdown, named, terminal_lines

ACCOUNT = (
    Carried("option gravity", "carried", "0 0 -9.81"),
    Carried("geom margin", "not carried", "a | b", "g<1>"),
    Carried("damping", "approximated", "by 3 %"),
    Carried("geom gap", "not carried", "why"),
)


def test_it_crosses_the_boundary() -> None:
    assert [Carried.from_wire(line.to_wire()) for line in ACCOUNT] == list(ACCOUNT)


def test_there_are_three_states() -> None:
    with pytest.raises(ValueError, match="no state 'lost'"):
        Carried("mass", "lost", "")


def test_many_names_are_shortened() -> None:
    assert named("abc") == "a, b, c"
    assert named(["a", "b", "c", "d", "e"]) == "a, b, c and 2 more"


def test_the_page_has_a_row_each_and_first_what_is_not_carried() -> None:
    rows = markdown("my|file", ACCOUNT).splitlines()
    assert rows[0] == "# What was carried of my\\|file"
    assert rows[4:] == [
        "| geom margin | not carried | a \\| b | g\\<1\\> |",
        "| geom gap | not carried | why |  |",
        "| damping | approximated | by 3 % |  |",
        "| option gravity | carried | 0 0 -9.81 |  |",
    ]


def test_the_terminal_has_a_line_for_each_state() -> None:
    assert terminal_lines(ACCOUNT) == [
        "carried (1): option gravity",
        "approximated (1): damping",
        "not carried (2): geom margin; geom gap",
    ]
    assert terminal_lines(()) == []
