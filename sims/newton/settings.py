"""Newton's settings, its profiles, and on what they were chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Literal

from pytest_simbench.simulator import Seen, Settings, chosen_on
from pytest_simbench.simulator.settings import EACH, Log

from ..mujoco.settings import FileSettings, Solimp


@dataclass(frozen=True)
class NewtonSettings(Settings):
    """Options of SolverMuJoCo; defaults are the engine's own.

    Attributes:
        timestep: [s]; Newton's examples of SolverMuJoCo mostly take 1/60 s in 10 substeps.
        integrator: of MuJoCo; Newton's default is `implicitfast`.
        solver: of the constraints.
        iterations: of it, at most.
        cone: friction cone.
        impratio: ratio of friction to normal constraint impedance.
        condim: dimension of the contact space: 3 sliding, 4 with torsional friction.
        ke: contact stiffness [N/m]; SolverMuJoCo makes of it and `kd` MuJoCo's time constant of
            contacts, 2 / kd [s], and damping ratio, kd / (2 sqrt(ke)).
        kd: contact damping [N s/m].
        solimp: contact impedance: minimum, maximum, width [m].
        multiccd: whether round and convex shapes touch in several points, not in one.
        gap: distance within which contacts are looked for [m]; Newton's default is 0.1.
    """

    timestep: Annotated[float, Log(5e-4, 0.005)] = 1 / 600
    integrator: Literal["euler", "implicit", "implicitfast", "rk4"] = "implicitfast"
    solver: Annotated[Literal["CG", "Newton"], EACH] = "Newton"
    iterations: Annotated[int, Log(5, 200)] = 100
    cone: Annotated[Literal["pyramidal", "elliptic"], EACH] = "pyramidal"
    impratio: Annotated[float, Log(1, 100)] = 1.0
    condim: Literal[3, 4, 6] = 3
    ke: Annotated[float, Log(1e3, 1e6)] = 2500.0
    kd: Annotated[float, Log(30, 3000)] = 100.0
    solimp: Solimp = (0.9, 0.95, 0.001)
    multiccd: Annotated[bool, EACH] = False
    gap: float = 0.1


TUNED = NewtonSettings(
    timestep=0.001,
    cone="elliptic",
    condim=4,
    ke=250000.0,
    kd=1000.0,
    solimp=(0.99, 0.9999, 0.001),
    multiccd=True,
    gap=0.0,
)

PROFILES: Mapping[str, Settings] = {
    "default": NewtonSettings(),
    "tuned": TUNED,
    "real": replace(TUNED, ke=62500.0),
    "file": FileSettings(),
}

CHOSEN_ON = chosen_on(Seen.seeds("carrying", 1, 5))
