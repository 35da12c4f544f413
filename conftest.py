"""What the suites and the tests share when pytest runs from a checkout.

Nothing of it is installed: the plugin and the suites do without.
"""

from __future__ import annotations

import re
from functools import cached_property
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from xdist.scheduler import LoadScopeScheduling

pytest_plugins = ["pytester"]  # for the tests; pytest wants it named here and nowhere below


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> LoadScopeScheduling | None:
    """Under `-n N --dist loadgroup`, one process tests an engine that is slow to start.

    xdist 3.8 looks for its mark of groups in vain with pytest 9.2 (pytest-xdist issue 1386), so
    the group is found in the test's name.
    """
    if config.getoption("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadGroupScheduling

    from pytest_simbench.simulator.registry import adapter, registered

    class ByEngine(LoadGroupScheduling):
        @cached_property
        def slow(self) -> set[str]:
            return {name for name in registered() if adapter(name).info.costly_start}

        def _split_scope(self, nodeid: str) -> str:
            words = re.split(r"\W|_", nodeid.rpartition("/")[2])
            return min(self.slow.intersection(words), default=nodeid)

    return ByEngine(config, log)
