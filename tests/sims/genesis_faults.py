"""Genesis with a fault planted in the engine's own data after loading, one for each quantity.

Runs in Genesis' own interpreter, so it imports nothing but the adapter.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pytest_simbench.sims.genesis.adapter import Genesis
from pytest_simbench.sims.genesis.engine import array_of

from pytest_simbench.scene import Scene

from .planted import Plant, Planting


def rubbing(s: Any) -> None:
    array_of(s.solver.dyn_info.dofs.frictionloss, copy=False)[s._dofs[3]] = 0.5


def effort_limit(s: Any) -> None:
    """One end only."""
    array_of(s.solver.dyn_info.dofs.force_range, copy=False)[s._dofs[3], 1] = 174.0


def one_finger_shape(s: Any) -> None:
    shape = s._robot.get_link("panda_leftfinger").geoms[-1].idx
    array_of(s.solver.dyn_info.geoms.friction, copy=False)[shape] = 0.3


def other_timestep(s: Any) -> None:
    array_of(s.solver.rigid_info.substep_dt, copy=False)[...] = 0.005


def uncoupled(s: Any) -> None:
    array_of(s.solver.dyn_info.equalities.eq_obj1id, copy=False)[...] = 0


def in_geoms(name: str, array: str, value: Any) -> Plant:
    """Sets rows of all shapes of a link or a body."""

    def plant(s: Any) -> None:
        owner = s._boxes[name] if name in s._boxes else s._robot.get_link(name)
        tensor = array_of(getattr(s.solver.dyn_info.geoms, array), copy=False)
        for shape in owner.geoms:
            tensor[shape.idx, : len(value)] = value

    return plant


def lifted_ground(s: Any) -> None:
    array_of(s.solver.dyn_state.geoms.pos, copy=False)[s._ground.geoms[0].idx, 0, 2] = 0.01


def no_pairs(name: str) -> Plant:
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


def weightless(robot: bool) -> Plant:
    def plant(s: Any) -> None:
        link = s._robot.links[0] if robot else s._boxes["cube_05"].links[0]
        entity = array_of(s.solver.dyn_info.links.entity_idx)[link.idx]
        array_of(s.solver.dyn_info.entities.gravity_compensation, copy=False)[entity] = 1.0

    return plant


BOUNCY = (0.02, 0.1)
"""Time constant and damping ratio of a contact that gives back most of the speed."""

FAULTS: dict[str, Plant] = {
    "ground/height": lifted_ground,
    "body/cube_05/touches": no_pairs("cube_05"),
    "body/cube_05/com": centre,
    "body/cube_05/gravity": weightless(robot=False),
    "link/panda_link4/restitution": in_geoms("panda_link4", "sol_params", BOUNCY),
    "link/panda_link4/touches": no_pairs("panda_link4"),
    "link/panda_link4/gravity": weightless(robot=True),
    "joint/panda_joint4/friction": rubbing,
    "timestep": other_timestep,
    "joint/panda_joint4/effort_limit": effort_limit,
    "link/panda_leftfinger/friction": one_finger_shape,
    "gripper/coupled": uncoupled,
}


class FaultyGenesis(Planting, Genesis):
    faults = FAULTS

    def compile(self, scene: Scene) -> None:
        """Once for all faults."""
        wanted, self.settings = self.settings, replace(self.settings, fault="")
        super().compile(scene)
        self.settings = wanted
