"""The command `simbench` as a user types it, in a process of its own."""

from __future__ import annotations

import sys

import pytest


def simbench(pytester: pytest.Pytester, *words: str) -> pytest.RunResult:
    """What it prints and how it ends."""
    return pytester.run(sys.executable, "-m", "pytest_simbench", *words)
