"""DART's settings, its profiles, and on what they were chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from pytest_simbench.simulator import Seen, Settings, chosen_on


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

    timestep: float = 0.001
    detector: Literal["fcl", "ode", "bullet", "dart"] = "fcl"
    solver: Literal["dantzig", "pgs", "nsgs"] = "dantzig"
    sweeps: int = 100
    tolerance: float = 1e-5
    sleeping: bool = True
    split_impulse: bool = False


TUNED = DARTSettings(detector="ode", solver="nsgs", tolerance=5e-5)

PROFILES: Mapping[str, Settings] = {
    "default": DARTSettings(),
    "tuned": TUNED,
    "real": TUNED,
}

CHOSEN_ON = chosen_on(Seen.seeds("throwing", 100, 100), Seen.seeds("stacking", 100, 100))
