"""Policies that come with the plugin: small controllers of a few numbers, and how these were found.

What a policy sees of a body is off: by a place that stays for an episode, and a bit more each time
it looks. Both are drawn from the episode's seed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from pytest_simbench.scene import Pose
from pytest_simbench.scene.policy import Command, Observation, Policy

OFFSET, NOISE = 0.005, 0.002
"""Standard deviations along x and y [m]: of what stays for an episode, and of each look."""

DOWN = (0.0, 1.0, 0.0, 0.0)
"""Orientation of the tool: it points down."""


class Controller(Policy):
    """A policy of a few numbers, given in the order of their bounds.

    Attributes:
        task: of the suite, that it is for.
        body: that it looks at.
        bounds: of its numbers, by name: where training looks for them.
        offset: as `OFFSET`.
    """

    rate = 10.0
    task = ""
    body = ""
    bounds: Mapping[str, tuple[float, float]] = {}

    def __init__(self, name: str, numbers: Iterable[float], offset: float = OFFSET) -> None:
        self.name, self.numbers = name, dict(zip(self.bounds, numbers, strict=True))
        self.offset = offset

    def reset(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._offset = self._rng.normal(0.0, self.offset, 2)
        self._place: np.ndarray | None = None

    def look(self, seen: Observation) -> np.ndarray:
        """Where the body seems to be (x, y) [m]: each look moves it by the share `smoothing`."""
        found = np.array(seen.pose(self.body).position[:2]) + self._offset
        found = found + self._rng.normal(0.0, NOISE, 2)
        if self._place is None:
            self._place = found
        self._place = self._place + self.numbers["smoothing"] * (found - self._place)
        return self._place

    def move(self, seen: Observation, target, speed: float, gripper: float = 0.0) -> Command:
        """The tool goes towards a place [m] as fast as that [m/s]."""
        here = np.array(seen.tool.position)
        way = np.subtract(target, here)
        way = way * min(1.0, speed / self.rate / max(float(np.linalg.norm(way)), 1e-9))
        return Command(tool=Pose(tuple(map(float, here + way)), DOWN), gripper=gripper)


class Limp(Policy):
    """Does nothing: the arm stays where it is."""

    name, rate = "limp", Controller.rate

    def __init__(self, task: str) -> None:
        self.task = task

    def act(self, seen: Observation) -> None:
        return None
