"""Tests of what users type run pytest in processes of their own."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def importable(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """The inner pytest can import the helpers of these tests."""
    monkeypatch.setenv("PYTHONPATH", str(request.config.rootpath))
