"""What a value may be that a user types: one kind for each form, used by options, ini and marks.

Imported at plugin load: standard library only.
"""

from __future__ import annotations

import os
import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any, ClassVar, Literal

LONGEST_WORD = 100
"""Characters in a name; more is a mistake, and would fill the terminal with its own complaint."""

LONGEST_PATH, LONGEST_FILE_NAME = 4095, 255
"""Bytes (Linux: PATH_MAX without its NUL, NAME_MAX)."""


class BadValue(ValueError):
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


def shown(value: object, longest: int = 60) -> str:
    """A value as messages show it: in one line, and not longer than that."""
    text = str(value)
    short = text if len(text) <= longest else f"{text[: longest - 3]}..."
    return short if short.isprintable() and short.strip() == short != "" else ascii(short)


class Kind(ABC):
    """A form of value.

    Attributes:
        many: the option may be given several times, and all of its values make one.
        flag: the option takes no value.
        ini: how pytest takes an ini value apart (`Parser.addini`).
    """

    many: ClassVar[bool] = False
    flag: ClassVar[bool] = False

    @property
    def ini(self) -> Literal["string", "args", "linelist"]:
        return "args" if self.many else "string"

    @abstractmethod
    def read(self, texts: Sequence[str]) -> Any:
        """The value; `texts` are all that was given, just one unless the kind takes many.

        Raises:
            BadValue: a text that is none of this kind, or none at all.
        """


class Flag(Kind):
    """On or off; in an ini file a word that says so."""

    flag: ClassVar[bool] = True
    words: ClassVar[dict[str, bool]] = {
        **dict.fromkeys(("1", "true", "on", "yes"), True),
        **dict.fromkeys(("0", "false", "off", "no"), False),
    }

    def read(self, texts: Sequence[str]) -> bool:
        word = texts[-1].strip().lower()
        if word not in self.words:
            raise BadValue(texts[-1], "give true or false")
        return self.words[word]


@dataclass(frozen=True, eq=False, repr=False)
class Number(Kind):
    """A finite number from `low` to `high`, both included."""

    low: float
    high: float
    whole: bool = False

    def read(self, texts: Sequence[str]) -> int | float:
        text = texts[-1].strip()
        number = r"[+-]?\d+" if self.whole else r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?"
        # 30 digits: Python refuses to read whole numbers of thousands of digits
        if not re.fullmatch(number, text, re.ASCII | re.IGNORECASE) or len(text) > 30:
            raise BadValue(texts[-1], self.advice)
        return self.check(int(text) if self.whole else float(text), texts[-1])

    def check(self, value: Any, given: Any = None) -> int | float:
        """The number itself, if it is one of this kind; `given` is what the user wrote.

        Raises:
            BadValue: it is none.
        """
        types = int if self.whole else (int, float)
        fine = isinstance(value, types) and not isinstance(value, bool) and isfinite(value)
        if not (fine and self.low <= value <= self.high):
            raise BadValue(value if given is None else given, self.advice)
        return int(value) if self.whole else value

    @property
    def advice(self) -> str:
        noun = "whole number" if self.whole else "number"
        return f"give a {noun} from {_plain(self.low)} to {_plain(self.high)}"


def _plain(number: float) -> str:
    return str(number) if isinstance(number, int) else f"{number:g}"


ANY_NUMBER = Number(-1e300, 1e300)


@dataclass(frozen=True)
class Auto:
    """`--reps auto`: repeat until the claims are decided, at most `limit` times."""

    limit: int


@dataclass(frozen=True, eq=False, repr=False)
class Repetitions(Kind):
    """A number of repetitions up to `most`, `auto`, or `auto:LIMIT`.

    Attributes:
        most: that can be asked for.
        auto: the limit where none is given.
    """

    most: int
    auto: int

    def read(self, texts: Sequence[str]) -> int | Auto:
        word, colon, limit = texts[-1].strip().partition(":")
        if word == "auto" and not colon:
            return Auto(self.auto)
        try:
            found = int(Number(1, self.most, whole=True).read([limit] if word == "auto" else texts))
        except BadValue as error:
            raise BadValue(texts[-1], f"{error.advice}, auto or auto:LIMIT") from None
        return Auto(found) if word == "auto" else found


@dataclass(frozen=True, eq=False, repr=False)
class Jobs(Kind):
    """A number up to `most`, or `auto`: one for each core that this process may use."""

    most: int

    def read(self, texts: Sequence[str]) -> int:
        if texts[-1].strip() == "auto":
            return min(len(os.sched_getaffinity(0)), self.most)
        try:
            return int(Number(1, self.most, whole=True).read(texts))
        except BadValue as error:
            raise BadValue(texts[-1], f"{error.advice}, or auto") from None


@dataclass(frozen=True, eq=False, repr=False)
class Choice(Kind):
    """One of a few words."""

    words: tuple[str, ...]

    def read(self, texts: Sequence[str]) -> str:
        if texts[-1] not in self.words:
            raise BadValue(texts[-1], f"choose from {', '.join(self.words)}")
        return texts[-1]


def _word(text: str, whole: str) -> str:
    word = text.strip()
    if not word:
        raise BadValue(whole, "a name in it is empty" if whole.strip() else "give a name")
    if len(word) > LONGEST_WORD or not word.isprintable():
        raise BadValue(whole, f"a name has at most {LONGEST_WORD} printable characters")
    return word


class Profiles(Kind):
    """Names, separated by commas, each once; of several such lists the last one counts."""

    def read(self, texts: Sequence[str]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(_word(part, texts[-1]) for part in texts[-1].split(",")))


class Steps(Kind):
    """Time steps in seconds, separated by commas; no two that the milliseconds of an id do not tell
    apart."""

    def read(self, texts: Sequence[str]) -> tuple[float, ...]:
        found: dict[str, float] = {}
        for part in texts[-1].split(","):
            try:
                step = float(Number(1e-9, 1e3).read([part]))
            except BadValue:
                raise BadValue(texts[-1], "give seconds, separated by commas: 1e-4,1e-3") from None
            if f"{step:.4g}" in found:
                raise BadValue(texts[-1], f"{step:g} is given twice; give it once")
            found[f"{step:.4g}"] = step
        return tuple(sorted(found.values(), reverse=True))


class Address(Kind):
    """Where a scheduler listens: `tcp://HOST:PORT`, or `tls://` with Dask's own configuration."""

    def read(self, texts: Sequence[str]) -> str:
        text = texts[-1].strip()
        form = r"(tcp|tls)://([\w.-]{1,253}|\[[0-9a-f:.]{2,45}\]):(\d{1,5})"
        found = re.fullmatch(form, text, re.ASCII | re.IGNORECASE)
        if not found or not 0 < int(found[3]) < 65536:
            raise BadValue(texts[-1], "write it as tcp://HOST:PORT or tls://HOST:PORT")
        return text


class Words(Kind):
    """Names, separated by commas (in an ini file by blanks too)."""

    many: ClassVar[bool] = True

    def read(self, texts: Sequence[str]) -> list[str]:
        return [_word(part, text) for text in texts or [""] for part in text.split(",")]


class Simulators(Words):
    """Names of simulators, separated by commas; behind an @ stands the path of an interpreter."""

    def read(self, texts: Sequence[str]) -> list[str]:
        found = []
        for text in texts or [""]:
            for part in text.split(","):
                name, at, path = part.strip().partition("@")
                found.append(_word(name, text) + at + (File().read([path]) if at else ""))
                if not part.isprintable():
                    raise BadValue(text, "an interpreter's path has printable characters")
        return found


@dataclass(frozen=True)
class Releases:
    """The last `number` releases of a simulator; of each minor version the last, if `minor`."""

    name: str
    number: int
    minor: bool


class LastReleases(Kind):
    """`NAME:N` or `NAME:N:minor`, a `Releases`."""

    def read(self, texts: Sequence[str]) -> Releases:
        found = re.fullmatch(r"([\w-]{1,100}):(\d{1,3})(:minor)?", texts[-1].strip(), re.ASCII)
        if found is None or not 2 <= int(found[2]) <= 100:
            raise BadValue(texts[-1], "write it as NAME:N or NAME:N:minor, with N from 2 to 100")
        return Releases(found[1], int(found[2]), bool(found[3]))


@dataclass(frozen=True)
class Span:
    """Releases of a simulator from a good one to a bad one, and the metric that is worse in it."""

    name: str
    good: str
    bad: str
    metric: str


class Bisection(Kind):
    """`NAME:GOOD..BAD` and `METRIC`, a `Span`."""

    def read(self, texts: Sequence[str]) -> Span:
        version = r"(\d[\w.+!-]{0,60}?)"
        form = rf"([\w-]{{1,100}}):{version}\.\.{version}"
        found = re.fullmatch(form, texts[0].strip(), re.ASCII)
        if found is None or found[2] == found[3]:
            raise BadValue(texts[0], "write it as NAME:GOOD..BAD METRIC, with two releases")
        if len(texts) != 2 or not re.fullmatch(r"\w{1,100}", texts[-1], re.ASCII):
            raise BadValue(texts[-1], "write it as NAME:GOOD..BAD METRIC")
        return Span(found[1], found[2], found[3], texts[1])


@dataclass(frozen=True, eq=False, repr=False)
class File(Kind):
    """A path, of which this machine's file system could have a file.

    Attributes:
        form: what may be given, for messages.
    """

    form: str = "a path"

    def read(self, texts: Sequence[str]) -> str:
        path = texts[-1]
        if not path.strip():
            raise BadValue(path, f"give {self.form}")
        if "\0" in path:
            raise BadValue(path, "a path holds no NUL character")
        try:
            names = os.fsencode(path).split(b"/")
        except UnicodeEncodeError:
            raise BadValue(path, "a path holds no lone surrogate") from None
        if max(map(len, names)) > LONGEST_FILE_NAME or len(os.fsencode(path)) > LONGEST_PATH:
            raise BadValue(path, "the path is longer than any file's")
        return path


class Files(Kind):
    """Paths, each given by itself."""

    many: ClassVar[bool] = True

    def read(self, texts: Sequence[str]) -> list[str]:
        return [File().read([text]) for text in texts or [""]]


@dataclass(frozen=True, eq=False, repr=False)
class Assignments(Kind):
    """`KEY=VALUE` texts, each key once.

    Attributes:
        form: how to write one, for messages.
        numbers: the values are finite numbers.
        commas: several may stand in one text. Without, the values may hold commas and blanks,
            and an ini file has one a line.
    """

    many: ClassVar[bool] = True

    form: str
    numbers: bool = False
    commas: bool = True

    @property
    def ini(self) -> Literal["string", "args", "linelist"]:
        return "args" if self.commas else "linelist"

    def read(self, texts: Sequence[str]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for text in texts or [""]:
            for part in text.split(",") if self.commas else [text]:
                key, value = self._pair(part, text)
                if key in found:
                    raise BadValue(text, f"{key} is given twice; give it once")
                found[key] = value
        return found

    def _pair(self, part: str, whole: str) -> tuple[str, Any]:
        key, _, value = (side.strip() for side in _partition(part))
        if not (key and value):
            raise BadValue(whole, f"write it as {self.form}")
        if len(key) > LONGEST_WORD or len(value) > LONGEST_PATH or not part.isprintable():
            raise BadValue(whole, f"write it as {self.form}, in printable characters")
        if not self.numbers:
            return key, value
        try:
            return key, ANY_NUMBER.read([value])
        except BadValue:
            raise BadValue(part, "the value must be a finite number") from None


def _partition(pair: str) -> tuple[str, str, str]:
    """A pair taken apart at its first `=` that is not of a version (`mysim==3.3.7.timestep=1`)."""
    found = re.search(r"(?<!=)=(?!=)", pair)
    return (pair, "", "") if found is None else (pair[: found.start()], "=", pair[found.end() :])


class Limits(Kind):
    """`METRIC:LIMIT,...`; which metrics there are is known later, see `measure.limits`."""

    def read(self, texts: Sequence[str]) -> str:
        for part in texts[-1].split(","):
            if not re.fullmatch(r"\w+\s*:\s*[\d.]{1,30}\s*%?", part.strip(), re.ASCII):
                raise BadValue(texts[-1], "write it as placed:5%,landing_error:0.01")
        return texts[-1]
