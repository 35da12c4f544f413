"""DART's settings, its profiles, and on what they were chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from pytest_simbench.simulator import Seen, Settings, chosen_on
from pytest_simbench.simulator.settings import EACH, Log


@dataclass(frozen=True)
class DARTSettings(Settings):
    """DART's options; defaults are the engine's own.

    Attributes:
        timestep: [s]; DART's default.
        detector: collision detector; DART's default is `fcl`, Gazebo's is `ode`.
        solver: `dantzig` (pivoting, friction pyramid), `pgs` (projected Gauss-Seidel, friction
            pyramid) or `nsgs` (block Gauss-Seidel, Coulomb's cone).
        sweeps: largest number of passes of `pgs` and `nsgs`, DART's default for `nsgs`.
        tolerance: where they stop earlier; for `nsgs` the violation of the law of contact [m/s].
        sleeping: whether bodies at rest are frozen.
        split_impulse: correct penetrations by a velocity of their own.
    """

    timestep: Annotated[float, Log(5e-4, 0.005)] = 0.001
    detector: Annotated[Literal["fcl", "ode", "bullet", "dart"], EACH] = "fcl"
    solver: Annotated[Literal["dantzig", "pgs", "nsgs"], EACH] = "dantzig"
    sweeps: Annotated[int, Log(5, 300, when=("solver", "pgs", "nsgs"))] = 100
    tolerance: Annotated[float, Log(1e-6, 0.01, when=("solver", "pgs", "nsgs"), zero=True)] = 1e-5
    sleeping: bool = True
    split_impulse: Annotated[bool, EACH] = False


TUNED = DARTSettings(detector="ode", solver="nsgs", tolerance=5e-5)

PROFILES: Mapping[str, Settings] = {
    "default": DARTSettings(),
    "tuned": TUNED,
    "real": TUNED,
}

CHOSEN_ON = chosen_on(Seen.seeds("throwing", 100, 100), Seen.seeds("stacking", 100, 100))
