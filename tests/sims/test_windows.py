"""A window that the user closes ends nothing."""

from __future__ import annotations

from types import SimpleNamespace

from pytest_simbench.sims.genesis.adapter import Genesis
from pytest_simbench.sims.sapien.drawing import Drawing


def test_a_closed_window_is_drawn_no_more() -> None:
    """SAPIEN's viewer and Genesis' raise where they are asked to."""
    gone = SimpleNamespace(closed=True, is_alive=lambda: False)
    drawing = Drawing.__new__(Drawing)
    drawing._viewer = gone
    drawing.show()
    simulator = Genesis(Genesis.profiles["tuned"], gui=True)
    simulator.world = SimpleNamespace(viewer=gone)
    simulator.refresh_window()
