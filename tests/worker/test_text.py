"""Texts of exceptions, whatever they hold."""

from __future__ import annotations

import pytest

from pytest_simbench.worker.text import LONGEST, LONGEST_LOGGED, named, readable, told


def test_how_much_is_kept() -> None:
    assert (LONGEST, LONGEST_LOGGED) == (2000, 100_000)
    assert readable("x" * 2000) == "x" * 2000
    assert readable("x" * 2001) == "x" * 2000 + " ... (1 more characters)"
    assert readable("abcdef", 4) == "abcd ... (2 more characters)"
    assert told(ValueError("abcdef"), 4) == "abcd ... (2 more characters)"


def test_half_a_character_is_written_out() -> None:
    assert readable("a\ud800b") == "a\\ud800b"
    assert readable("\u00e4\u2713") == "\u00e4\u2713"


class Mute(Exception):
    def __str__(self) -> str:
        raise RuntimeError("no text")


@pytest.mark.parametrize(
    ("error", "message", "name"),
    [
        (ValueError("so"), "so", "ValueError: so"),
        (ValueError(), "", "ValueError"),
        (
            Mute(),
            "(its message cannot be read: RuntimeError)",
            "Mute: (its message cannot be read: RuntimeError)",
        ),
    ],
)
def test_type_and_message(error: Exception, message: str, name: str) -> None:
    assert (told(error), named(error)) == (message, name)
