"""What the suites and the tests share when pytest runs from a checkout.

Nothing of it is installed: the plugin and the suites do without.
"""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from xdist.scheduler import LoadScopeScheduling


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> LoadScopeScheduling | None:
    """Under `-n N --dist loadgroup`, tests that share what is slow to make run in one process.

    xdist 3.8 looks for its mark of groups in vain with pytest 9.2 (pytest-xdist issue 1386), so
    the group is found in the test's name.
    """
    if config.getoption("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadGroupScheduling

    class ByEngine(LoadGroupScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return group(nodeid)

    return ByEngine(config, log)


@cache
def engines() -> dict[str, bool]:
    """The engines by name, and whether each is slow to start."""
    from pytest_simbench.simulator.registry import adapter, registered

    return {name: adapter(name).info.costly_start for name in registered()}


def group(nodeid: str) -> str:
    """A slow engine's tests, another engine's tests of one file, the tests with a browser."""
    path, _, test = nodeid.partition("::")
    file = path.rpartition("/")[2]
    named = sorted(engines().keys() & set(re.split(r"\W|_", f"{file} {test}")))
    slow = [name for name in named if engines()[name]]
    if slow or named:
        return slow[0] if slow else f"{file} {named[0]}"
    return "browser" if file == "test_browser.py" else nodeid
