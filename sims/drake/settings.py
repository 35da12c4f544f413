"""Drake's settings, its profiles, and on what they were chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

from pytest_simbench.simulator import Seen, Settings, chosen_on
from pytest_simbench.simulator.settings import EACH, Linear, Log

LAGGED = ("approximation", "similar", "lagged")


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

    timestep: Annotated[float, Log(5e-4, 0.01)] = 0.001
    contact_model: Literal["point", "hydroelastic", "hydroelastic_with_fallback"] = (
        "hydroelastic_with_fallback"
    )
    approximation: Annotated[Literal["sap", "similar", "lagged"], EACH] = "lagged"
    near_rigid_threshold: Annotated[float, Linear(0, 1)] = 1.0
    stiction_tolerance: Annotated[float, Log(1e-5, 0.01, when=LAGGED)] = 1e-4
    compliance: Literal["undefined", "rigid", "compliant"] = "undefined"
    hydroelastic_modulus: float = 1e7
    point_stiffness: Annotated[float, Log(1e4, 1e8)] = 1e6
    hunt_crossley_dissipation: Annotated[float, Log(1, 200, when=LAGGED, zero=True)] = 50.0
    relaxation_time: Annotated[float, Log(1e-3, 0.5, when=("approximation", "sap"), zero=True)] = (
        0.1
    )
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

CHOSEN_ON = chosen_on(Seen.seeds("throwing", 2121, 2130), Seen.seeds("stacking", 100, 100))

OLDEST = "1.40.0"
"""The oldest one that was tried and runs. 1.37 does not tell a shape's convex hull, which the
parity check asks for; 1.36 makes no hull of points."""


def without_sampled_ports(config: Any) -> dict[str, bool]:
    """Options that switch sampled output ports off, where a release has them: they would add state,
    and only cost time here."""
    name = "use_sampled_output_ports"
    return {name: False} if hasattr(config(), name) else {}
