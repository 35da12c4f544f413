"""Modules that are imported when they are first used."""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import Any


class _LazyModule(ModuleType):
    def __getattr__(self, attribute: str) -> Any:
        if attribute.startswith("__"):
            raise AttributeError(attribute)
        return getattr(importlib.import_module(self.__name__), attribute)


def lazy_import(name: str) -> Any:
    """Stand-in for the module `name`, which is imported when its first attribute is read.

    An adapter's facts and settings can so be read where its engine is not installed. Missing
    submodules are imported by naming them: `lazy_import("engine.viewer")`.
    """
    return _LazyModule(name)
