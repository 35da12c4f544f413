"""Gazebo's settings, its profiles, and on what they were chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from pytest_simbench.simulator import Seen, Settings, chosen_on
from pytest_simbench.simulator.settings import EACH, Each, Linear, Log

DARTSIM = Each(("engine", "dartsim"))


@dataclass(frozen=True)
class GazeboSettings(Settings):
    """Gazebo's options; defaults are its own.

    Attributes:
        timestep: [s]; SDF's default.
        engine: physics engine, a plugin of Gazebo's.
        detector: collision detector of dartsim; Gazebo's default is `ode`.
        solver: of dartsim: `dantzig` (pivoting) or `pgs` (projected Gauss-Seidel, 30 passes).
        position_gain: share of the position error that the drives correct in a step; the default
            is that of gz_ros2_control, Gazebo has none. None: what the scene's drive law corrects.
        torsional_friction: what bullet-featherstone holds against a spin about a contact's normal,
            as a share of the normal force; a pair has about twice as much [m]. SDF's default is 1,
            so nothing can be turned on the ground. dartsim has none.
    """

    timestep: Annotated[float, Log(5e-4, 0.005)] = 0.001
    engine: Annotated[Literal["dartsim", "bullet-featherstone"], EACH] = "dartsim"
    detector: Annotated[Literal["ode", "fcl", "bullet", "dart"], DARTSIM] = "ode"
    solver: Annotated[Literal["dantzig", "pgs"], DARTSIM] = "dantzig"
    position_gain: Annotated[float | None, Linear(0.05, 1)] = 0.1
    torsional_friction: float = 1.0


TUNED = GazeboSettings(engine="bullet-featherstone", position_gain=None, torsional_friction=0.0)

PROFILES: Mapping[str, Settings] = {
    "default": GazeboSettings(),
    "tuned": TUNED,
    "real": TUNED,  # half the step is no nearer to real tosses
}

CHOSEN_ON = chosen_on(
    Seen.seeds("throwing", 2022, 2023),
    Seen.seeds("stacking", 2022, 2022),
    Seen.seeds("pushing", 920001, 920002),
    Seen.seeds("pushing_curve", 920001, 920002),
)
