"""Policies that a worker can run, too: this file imports nothing but numpy and what it has."""

from __future__ import annotations

import time

import numpy as np

from pytest_simbench.scene.policy import Command, Observation, Policy


class Waving(Policy):
    """Moves joint 4 to and fro about where it is first seen, by an amplitude [rad]."""

    name = "waving"

    def __init__(self, amplitude: float) -> None:
        self.amplitude, self.seed = amplitude, 0

    def reset(self, seed: int) -> None:
        self.seed, self.start = seed, None

    def act(self, observation: Observation) -> Command:
        if self.amplitude > 1.0:
            raise SystemExit("too far")
        if self.start is None:
            self.start = observation.position[:7].copy()
        way = self.amplitude * np.sin(6.0 * observation.time + 1e-3 * self.seed)
        return Command(position=self.start + way * (np.arange(7) == 3), effort=np.zeros(7))


def still(observation: Observation) -> None:
    """Does nothing."""


def stalling(observation: Observation) -> None:
    """Gives no answer."""
    time.sleep(30.0)


def writing(observation: Observation) -> None:
    """Writes into what it sees."""
    observation.bodies[0, 0] += 0.1
