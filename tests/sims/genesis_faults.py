"""Genesis with a fault planted in the engine's own data after loading, one for each quantity.

Runs in Genesis' own interpreter, so it imports nothing but the adapter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

from pytest_simbench.sims.genesis.adapter import Genesis
from pytest_simbench.sims.genesis.engine import array_of
from pytest_simbench.sims.genesis.settings import GenesisSettings

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


def in_geoms(name: str, array: str, value: Any) -> Fault:
    """Sets rows of all shapes of a link, a body or the ground."""

    def plant(s: Any) -> None:
        if name == "ground":
            shapes = s._ground.geoms
        elif name in s._boxes:
            shapes = s._boxes[name].geoms
        else:
            shapes = s._robot.get_link(name).geoms
        tensor = array_of(getattr(s.solver.dyn_info.geoms, array), copy=False)
        for shape in shapes:
            tensor[shape.idx, : len(value)] = value

    return plant


def lifted_ground(s: Any) -> None:
    array_of(s.solver.dyn_state.geoms.pos, copy=False)[s._ground.geoms[0].idx, 0, 2] = 0.01


def no_pairs(name: str) -> Fault:
    """Takes every pair of shapes that the body or link is part of out of the collider's list."""

    def plant(s: Any) -> None:
        owner = s._boxes[name] if name in s._boxes else s._robot.get_link(name)
        pairs = array_of(s.solver.collider._collider_info.collision_pair_idx, copy=False)
        for shape in owner.geoms:
            pairs[shape.idx, :] = pairs[:, shape.idx] = -1

    return plant


def centre(s: Any) -> None:
    link = s._boxes["cube_05"].links[0].idx
    array_of(s.solver.dyn_info.links.inertial_pos, copy=False)[link, 0] = 0.01


def damped(s: Any) -> None:
    link = s._boxes["cube_05"].links[0]
    array_of(s.solver.dyn_info.dofs.damping, copy=False)[link.dof_start : link.dof_end] = 0.1


def weightless(robot: bool) -> Fault:
    def plant(s: Any) -> None:
        link = s._robot.links[0] if robot else s._boxes["cube_05"].links[0]
        entity = array_of(s.solver.dyn_info.links.entity_idx)[link.idx]
        array_of(s.solver.dyn_info.entities.gravity_compensation, copy=False)[entity] = 1.0

    return plant


BOUNCY = (0.02, 0.1)
"""Time constant and damping ratio of a contact that gives back most of the speed."""

FAULTS: dict[str, Fault] = {
    "ground/height": lifted_ground,
    "ground/restitution": in_geoms("ground", "sol_params", BOUNCY),
    "body/cube_05/restitution": in_geoms("cube_05", "sol_params", BOUNCY),
    "body/cube_05/touches": no_pairs("cube_05"),
    "body/cube_05/com": centre,
    "body/cube_05/damping": damped,
    "body/cube_05/gravity": weightless(robot=False),
    "link/panda_link4/restitution": in_geoms("panda_link4", "sol_params", BOUNCY),
    "link/panda_link4/touches": no_pairs("panda_link4"),
    "link/panda_link4/gravity": weightless(robot=True),
    "joint/panda_joint4/friction": of_drive(changed("dyn_info.dofs.frictionloss", to=0.5)),
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
