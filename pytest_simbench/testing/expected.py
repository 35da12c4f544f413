"""Expected failures: laws that an engine is known to break, each with its reason."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from pathlib import Path


class ConformanceWarning(UserWarning):
    """An expected failure that is none: its check passes, or there is no such check."""


def read_expected_failures(source: str | Path | Mapping[str, str]) -> dict[str, str]:
    """Reasons by check, from a mapping or a file with lines `check: reason`.

    A check is named by its name (`free_fall`) or a test id (`mysim-tuned-free_fall`), with
    wildcards as in a shell. Empty lines and lines that begin with # are passed over.

    Raises:
        ValueError: a line without a reason; names file and line.
    """
    if isinstance(source, Mapping):
        return dict(source)
    path, reasons = Path(source), {}
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        pattern, colon, reason = line.partition(":")
        if not colon or not reason.strip():
            raise ValueError(f"{path}, line {number}: write `check: reason`, not {line!r}")
        reasons[pattern.strip()] = reason.strip()
    return reasons


def reason_for(identifier: str, reasons: Mapping[str, str]) -> str | None:
    """Why the test of that id is expected to fail, None when it is not."""
    for pattern, reason in reasons.items():
        if _matches(identifier, pattern):
            return reason
    return None


def unmatched(reasons: Mapping[str, str], identifiers: Iterable[str]) -> list[str]:
    """Patterns that name no test."""
    known = list(identifiers)
    return [p for p in reasons if not any(_matches(i, p) for i in known)]


def _matches(identifier: str, pattern: str) -> bool:
    return fnmatchcase(identifier, pattern) or fnmatchcase(identifier.rpartition("-")[2], pattern)
