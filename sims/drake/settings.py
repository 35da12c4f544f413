"""Drake's settings, its profiles, and on what they were chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from pytest_simbench.simulator import Seen, Settings


@dataclass(frozen=True)
class DrakeSettings(Settings):
    """Drake's options; defaults are those of its MultibodyPlantConfig and SceneGraphConfig.

    Attributes:
        timestep: of the discrete update [s].
        contact_model: points, or hydroelastic surfaces where both shapes have a compliance.
        approximation: of the discrete contact problem, each solved by SAP.
        near_rigid_threshold: SAP softens contacts stiffer than this allows, for conditioning.
        stiction_tolerance: slip below which `lagged` and `similar` regularise friction [m/s].
        compliance: of every surface; `undefined` leaves the pair to point contact.
        hydroelastic_modulus: [Pa].
        point_stiffness: of a contact point [N/m].
        hunt_crossley_dissipation: of `lagged` and `similar` [s/m].
        relaxation_time: of `sap`'s linear dissipation [s].
        corner_radius: of the spheres in the corners of free boxes [m]; 0: none, plain boxes.
        pad_radius: of the spheres behind the fingers' gripping faces [m]; 0: none.
        shrink: what a free box with corner spheres loses on each face [m].
    """

    timestep: float = 0.001
    contact_model: Literal["point", "hydroelastic", "hydroelastic_with_fallback"] = (
        "hydroelastic_with_fallback"
    )
    approximation: Literal["sap", "similar", "lagged"] = "lagged"
    near_rigid_threshold: float = 1.0
    stiction_tolerance: float = 1e-4
    compliance: Literal["undefined", "rigid", "compliant"] = "undefined"
    hydroelastic_modulus: float = 1e7
    point_stiffness: float = 1e6
    hunt_crossley_dissipation: float = 50.0
    relaxation_time: float = 0.1
    corner_radius: float = 0.0
    pad_radius: float = 0.0
    shrink: float = 0.0


TUNED = DrakeSettings(
    timestep=0.002,
    contact_model="point",
    approximation="sap",
    relaxation_time=0.01,
    corner_radius=0.001,
    pad_radius=0.003,
    shrink=1e-4,
)

PROFILES: Mapping[str, Settings] = {
    "default": DrakeSettings(),
    "tuned": TUNED,
    "real": replace(TUNED, timestep=0.001),
}

SEEDS = (Seen.seeds("throwing", 2121, 2130), Seen.seeds("stacking", 100, 100))

CHOSEN_ON: Mapping[str, tuple[Seen, ...]] = {
    "tuned": SEEDS,
    "real": (*SEEDS, Seen.motions("cube_tosses", 0, 564, 6)),
}
