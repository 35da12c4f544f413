"""Names of simulators with a version in them: `mysim==3.3.7`, a release; `mysim@main`, a build.

A release lives in an environment of its own. A build lives in an interpreter that the user names;
what follows the `@` is its version, or a label that the user gave it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

RELEASE, BUILD = "==", "@"

_FORM = re.compile(
    r"(?P<base>[\w-]{1,100})(?:(?P<kind>==|@)(?P<which>[a-z0-9](?:[\w.+!-]{0,58}\w)?))?",
    re.ASCII | re.IGNORECASE,
)
_NUMBERS = re.compile(r"\d+(\.\d+)*")


@dataclass(frozen=True)
class VersionedName:
    """A simulator's name, taken apart.

    Attributes:
        base: the registered name.
        kind: `==` of a release, `@` of a build, empty of the engine that is installed.
        which: the release's version; the build's version or label; empty.
    """

    base: str
    kind: str = ""
    which: str = ""

    @classmethod
    def of(cls, name: str) -> VersionedName:
        """A name taken apart; one that has not the form of a version is all base."""
        found = _FORM.fullmatch(name)
        if found is None:
            return cls(name)
        return cls(found["base"], found["kind"] or "", found["which"] or "")


def base_name(name: str) -> str:
    """The registered name of a simulator, without its version."""
    return VersionedName.of(name).base


def covers(asked: str, name: str) -> bool:
    """Whether what was said of `asked` holds for `name`: a bare name means all of its versions."""
    return asked in (name, base_name(name))


def release_numbers(version: str) -> tuple[int, ...]:
    """The numbers that a version begins with, to compare versions by; without zeros at the end.

    What follows them (`rc1`, `.dev15`) counts for nothing. Empty for what is no version.
    """
    found = _NUMBERS.match(version)
    numbers = [int(part) for part in found[0].split(".")] if found else []
    while numbers and numbers[-1] == 0:
        numbers.pop()
    return tuple(numbers)
