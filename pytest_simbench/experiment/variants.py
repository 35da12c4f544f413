"""What a test is made for: a simulator in a mode, at a settings profile, at a time step, with a
robot.

A profile, a step and a robot that a run has anyway add nothing to a test's id, so that the same
test keeps its name in a run of one profile, in one of two, and in a sweep."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from pytest_simbench.records.series import step_text
from pytest_simbench.simulator.settings import LARGEST_TIMESTEP, SHORTEST_TIMESTEP

USUAL = "tuned"
"""The settings profile of a run that names none."""

STEPS = 6
"""Time steps of a sweep that names none: five octaves."""

LONGER = 2
"""Octaves of them above the profile's own step, where the limits of a time step allow so many."""


class Variant(NamedTuple):
    """One parameter of a test.

    Attributes:
        simulator, mode, profile: as in `Case`.
        timestep: of a sweep [s]; None for the profile's own.
        own_timestep: the profile's own [s], where `timestep` is another.
        robot: its name; empty for the tasks' own.
    """

    simulator: str
    mode: str
    profile: str
    timestep: float | None = None
    own_timestep: float | None = None
    robot: str = ""

    @property
    def swept(self) -> bool:
        """Whether its time step is another one than the profile's own."""
        return self.timestep is not None

    @property
    def changes(self) -> dict[str, Any]:
        """The settings that it changes."""
        return {} if self.timestep is None else {"timestep": self.timestep}

    def id_with(self, profiles: int) -> str:
        """Its part of a test's id, in a run of so many profiles."""
        profile = self.profile if profiles > 1 and self.profile != USUAL else ""
        step = "" if self.timestep is None else f"dt={step_text(self.timestep)}"
        return "-".join(filter(None, [self.simulator, self.mode, self.robot, profile, step]))


def variants(
    simulator: str, mode: str, profile: str, own: float, asked: bool | Sequence[float]
) -> list[Variant]:
    """The variants of one simulator, mode and profile, whose own time step is `own` [s]: one for
    each that is asked for [s]; True stands for those around its own."""
    steps = around(own) if isinstance(asked, bool) else asked
    plain = Variant(simulator, mode, profile)
    return [
        plain
        if step_text(step) == step_text(own)
        else plain._replace(timestep=step, own_timestep=own)
        for step in steps
    ]


def around(own: float) -> list[float]:
    """The steps of a sweep around a profile's own [s], the longest first: powers of two of it, of
    which none is too long or too short for a setting."""
    most = math.floor(math.log2(LARGEST_TIMESTEP / own) + 1e-9)
    least = math.ceil(math.log2(SHORTEST_TIMESTEP / own) - 1e-9)
    first = max(min(LONGER, most), least + STEPS - 1)
    return [own * 2.0**k for k in range(first, first - STEPS, -1)]


def problem(steps: Sequence[float]) -> str:
    """Why no simulator takes these time steps [s]; empty where they can be taken."""
    for step in steps:
        if not SHORTEST_TIMESTEP <= step <= LARGEST_TIMESTEP:
            return (
                f"--sim-sweep={step:g}: give time steps from {SHORTEST_TIMESTEP:g} to "
                f"{LARGEST_TIMESTEP:.4g} seconds"
            )
    return ""
