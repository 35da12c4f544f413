"""Newton's settings, its profiles, and on what they were chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from pytest_simbench.simulator import Seen, Settings

from ..mujoco.settings import FileSettings


@dataclass(frozen=True)
class NewtonSettings(Settings):
    """Options of SolverMuJoCo; defaults are the engine's own.

    Attributes:
        timestep: [s]; Newton's examples of SolverMuJoCo mostly take 1/60 s in 10 substeps.
        integrator: of MuJoCo; Newton's default is `implicitfast`.
        cone: friction cone.
        impratio: ratio of friction to normal constraint impedance.
        condim: dimension of the contact space: 3 sliding, 4 with torsional friction.
        ke: contact stiffness [N/m]; SolverMuJoCo makes of it and `kd` MuJoCo's time constant of
            contacts, 2 / kd [s], and damping ratio, kd / (2 sqrt(ke)).
        kd: contact damping [N s/m].
        solimp: contact impedance: minimum, maximum, width [m].
        gap: distance within which contacts are looked for [m]; Newton's default is 0.1.
    """

    timestep: float = 1 / 600
    integrator: Literal["euler", "implicit", "implicitfast", "rk4"] = "implicitfast"
    cone: Literal["pyramidal", "elliptic"] = "pyramidal"
    impratio: float = 1.0
    condim: Literal[3, 4, 6] = 3
    ke: float = 2500.0
    kd: float = 100.0
    solimp: tuple[float, float, float] = (0.9, 0.95, 0.001)
    gap: float = 0.1


TUNED = NewtonSettings(
    timestep=0.001,
    cone="elliptic",
    condim=4,
    ke=250000.0,
    kd=1000.0,
    solimp=(0.99, 0.9999, 0.001),
    gap=0.0,
)

PROFILES: Mapping[str, Settings] = {
    "default": NewtonSettings(),
    "tuned": TUNED,
    "real": replace(TUNED, ke=62500.0),
    "file": FileSettings(),
}

CHOSEN_ON: Mapping[str, tuple[Seen, ...]] = {"real": (Seen.motions("cube_tosses", 0, 564, 6),)}
