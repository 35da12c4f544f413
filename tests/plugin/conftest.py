"""pytest's configuration of a command line, in a folder of its own: nothing is collected or run."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from _pytest.config import _prepareconfig

Configure = Callable[..., pytest.Config]


@pytest.fixture
def configure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Configure]:
    """`configure("--reps=3")`, as `pytester.parseconfig` does it, which forgets imports after."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    with ExitStack() as ends:

        def made(*words: str) -> pytest.Config:
            # Captured, output would go to a file that `capsys` has closed before.
            config = _prepareconfig(["--capture=no", *words])
            ends.callback(config._ensure_unconfigure)
            return config

        yield made
