"""pytest's side: hooks, options, fixtures, selection, progress.

pytest loads `hooks` by itself. Where it loads no plugins by itself
(`PYTEST_DISABLE_PLUGIN_AUTOLOAD`), name this package: `-p pytest_simbench.plugin`, or
`pytest_plugins = ["pytest_simbench.plugin"]` in the top conftest.py. Both also do no harm where
`hooks` is loaded already, which pytest would refuse to load a second time under another name.
PYTEST_DONT_REWRITE: there are no assertions to explain.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pytest


def pytest_addoption(pluginmanager: pytest.PytestPluginManager) -> None:
    """Load the hooks, unless they are there; called as soon as pytest knows this package."""
    from pytest_simbench.plugin import hooks

    if not pluginmanager.is_registered(hooks):
        pluginmanager.register(hooks, "simbench")
