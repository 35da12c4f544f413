"""MuJoCo's settings, its profiles, and on what they were chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from pytest_simbench.simulator import Seen, Settings, chosen_on


@dataclass(frozen=True)
class MuJoCoSettings(Settings):
    """MuJoCo's options; defaults are the engine's own but for the integrator.

    Attributes:
        timestep: [s]; MuJoCo's default is 0.002.
        integrator: `implicitfast` is what MuJoCo's documentation recommends where actuators have
            damping; the engine's default, Euler, treats theirs explicitly.
        cone: friction cone.
        impratio: ratio of friction to normal constraint impedance.
        condim: dimension of the contact space: 3 sliding, 4 with torsional friction.
        solref: time constant [s] and damping ratio of contacts.
        solimp: contact impedance: minimum, maximum, width [m].
        noslip_iterations: of the friction post-processing.
    """

    timestep: float = 0.002
    integrator: Literal["Euler", "implicit", "implicitfast", "RK4"] = "implicitfast"
    cone: Literal["pyramidal", "elliptic"] = "pyramidal"
    impratio: float = 1.0
    condim: Literal[3, 4, 6] = 3
    solref: tuple[float, float] = (0.02, 1.0)
    solimp: tuple[float, float, float] = (0.9, 0.95, 0.001)
    noslip_iterations: int = 0


@dataclass(frozen=True)
class FileSettings(Settings):
    """The scene's own file, with its own options.

    Attributes:
        timestep: replaces the file's [s].
    """

    timestep: float = 0.002


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
