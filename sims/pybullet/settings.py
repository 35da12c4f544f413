"""PyBullet's settings, its profiles, and on what they were chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any

from pytest_simbench.simulator import Seen, Settings, chosen_on
from pytest_simbench.simulator.settings import EACH, Linear, Log, Share


@dataclass(frozen=True)
class PyBulletSettings(Settings):
    """PyBullet's options; defaults are the engine's own, found by comparing tumbling boxes bit for
    bit with an engine whose parameters were never set (contact ERP 0.08, friction cone on).

    Attributes:
        timestep: [s]; 1/240 is what PyBullet's guide recommends to keep.
        solver_iterations: of the constraint solver.
        solver_residual: residual below which it stops earlier.
        position_gain, velocity_gain: of the joint motors (drives.py); None: as the drive law says.
        finger_gain: position gain of the motors of two fingers.
        linear_damping, angular_damping: of free bodies [1/s].
        contact_erp: share of a penetration that is corrected in a step.
        friction_erp: the same for friction anchors.
        cone_friction: implicit friction cone instead of the pyramid.
        spinning_friction: torsional friction coefficient of the cubes [m].
        friction_anchor: tie contacts of the robot to where they first touched, by friction_erp.
        sleeping: whether bodies at rest are frozen.
        ordered_pairs: sort the overlapping pairs before each step.
    """

    timestep: Annotated[float, Log(5e-4, 0.01)] = 1.0 / 240.0
    solver_iterations: Annotated[int, Log(10, 300)] = 50
    solver_residual: float = 1e-7
    position_gain: float | None = 0.1
    finger_gain: Annotated[float, Linear(0.05, 1)] = 0.1
    velocity_gain: float = 1.0
    linear_damping: float = 0.04
    angular_damping: float = 0.04
    contact_erp: Annotated[float, Share(0.02, 0.9)] = 0.08
    friction_erp: Annotated[float, Share(0.02, 0.9, when=("friction_anchor", True))] = 0.2
    cone_friction: Annotated[bool, EACH] = True
    spinning_friction: float = 0.0
    friction_anchor: Annotated[bool, EACH] = False
    sleeping: bool = False
    ordered_pairs: bool = False

    def quantities(self) -> Mapping[str, Any]:
        return {"body/*/damping": (self.linear_damping, self.angular_damping)}


TUNED = PyBulletSettings(
    ordered_pairs=True,
    position_gain=None,
    finger_gain=0.2,
    linear_damping=0.0,
    angular_damping=0.0,
    solver_residual=0.0,
    friction_anchor=True,
    contact_erp=0.2,
)

PROFILES: Mapping[str, Settings] = {
    "default": PyBulletSettings(),
    "tuned": TUNED,
    "real": replace(TUNED, timestep=0.001, contact_erp=0.08),
}

CHOSEN_ON = chosen_on(
    Seen.seeds("throwing", 2022, 2041),
    Seen.seeds("stacking", 2024, 2024),
    Seen.seeds("stacking", 480001, 480004),
)
