"""What a value may be that a user types: one function for each form.

Each takes a text and gives the value, as argparse's `type=` has it. Options, their ini twins and
the command `simbench` read with the same ones. Imported at plugin load: standard library only.
"""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from typing import Any, NamedTuple

from pytest_simbench.ground.text import for_terminal

LONGEST_WORD = 100
"""Characters in a name; more is a mistake, and would fill the terminal with its own complaint."""

LONGEST_PATH, LONGEST_FILE_NAME = 4095, 255
"""Bytes (Linux: PATH_MAX without its NUL, NAME_MAX)."""

AUTO_LIMIT = 160
"""Repetitions at which `--reps auto` gives up: with the looks before it 10, 20, 40, 80 and 160."""

MOST_REPETITIONS = 100_000
"""At a second each they take more than a day; a larger number is a slip of the hand."""

LARGEST_SEED = 2**53 - MOST_REPETITIONS - 1
"""The seed of every repetition is then a whole number that any reader of JSON keeps."""

LONGEST = 1e6
"""Of all time-outs [s]: eleven days."""


class BadInput(Exception):
    """Something that a user asks for cannot be; the message is one sentence."""

    def _render_traceback_(self) -> list[str]:
        """What IPython shows: the sentence alone."""
        return [for_terminal(str(self)), *getattr(self, "__notes__", ())]


class BadValue(BadInput, argparse.ArgumentTypeError):
    """A value that cannot be taken.

    Attributes:
        text: the part of the input that is wrong.
        advice: what to give instead, without a full stop.
    """

    def __init__(self, text: object, advice: str) -> None:
        super().__init__(advice)
        self.text = text
        self.advice = advice

    def sentence(self, name: str) -> str:
        """What is wrong with the value of the option, ini option or mark `name`."""
        return f"{name}={shown(self.text)}: {self.advice}"


def expect(name: str, value: object, kinds: type | tuple[type, ...], advice: str) -> None:
    """Check the type of an argument of the Python API.

    Raises:
        BadInput: it is of none of these types.
    """
    if not isinstance(value, kinds):
        raise BadInput(BadValue(value, advice).sentence(name))


@contextmanager
def refusing(
    errors: type[Exception] | tuple[type[Exception], ...],
    where: str = "",
    kind: Callable[[str], BaseException] = BadInput,
) -> Iterator[None]:
    """Make bad input, or what `kind` makes of a sentence, of these errors in this block: in their
    own words, after `WHERE: `."""
    try:
        yield
    except errors as error:
        raise kind(f"{where}: {error}" if where else str(error)) from None


def shown(value: object, longest: int = 60) -> str:
    """A value as messages show it: in one line, and not longer than that."""
    text = str(value)
    short = text if len(text) <= longest else f"{text[: longest - 3]}..."
    return short if short.isprintable() and short.strip() == short != "" else ascii(short)


WORDS = {
    **dict.fromkeys(("1", "true", "on", "yes"), True),
    **dict.fromkeys(("0", "false", "off", "no"), False),
}
"""What turns a flag on or off in an ini file."""


def flag(text: str) -> bool:
    """On or off, as an ini file says it."""
    if (word := text.strip().lower()) not in WORDS:
        raise BadValue(text, "give true or false")
    return WORDS[word]


@dataclass(frozen=True)
class Number:
    """A finite number from `low` to `high`, both included."""

    low: float
    high: float
    whole: bool = False

    def __call__(self, text: str) -> int | float:
        number = r"[+-]?\d+" if self.whole else r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?"
        # 30 digits: Python refuses to read whole numbers of thousands of digits
        if not re.fullmatch(number, text.strip(), re.A | re.I) or len(text.strip()) > 30:
            raise BadValue(text, self.advice)
        return self.check(int(text) if self.whole else float(text), text)

    def check(self, value: Any, given: Any = None) -> int | float:
        """The number itself, if it is one of this kind; `given` is what the user wrote.

        Raises:
            BadValue: it is none.
        """
        types = int if self.whole else (int, float)
        fine = isinstance(value, types) and not isinstance(value, bool) and isfinite(value)
        if not (fine and self.low <= value <= self.high):
            raise BadValue(value if given is None else given, self.advice)
        return int(value) if self.whole else float(value)

    @property
    def advice(self) -> str:
        low, high = (str(n) if isinstance(n, int) else f"{n:g}" for n in (self.low, self.high))
        return f"give a {'whole ' * self.whole}number from {low} to {high}"


ANY_NUMBER = Number(-1e300, 1e300)
REPETITIONS = Number(1, MOST_REPETITIONS, whole=True)
SECONDS = Number(0.001, LONGEST)
SHARE = Number(0, 1)
NOISE = Number(1e-9, 1)
SEED = Number(0, LARGEST_SEED, whole=True)
JITTER = Number(0, 1000)
_JOBS = Number(1, 256, whole=True)


class Auto(NamedTuple):
    """`--reps auto`: repeat until the claims are decided, at most `limit` times."""

    limit: int


def repetitions(text: str) -> int | Auto:
    """A number of repetitions, `auto`, or `auto:LIMIT`."""
    word, colon, limit = text.strip().partition(":")
    if word == "auto" and not colon:
        return Auto(AUTO_LIMIT)
    try:
        found = int(REPETITIONS(limit if word == "auto" else text))
    except BadValue as error:
        raise BadValue(text, f"{error.advice}, auto or auto:LIMIT") from None
    return Auto(found) if word == "auto" else found


def jobs(text: str) -> int:
    """A number of jobs, or `auto`: one for each core that this process may use."""
    if text.strip() == "auto":
        return min(len(os.sched_getaffinity(0)), int(_JOBS.high))
    try:
        return int(_JOBS(text))
    except BadValue as error:
        raise BadValue(text, f"{error.advice}, or auto") from None


def choice(*words: str) -> Callable[[str], str]:
    """One of a few words."""

    def choose(text: str) -> str:
        if text not in words:
            raise BadValue(text, f"choose from {', '.join(words)}")
        return text

    return choose


def word(text: str, form: str = "a name") -> str:
    """A name; `form` is for messages."""
    if not text.strip():
        raise BadValue(text, f"give {form}")
    if len(text.strip()) > LONGEST_WORD or not text.isprintable():
        raise BadValue(text, f"a name has at most {LONGEST_WORD} printable characters")
    return text.strip()


def profiles(text: str) -> tuple[str, ...]:
    """Names, or files that end in .toml, separated by commas, each once."""
    form = "default, tuned, real or file, or a file that ends in .toml"
    parts = (part.strip() for part in text.split(","))
    return tuple(dict.fromkeys(file(p) if p.endswith(".toml") else word(p, form) for p in parts))


def simulator(text: str) -> str:
    """The name of a simulator; behind an @ stands the path of an interpreter."""
    name, at, path = text.strip().partition("@")
    if not text.isprintable():
        raise BadValue(text, "give printable characters")
    return word(name, "a name (simbench list)") + at + (file(path) if at else "")


def simulators(text: str) -> list[str]:
    """Names of simulators, separated by commas."""
    return [simulator(part) for part in text.split(",")]


def file(text: str, form: str = "a path") -> str:
    """A path, of which this machine's file system could have a file; `form` is for messages."""
    if not text.strip():
        raise BadValue(text, f"give {form}")
    if "\0" in text:
        raise BadValue(text, "a path holds no NUL character")
    try:
        names = os.fsencode(text).split(b"/")
    except UnicodeEncodeError:
        raise BadValue(text, "a path holds no lone surrogate") from None
    if max(map(len, names)) > LONGEST_FILE_NAME or len(os.fsencode(text)) > LONGEST_PATH:
        raise BadValue(text, "the path is longer than any file's")
    return text


def policies(text: str) -> list[tuple[str, str]]:
    """Files, separated by commas, each with a name in it behind a colon or without."""
    found = []
    for part in map(str.strip, text.split(",")):
        path, name = file(part, "FILE.py or FILE.py:NAME"), ""
        if not os.path.isfile(path) and ":" in path:
            path, _, name = path.rpartition(":")
        if not os.path.isfile(path):
            raise BadValue(part, "there is no such file; give FILE.py or FILE.py:NAME")
        found.append((path, name))
    return found


def robot(text: str) -> str:
    """A robot's name or file, or `all`."""
    return file(text, "a name (simbench robots), a robot file, or all")


def steps(text: str) -> tuple[float, ...]:
    """Time steps in seconds, separated by commas; no two that the milliseconds of an id do not tell
    apart."""
    found: dict[str, float] = {}
    for part in text.split(","):
        try:
            step = float(Number(1e-9, 1e3)(part))
        except BadValue:
            raise BadValue(text, "give seconds, separated by commas: 1e-4,1e-3") from None
        if f"{step:.4g}" in found:
            raise BadValue(text, f"{step:g} is given twice; give it once")
        found[f"{step:.4g}"] = step
    return tuple(sorted(found.values(), reverse=True))


def _matched(text: str, form: str, advice: str, fine: Callable[[Any], bool] = bool) -> Any:
    """The match of a whole text, if it is fine."""
    found = re.fullmatch(form, text.strip(), re.A | re.I)
    if found is None or not fine(found):
        raise BadValue(text, advice)
    return found


def address(text: str) -> str:
    """Where a scheduler listens: `tcp://HOST:PORT`, or `tls://` with Dask's own configuration."""
    form = r"(tcp|tls)://([\w.-]{1,253}|\[[0-9a-f:.]{2,45}\]):(\d{1,5})"
    advice = "write it as tcp://HOST:PORT or tls://HOST:PORT"
    return str(_matched(text, form, advice, lambda found: 0 < int(found[3]) < 65536)[0])


class Releases(NamedTuple):
    """The last `number` releases of a simulator; of each minor version the last, if `minor`."""

    name: str
    number: int
    minor: bool


def releases(text: str) -> Releases:
    """`NAME:N` or `NAME:N:minor`."""
    advice = "write it as NAME:N or NAME:N:minor, with N from 2 to 100"
    form = r"([\w-]{1,100}):(\d{1,3})(:minor)?"
    found = _matched(text, form, advice, lambda found: 2 <= int(found[2]) <= 100)
    return Releases(found[1], int(found[2]), bool(found[3]))


class Span(NamedTuple):
    """Releases of a simulator from a good one to a bad one."""

    name: str
    good: str
    bad: str


def span(text: str) -> Span:
    """`NAME:GOOD..BAD`."""
    version, advice = r"(\d[\w.+!-]{0,60}?)", "write it as NAME:GOOD..BAD, with two releases"
    form = rf"([\w-]{{1,100}}):{version}\.\.{version}"
    found = _matched(text, form, advice, lambda found: found[2] != found[3])
    return Span(found[1], found[2], found[3])


def duration(text: str) -> float:
    """A time in seconds, minutes or hours [s]."""
    form = r"(\d+\.?\d*|\.\d+)\s*(s|min|h)"
    advice = "give a time: 90s, 30min or 2h"
    found = _matched(text, form, advice, lambda m: len(m[1]) < 10 and float(m[1]) > 0)
    return float(found[1]) * {"s": 1.0, "min": 60.0, "h": 3600.0}[found[2].lower()]


def words(text: str) -> list[str]:
    """Names, separated by commas."""
    return [word(part) for part in text.split(",")]


def metric(text: str) -> str:
    """The name of a metric."""
    return str(_matched(text, r"\w{1,100}", "give the name of a metric")[0])


def limits(text: str) -> str:
    """`METRIC:LIMIT,...`; which metrics there are is known later, see `measure.limits`."""
    for part in text.split(","):
        _matched(part, r"\w+\s*:\s*[\d.]{1,30}\s*%?", "write it as placed:5%,landing_error:0.01")
    return text


Pair = tuple[str, Any]


def assignment(text: str, form: str = "SIM=VALUE") -> list[Pair]:
    """`KEY=VALUE`, where the value may hold commas and blanks; `form` is how to write one."""
    # Taken apart at the first = that is not of a version: mysim==3.3.7.timestep=1
    key, _, value = re.sub(r"(?<!=)=(?!=)", "\0", text, count=1).partition("\0")
    key, value = key.strip(), value.strip()
    if "\0" in text or not (key and value):
        raise BadValue(text, f"write it as {form}")
    if len(key) > LONGEST_WORD or len(value) > LONGEST_PATH or not text.isprintable():
        raise BadValue(text, f"write it as {form}, in printable characters")
    return [(key, value)]


def settings(text: str) -> list[Pair]:
    """`SIM.SETTING=VALUE,...`."""
    return [pair for part in text.split(",") for pair in assignment(part, "SIM.SETTING=VALUE")]


def thresholds(text: str) -> list[Pair]:
    """`METRIC=NUMBER,...`, finite numbers."""
    found = []
    for part in text.split(","):
        ((key, value),) = assignment(part, "METRIC=NUMBER")
        try:
            found.append((key, ANY_NUMBER(value)))
        except BadValue:
            raise BadValue(part, "the value must be a finite number") from None
    return found


def each_once(pairs: Iterable[Pair]) -> dict[str, Any]:
    """Pairs as a dictionary.

    Raises:
        BadValue: a key is there twice.
    """
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise BadValue(f"{key}={value}", f"{key} is given twice; give it once")
        found[key] = value
    return found
