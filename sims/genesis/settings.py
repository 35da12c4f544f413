"""Genesis's settings, its profiles, and on what they were chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from pytest_simbench.simulator import Seen, Settings, chosen_on
from pytest_simbench.simulator.settings import EACH, Linear, Log, Share


@dataclass(frozen=True)
class GenesisSettings(Settings):
    """Genesis' options; defaults are the engine's own, `RigidOptions` and `SimOptions`.

    Attributes:
        timestep: [s].
        substeps: steps of the solver in one time step.
        precision: of all floating-point numbers, in bits.
        integrator: `approximate_implicitfast` adds the drives' damping to the mass matrix for good,
            `implicitfast` only while integrating velocities.
        friction_cone: shape of the friction cone.
        impratio: ratio of friction to normal constraint impedance; 0 leaves it to the engine, which
            takes 100 with the elliptic cone and 1 with the pyramid.
        constraint_timeconst: of contacts [s], at least two steps of the solver.
        impedance: of contacts: smallest, largest.
        iterations: largest number, of the constraint solver.
        tolerance: at which it stops; 0 leaves it to the engine (1e-5, in 64 bits 1e-8).
        noslip_iterations: of the friction post-processing, for the pyramid only.
        box_box_detection: two boxes are collided by an algorithm of their own, which now and then
            flings one of them (docs/engines/genesis.md).
        gjk: collide other convex shapes by GJK instead of MPR.
    """

    timestep: Annotated[float, Log(1e-3, 0.01)] = 0.01
    substeps: Annotated[int, Linear(1, 4)] = 1
    precision: Literal["32", "64"] = "32"
    integrator: Literal["approximate_implicitfast", "implicitfast", "Euler"] = (
        "approximate_implicitfast"
    )
    friction_cone: Annotated[Literal["pyramidal", "elliptic"], EACH] = "pyramidal"
    impratio: Annotated[float, Log(1, 100)] = 0.0
    constraint_timeconst: Annotated[float, Log(0.002, 0.05)] = 0.01
    impedance: tuple[Annotated[float, Share(0.5, 0.99)], Annotated[float, Share(0.9, 0.9999)]] = (
        0.9,
        0.95,
    )
    iterations: Annotated[int, Log(5, 200)] = 50
    tolerance: float = 0.0
    noslip_iterations: Annotated[int, Linear(0, 20, when=("friction_cone", "pyramidal"))] = 0
    box_box_detection: bool = False
    gjk: bool = False


@dataclass(frozen=True)
class GenesisFileSettings(GenesisSettings):
    """The scene's own file, in a world of the engine's own options.

    Attributes:
        timestep: [s]; the importer does not read the file's.
    """

    timestep: float = 0.002


TUNED = GenesisSettings(
    timestep=0.002,
    constraint_timeconst=0.004,
    friction_cone="elliptic",
)

PROFILES: Mapping[str, Settings] = {
    "default": GenesisSettings(),
    "tuned": TUNED,
    "real": TUNED,
    "file": GenesisFileSettings(),
}

CHOSEN_ON = chosen_on(
    Seen.seeds("throwing", 100, 101),
    Seen.seeds("stacking", 100, 100),
    Seen.seeds("pushing", 920008, 920008),
)
