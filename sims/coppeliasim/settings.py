"""CoppeliaSim's settings, its profiles, and on what they were chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

from pytest_simbench.simulator import Seen, Settings, chosen_on
from pytest_simbench.simulator.settings import EACH, Each, Linear, Log

from ..mujoco.settings import Solimp, Solref

Engine = Literal["bullet", "bullet283", "ode", "newton", "mujoco"]
Drive = Literal["position", "velocity", "force"]

MUJOCO = Each(("engine", "mujoco"))


@dataclass(frozen=True)
class CoppeliaSimSettings(Settings):
    """CoppeliaSim's options; defaults are its own.

    Attributes:
        timestep: of the physics engine [s]. The program makes ten of its 5 ms in a step of 50 ms of
            its own, at whose ends it may be told something; here it may be after each.
        engine: Bullet 2.78, Bullet 2.83, ODE, Newton Dynamics or MuJoCo.
        drive: the program's position control (`position`), its velocity control told in each step
            how to follow (`velocity`), or the scene's drive law as a force (`force`).
        position_gain: of `velocity`: share of the position error that is corrected in a step.
        iterations: of Bullet's solver.
        sticky: with Bullet 2.78 contacts resist sliding in two directions; else in one alone, that
            in which they slide.
        cone: of MuJoCo's friction; as in its own options.
        solref: time constant [s] and damping ratio of MuJoCo's contacts.
        solimp: their impedance: minimum, maximum, width [m].
    """

    timestep: Annotated[float, Log(5e-4, 0.01)] = 0.005
    engine: Annotated[Engine, EACH] = "bullet"
    drive: Annotated[Drive, EACH] = "position"
    position_gain: Annotated[float, Linear(0.05, 1, when=("drive", "velocity"))] = 0.1

    iterations: Annotated[int, Log(10, 1000, when=("engine", "bullet"))] = 100
    sticky: Annotated[bool, Each(("engine", "bullet"))] = False

    cone: Annotated[Literal["pyramidal", "elliptic"], MUJOCO] = "pyramidal"
    solref: Solref = (0.02, 1.0)
    solimp: Solimp = (0.9, 0.95, 0.001)

    def quantities(self) -> Mapping[str, Any]:
        found = {} if self.engine == "mujoco" else {"joint/*/armature": 0.0}
        if self.drive == "force":
            return found
        return found | {"joint/*/stiffness": 0.0, "joint/*/damping": 0.0}  # motors, no springs


TUNED = CoppeliaSimSettings(
    timestep=0.001,
    engine="mujoco",
    drive="force",
    cone="elliptic",
    solref=(0.002, 1.0),
    solimp=(0.99, 0.9999, 0.001),
)

PROFILES: Mapping[str, Settings] = {
    "default": CoppeliaSimSettings(),
    "tuned": TUNED,
    "real": replace(TUNED, solref=(0.004, 1.0)),
}

CHOSEN_ON = chosen_on(
    Seen.seeds("throwing", 300001, 300001), Seen.seeds("stacking", 300001, 300001)
)
"""Settings are chosen on some seeds and published on others; where not, the report says so."""
