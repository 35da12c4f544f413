"""Genesis with a fault planted in the engine's own data after loading, one for each quantity.

Runs in Genesis' own interpreter, so it imports nothing but the adapter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

from pytest_simbench.sims.genesis import Genesis
from pytest_simbench.sims.genesis_engine import array_of
from pytest_simbench.sims.genesis_world import GenesisSettings

from pytest_simbench.scene import Scene
from pytest_simbench.simulator import Settings

Fault = Callable[[Any], None]


def changed(path: str, *index: int, to: float) -> Callable[[Any, int], None]:
    """Sets an element of a tensor of the solver: `path` from the solver on, the row comes first."""

    def plant(simulator: Any, row: int) -> None:
        tensor = simulator.solver
        for name in path.split("."):
            tensor = getattr(tensor, name)
        array_of(tensor, copy=False)[(row, *index)] = to

    return plant


def of_link(body: str, plant: Callable[[Any, int], None]) -> Fault:
    return lambda s: plant(s, s._boxes[body].links[0].idx)


def of_geom(body: str, plant: Callable[[Any, int], None]) -> Fault:
    return lambda s: plant(s, s._boxes[body].geoms[0].idx)


def of_part(link: str, plant: Callable[[Any, int], None]) -> Fault:
    return lambda s: plant(s, s._robot.get_link(link).idx)


def of_drive(plant: Callable[[Any, int], None]) -> Fault:
    return lambda s: plant(s, s._dofs[3])


def scaled_inertia(s: Any) -> None:
    inertias = array_of(s.solver.dyn_info.links.inertial_i, copy=False)
    inertias[s._boxes["cube_05"].links[0].idx] *= 1.2


def one_finger_shape(s: Any) -> None:
    shape = s._robot.get_link("panda_leftfinger").geoms[-1].idx
    array_of(s.solver.dyn_info.geoms.friction, copy=False)[shape] = 0.3


def lower_table(s: Any) -> None:
    table = s._boxes["table"].links[0].idx
    array_of(s.solver.dyn_state.links.pos, copy=False)[table, 0, 2] -= 0.012


def other_gravity(s: Any) -> None:
    array_of(s.solver.rigid_info.gravity, copy=False)[..., 2] = -9.7


def other_timestep(s: Any) -> None:
    array_of(s.solver.rigid_info.substep_dt, copy=False)[...] = 0.005


def uncoupled(s: Any) -> None:
    array_of(s.solver.dyn_info.equalities.eq_obj1id, copy=False)[...] = 0


FAULTS: dict[str, Fault] = {
    "body/cube_05/mass": of_link("cube_05", changed("dyn_info.links.inertial_mass", to=1.0)),
    "body/cube_05/inertia": scaled_inertia,
    "body/cube_05/friction": of_geom("cube_05", changed("dyn_info.geoms.friction", to=0.5)),
    "gravity": other_gravity,
    "timestep": other_timestep,
    "body/table/boxes": of_geom("table", changed("dyn_info.geoms.data", 2, to=0.276)),
    "body/table/pose": lower_table,
    "joint/panda_joint4/stiffness": of_drive(changed("dyn_info.dofs.act_gain", to=4950.0)),
    "joint/panda_joint4/damping": of_drive(changed("dyn_info.dofs.act_bias", 2, to=-495.0)),
    "joint/panda_joint4/effort_limit": of_drive(changed("dyn_info.dofs.force_range", 1, to=174.0)),
    "joint/panda_joint4/armature": of_drive(changed("dyn_info.dofs.armature", to=0.0)),
    "joint/panda_joint4/limits": of_drive(changed("dyn_info.dofs.limit", 0, to=-1.0)),
    "link/panda_link4/mass": of_part(
        "panda_link4", changed("dyn_info.links.inertial_mass", to=5.0)
    ),
    "link/panda_leftfinger/friction": one_finger_shape,
    "gripper/coupled": uncoupled,
}


@dataclass(frozen=True)
class FaultySettings(GenesisSettings):
    """Genesis' settings, and the quantity in which a fault is planted ("" for none)."""

    fault: str = ""


def _faulty(settings: Settings) -> FaultySettings:
    return FaultySettings(**{f.name: getattr(settings, f.name) for f in fields(settings)})


class FaultyGenesis(Genesis):
    """Genesis that plants the fault named in its settings after it has built a world."""

    profiles: ClassVar[Mapping[str, Settings]] = {
        name: _faulty(settings) for name, settings in Genesis.profiles.items()
    }
    settings: FaultySettings

    def compile(self, scene: Scene) -> None:
        """Once for all faults."""
        wanted, self.settings = self.settings, replace(self.settings, fault="")
        super().compile(scene)
        self.settings = wanted

    def load(self, scene: Scene) -> None:
        super().load(scene)
        if self.settings.fault:
            FAULTS[self.settings.fault](self)
