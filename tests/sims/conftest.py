"""Workers that the tests of a module share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache

import pytest

from pytest_simbench.simulator import Simulator

from .worlds import Worlds


@pytest.fixture(scope="module")
def worlds_of() -> Iterator[Callable[[type[Simulator]], Worlds]]:
    """The worlds of an adapter, of each in one worker, whatever the order of the tests."""
    with ExitStack() as stack:
        yield cache(lambda cls: stack.enter_context(Worlds(cls)))
