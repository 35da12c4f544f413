"""MuJoCo's settings, its profiles, and on what they were chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Literal

from pytest_simbench.simulator import Seen, Settings, chosen_on
from pytest_simbench.simulator.settings import EACH, Linear, Log, Share

Solref = tuple[Annotated[float, Log(0.001, 0.05)], Annotated[float, Log(0.5, 4)]]
"""Time constant [s] and damping ratio of contacts."""

Solimp = tuple[
    Annotated[float, Share(0.5, 0.999)],
    Annotated[float, Share(0.9, 0.9999)],
    Annotated[float, Log(1e-4, 0.01)],
]
"""Impedance of contacts: minimum, maximum, width [m]."""


@dataclass(frozen=True)
class MuJoCoSettings(Settings):
    """MuJoCo's options; defaults are the engine's own but for the integrator.

    Attributes:
        timestep: [s]; MuJoCo's default is 0.002.
        integrator: `implicitfast` is what MuJoCo's documentation recommends where actuators have
            damping; the engine's default, Euler, treats theirs explicitly.
        solver: of the constraints.
        iterations: of it, at most.
        cone: friction cone.
        impratio: ratio of friction to normal constraint impedance.
        condim: dimension of the contact space: 3 sliding, 4 with torsional friction.
        solref: time constant [s] and damping ratio of contacts.
        solimp: contact impedance: minimum, maximum, width [m].
        noslip_iterations: of the friction post-processing.
    """

    timestep: Annotated[float, Log(5e-4, 0.01)] = 0.002
    integrator: Literal["Euler", "implicit", "implicitfast", "RK4"] = "implicitfast"
    solver: Annotated[Literal["PGS", "CG", "Newton"], EACH] = "Newton"
    iterations: Annotated[int, Log(5, 200)] = 100
    cone: Annotated[Literal["pyramidal", "elliptic"], EACH] = "pyramidal"
    impratio: Annotated[float, Log(1, 100)] = 1.0
    condim: Literal[3, 4, 6] = 3
    solref: Solref = (0.02, 1.0)
    solimp: Solimp = (0.9, 0.95, 0.001)
    noslip_iterations: Annotated[int, Linear(0, 20)] = 0


@dataclass(frozen=True)
class FileSettings(Settings):
    """The scene's own file, with its own options.

    Attributes:
        timestep: replaces the file's [s].
    """

    timestep: Annotated[float, Log(5e-4, 0.01)] = 0.002


TUNED = MuJoCoSettings(
    timestep=0.001,
    cone="elliptic",
    condim=4,
    solref=(0.002, 1.0),
    solimp=(0.99, 0.9999, 0.001),
)

PROFILES: Mapping[str, Settings] = {
    "default": MuJoCoSettings(),
    "tuned": TUNED,
    "real": replace(TUNED, solref=(0.004, 2.0)),
    "file": FileSettings(),
}

CHOSEN_ON = chosen_on(Seen.seeds("throwing", 1, 1), Seen.seeds("stacking", 1, 1))
