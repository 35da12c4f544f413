"""Tests of what users type run pytest in processes of their own."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def importable(
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    """The inner pytest can import the helpers of these tests, and is no worker of xdist."""
    monkeypatch.setenv("PYTHONPATH", str(request.config.rootpath))
    for name in ("PYTEST_XDIST_WORKER", "PYTEST_XDIST_WORKER_COUNT", "PYTEST_XDIST_TESTRUNUID"):
        monkeypatch.delenv(name, raising=False)
    # matplotlib would look through all fonts in each test's new home: 5 to 10 s every time.
    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path_factory.getbasetemp() / "matplotlib"))
