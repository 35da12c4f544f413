"""Texts of exceptions, made fit to travel and to be kept, whatever they hold."""

from __future__ import annotations

from typing import Any

LONGEST = 2000
"""Characters of a message that are kept; the log holds more."""

LONGEST_LOGGED = 100_000
"""Characters of a message, or of a traceback, in the log."""


def readable(text: str, longest: int = LONGEST) -> str:
    """The text as plain Unicode, and how much of it was cut off."""
    text = str.encode(text, "utf-8", "backslashreplace").decode("utf-8")  # of any kind of text
    cut = len(text) - longest
    return text if cut <= 0 else f"{text[:longest]} ... ({cut} more characters)"


def told(error: BaseException, longest: int = LONGEST) -> str:
    """The message of an exception, or what keeps it from having one."""
    try:
        return readable(str(error), longest)
    except BaseException as another:
        return f"(its message cannot be read: {readable(type(another).__name__)})"


def named(error: BaseException) -> str:
    """Type and message of an exception."""
    name, message = readable(type(error).__name__), told(error)
    return f"{name}: {message}" if message else name


def shown(value: Any) -> str:
    """A value for a message on a wrong one; short, whatever it is."""
    try:
        return readable(repr(value))[:80]
    except BaseException:
        return f"a {readable(type(value).__name__)}"
