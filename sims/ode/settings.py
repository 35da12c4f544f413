"""ODE's settings, its profiles, and on what they were chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

from pytest_simbench.simulator import Seen, Settings, chosen_on
from pytest_simbench.simulator.settings import EACH, Linear, Log, Share

from .drives import Drive


@dataclass(frozen=True)
class ODESettings(Settings):
    """ODE's options; defaults are Webots' own (WorldInfo, ContactProperties, Motor, R2023b).

    Attributes:
        timestep: [s]; Webots' default of 32 ms is longer than tasks allow, this is half of it.
        solver: `step` (all rows at once, Dantzig), which Webots takes, or `quickstep` (iterative).
        iterations: of `quickstep`; 20 is ODE's default.
        erp, cfm: of all joints: share of their error that is corrected in a step, and softness.
        contact_erp, contact_cfm: the same of contacts.
        contacts: the most of a pair of shapes that count, the deepest.
        friction: in two directions that ODE chooses (`pyramid`), or along the slip alone where a
            contact slips (`slip`).
        drive: `velocity` motors with Webots' P controller, or `spring`: the scene's drive law.
        position_gain: P of `velocity` [1/s].
        sleeping: whether boxes at rest for 1 s (0.01 m/s, 0.01 rad/s) are left out.
    """

    timestep: Annotated[float, Log(5e-4, 0.016)] = 0.016
    solver: Annotated[Literal["step", "quickstep"], EACH] = "step"
    iterations: Annotated[int, Log(5, 200, when=("solver", "quickstep"))] = 20
    erp: float = 0.2
    cfm: float = 1e-5
    contact_erp: Annotated[float, Share(0.05, 0.9)] = 0.2
    contact_cfm: Annotated[float, Log(1e-8, 0.01, zero=True)] = 1e-3
    contacts: Annotated[int, Linear(3, 10)] = 10
    friction: Annotated[Literal["pyramid", "slip"], EACH] = "pyramid"
    drive: Drive = "velocity"
    position_gain: float = 10.0
    sleeping: bool = True

    def quantities(self) -> Mapping[str, Any]:
        if self.drive == "spring":
            return {}
        # v + CFM effort = P (q* - q), read as the law of a drive whose d acts on v alone
        stiffness = self.position_gain / self.cfm
        damping = 1 / self.cfm - self.timestep * stiffness
        return {"joint/*/stiffness": stiffness, "joint/*/damping": damping}


TUNED = ODESettings(
    timestep=0.002,
    contact_cfm=1e-5,
    drive="spring",
)

PROFILES: Mapping[str, Settings] = {
    "default": ODESettings(),
    "tuned": TUNED,
    "real": replace(TUNED, timestep=0.001, contact_cfm=1e-3, friction="slip"),
}

CHOSEN_ON = chosen_on(Seen.seeds("throwing", 100, 101), Seen.seeds("stacking", 100, 100))
