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


def surface(name: str, change: Plant) -> Plant:
    """The properties of the last shape of a body or link changed."""

    def plant(s: Any) -> None:
        from pydrake.geometry import ProximityProperties, RoleAssign

        shape = s.world.shapes[name][-1]
        inspector = s.scene_graph.model_inspector()
        properties = ProximityProperties(inspector.GetProximityProperties(shape))
        change(properties)
        s.scene_graph.AssignRole(
            context=s.scene_graph.GetMyMutableContextFromRoot(s.root),
            source_id=s.plant.get_source_id(),
            geometry_id=shape,
            properties=properties,
            assign=RoleAssign.kReplace,
        )

    return plant


def margin(properties: Any) -> None:
    properties.UpdateProperty("hydroelastic", "margin", 0.002)


def slippery(properties: Any) -> None:
    from pydrake.multibody.plant import CoulombFriction

    properties.UpdateProperty("material", "coulomb_friction", CoulombFriction(0.5, 0.5))


def reshaped(name: str, kind: str, *size: float) -> Plant:
    """Another first shape of a body."""

    def plant(s: Any) -> None:
        from pydrake import geometry

        s.scene_graph.ChangeShape(
            context=s.scene_graph.GetMyMutableContextFromRoot(s.root),
            source_id=s.plant.get_source_id(),
            geometry_id=s.world.shapes[name][0],
            shape=getattr(geometry, kind)(*size),
        )

    return plant


def coupling(s: Any) -> None:
    s.plant.SetConstraintActiveStatus(s.context, s.world.couplings[0], False)


FAULTS: dict[str, Plant] = {
    "body/cube/com": com,
    "body/cube/margin": surface("cube", margin),
    "body/cube/boxes, one corner": reshaped("cube", "Sphere", 0.0045),
    "body/cube/friction, one shape": surface("cube", slippery),
    "body/table/boxes": reshaped("table", "Box", 0.914, 0.914, 0.3),
    "link/panda_leftfinger/friction, one shape": surface("panda_leftfinger", slippery),
    "body/cube/touches": ghost("cube"),
    "body/cube/dynamic": lambda s: s.world.bodies["cube"].Lock(s.context),
    "link/panda_link4/margin": surface("panda_link4", margin),
    "link/panda_link4/touches": ghost("panda_link4"),
    "gripper/coupled": coupling,
}


class FaultyDrake(Planting, Drake):
    faults = FAULTS
