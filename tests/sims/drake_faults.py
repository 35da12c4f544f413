"""Changes of a loaded world in Drake itself, in the context that is simulated, its gravity field
and its collision filters."""

from __future__ import annotations

from typing import Any

from pytest_simbench.sims.drake.adapter import Drake

from .planted import Plant, Planting


def com(s: Any) -> None:
    from pydrake.multibody.tree import SpatialInertia

    off = SpatialInertia.SolidBoxWithMass(0.1, 0.05, 0.05, 0.05).Shift([-0.01, 0, 0])
    s.world.bodies["cube"].SetSpatialInertiaInBodyFrame(s.context, off)


def ghost(name: str) -> Plant:
    def plant(s: Any) -> None:
        from pydrake.geometry import CollisionFilterDeclaration, GeometrySet

        context = s.scene_graph.GetMyMutableContextFromRoot(s.root)
        every = GeometrySet([made for group in s.world.shapes.values() for made in group])
        apart = CollisionFilterDeclaration().ExcludeBetween(
            GeometrySet(s.world.shapes[name]), every
        )
        s.scene_graph.collision_filter_manager(context).Apply(apart)

    return plant


def margin(name: str) -> Plant:
    def plant(s: Any) -> None:
        from pydrake.geometry import ProximityProperties, RoleAssign

        shape = s.world.shapes[name][-1]
        inspector = s.scene_graph.model_inspector()
        surface = ProximityProperties(inspector.GetProximityProperties(shape))
        surface.UpdateProperty("hydroelastic", "margin", 0.002)
        s.scene_graph.AssignRole(
            context=s.scene_graph.GetMyMutableContextFromRoot(s.root),
            source_id=s.plant.get_source_id(),
            geometry_id=shape,
            properties=surface,
            assign=RoleAssign.kReplace,
        )

    return plant


def coupling(s: Any) -> None:
    s.plant.SetConstraintActiveStatus(s.context, s.world.couplings[0], False)


FAULTS: dict[str, Plant] = {
    "body/cube/com": com,
    "body/cube/margin": margin("cube"),
    "body/cube/touches": ghost("cube"),
    "body/cube/dynamic": lambda s: s.world.bodies["cube"].Lock(s.context),
    "link/panda_link4/margin": margin("panda_link4"),
    "link/panda_link4/touches": ghost("panda_link4"),
    "gripper/coupled": coupling,
}


class FaultyDrake(Planting, Drake):
    faults = FAULTS
