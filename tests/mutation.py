"""A plugin for mutmut alone (`[tool.mutmut]` in pyproject.toml, docs/mutation.md).

mutmut runs all tests once to learn which functions each of them calls. It tells this by an
environment variable, so our workers would count too. They cannot: they run in a folder
without mutmut's settings, and fail. The variable is taken out; mutmut's own process goes by its
own copy of it.
"""

from __future__ import annotations

import os

import pytest


@pytest.hookimpl(tryfirst=True)
def pytest_configure() -> None:
    if os.environ.get("MUTANT_UNDER_TEST") == "stats":
        del os.environ["MUTANT_UNDER_TEST"]
