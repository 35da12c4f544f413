"""The command `simbench` as a user types it, in a process of its own."""

from __future__ import annotations

import os
import sys

import pytest


def simbench(pytester: pytest.Pytester, *words: str) -> pytest.RunResult:
    """What it prints and how it ends. It draws where the test's inner runs of pytest do."""
    undrawn = "tests.undrawn" in os.environ["PYTEST_ADDOPTS"]
    module = "tests.undrawn" if undrawn else "pytest_simbench"
    return pytester.run(sys.executable, "-m", module, *words)
