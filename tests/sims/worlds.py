"""Worlds of an adapter: in this process, and in one worker that loads one after the other, for
engines that are slow to start."""

from __future__ import annotations

from typing import Any, TypeVar

import pytest

from pytest_simbench.client.environments import missing
from pytest_simbench.client.world import World
from pytest_simbench.scene import Scene
from pytest_simbench.simulator import Simulator
from pytest_simbench.simulator.settings import changed
from pytest_simbench.testing import Subject

S = TypeVar("S", bound=Simulator)


def loaded(cls: type[S], scene: Scene, profile: str = "tuned", **changes: Any) -> S:
    """A simulator in this process, with these settings changed. Skips the test where the engine is
    missing."""
    absent = missing(cls.info)
    if absent:
        pytest.skip(absent)
    simulator = cls(changed(cls.profiles[profile], changes, cls.info.name))
    simulator.load(scene)
    return simulator


def stepped(simulator: S, seconds: float) -> S:
    """The simulator, so much later [s]."""
    for _ in range(round(seconds / simulator.settings.timestep)):
        simulator.step()
    return simulator


class Worlds:
    """Worlds of an adapter, in one worker. Skips the test where the engine is missing."""

    def __init__(self, cls: type[Simulator]) -> None:
        absent = missing(cls.info)
        if absent:
            pytest.skip(absent)
        self.cls = cls
        self.worker = Subject(cls).launch()

    def __enter__(self) -> Worlds:
        return self

    def __exit__(self, *error: object) -> None:
        self.worker.close()

    def load(
        self, scene: Scene, profile: str = "tuned", parity: bool = True, **changes: Any
    ) -> World:
        """A world, with these settings changed."""
        Subject(self.cls, profile).construct(self.worker, changes)
        return World(self.worker, scene, parity=parity)
