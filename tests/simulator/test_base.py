"""Engines that are imported when they are needed."""

from __future__ import annotations

import importlib
import math

import pytest

from pytest_simbench.simulator import lazy_import


def test_an_engines_function_is_looked_up_once_and_its_state_each_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    engine = lazy_import("math")
    assert (engine.sqrt(4.0), engine.pi) == (2.0, math.pi)
    monkeypatch.setattr(math, "pi", 3.0)
    assert engine.pi == 3.0
    monkeypatch.delattr(importlib, "import_module")
    assert engine.sqrt(9.0) == 3.0
