"""What the suites and the tests share when pytest runs from a checkout.

Nothing of it is installed: the plugin and the suites do without.
"""

from __future__ import annotations

import re

import pytest

pytest_plugins = ["pytester"]  # for the tests; pytest wants it named here and nowhere below


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Under `-n N --dist loadgroup`, one process tests an engine that is slow to start."""
    from pytest_simbench.simulator.registry import adapter, registered

    slow = {name for name in registered() if adapter(name).info.costly_start}
    for item in items:
        words = re.split(r"\W|_", f"{item.path.stem} {item.name}")
        for name in slow.intersection(words):
            item.add_marker(pytest.mark.xdist_group(name))
