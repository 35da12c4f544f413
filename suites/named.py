"""Suites that take long: they run where somebody names their file, and not with all suites."""

import pytest


def skip_where_not_named(request: pytest.FixtureRequest) -> None:
    stem = request.path.stem
    if not any(stem in argument for argument in request.config.args):
        pytest.skip(f"it runs where {stem} is named")
