"""Omniverse PhysX's settings, its profiles, and on what they were chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Literal

from pytest_simbench.simulator import Seen, Settings, chosen_on
from pytest_simbench.simulator.settings import EACH, Linear, Log


@dataclass(frozen=True)
class OvPhysXSettings(Settings):
    """PhysX's options; defaults are those of its USD schemas.

    `tuned` takes a short step with few iterations, which lets an impact through: with many, a
    pyramid takes it as one block. What that costs the drives is told in docs/engines/ovphysx.md.

    Attributes:
        timestep: [s]; 1/60 is what PhysxSceneAPI says.
        solver: temporal or projected Gauss-Seidel.
        body_iterations: position iterations of free bodies.
        arm_iterations: those of the articulation. The largest number of all counts for the whole
            scene: with 4 for the arm, 1, 2 and 4 for the bodies give the same bits.
        velocity_iterations: of both.
        linear_damping, angular_damping: of bodies and links [1/s].
        sleeping: whether bodies at rest are frozen.
        max_depenetration_velocity: with which bodies that overlap are pushed apart [m/s].
        contact_offset: distance at which contacts are made [m]; None lets PhysX choose by size.
        rest_offset: distance at which they rest [m]; None lets PhysX choose.
        friction_offset_threshold: distance below which a contact has friction [m].
        friction_correlation_distance: below which contacts share a friction anchor [m].
        forces_every_iteration: apply gravity in each position iteration instead of once a step.
        contact_last: solve the articulation's contacts after everything else.
        threads: workers of PhysX; 0 computes in the calling thread. Its own default is 8, which
            computes the same bits, five times as slowly in a scene this small.
    """

    timestep: Annotated[float, Log(1e-3, 0.01)] = 1.0 / 60.0
    solver: Annotated[Literal["TGS", "PGS"], EACH] = "TGS"
    body_iterations: Annotated[int, Log(1, 64)] = 16
    arm_iterations: Annotated[int, Log(1, 64)] = 32
    velocity_iterations: Annotated[int, Linear(0, 8)] = 1
    linear_damping: float = 0.0
    angular_damping: float = 0.05
    sleeping: bool = True
    max_depenetration_velocity: Annotated[float, Log(0.05, 10)] = 3.0
    contact_offset: Annotated[float | None, Log(1e-3, 0.02)] = None
    rest_offset: float | None = None
    friction_offset_threshold: float = 0.04
    friction_correlation_distance: float = 0.025
    forces_every_iteration: Annotated[bool, EACH] = True
    contact_last: Annotated[bool, EACH] = False
    threads: int = 0


TUNED = OvPhysXSettings(
    timestep=0.002,
    body_iterations=4,
    arm_iterations=4,
    angular_damping=0.0,
    sleeping=False,
)

PROFILES: Mapping[str, Settings] = {
    "default": OvPhysXSettings(),
    "tuned": TUNED,
    "real": replace(TUNED, timestep=0.001, max_depenetration_velocity=0.1),  # docs/reality.md
}

CHOSEN_ON = chosen_on(
    Seen.seeds("throwing", 100, 119), real=(Seen.motions("arm_pushes", 1, 33, 4),)
)
