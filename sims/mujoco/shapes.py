"""Shapes of a file as shapes of a scene: each geom, and the convex hull of a mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pytest_simbench.description.carried import APPROXIMATED
from pytest_simbench.description.shapes import directions
from pytest_simbench.scene import Body, Box, Capsule, ConvexMesh, Cylinder, Pose, Sphere, principal
from pytest_simbench.scene.polytope import MOST
from pytest_simbench.simulator import DescriptionError, lazy_import

if TYPE_CHECKING:
    from .reading import Reading

mujoco = lazy_import("mujoco")

CONCAVE = 1.02
"""Volume of a hull over that of its mesh from which the mesh is told to be concave."""


def shape_of(reading: Reading, geom: int, name: str, friction: float) -> tuple[Body, Pose]:
    """A shape, and its frame in that of its geom."""
    model, kinds = reading.model, mujoco.mjtGeom
    a, b, c = (float(value) for value in model.geom_size[geom])
    look: dict[str, Any] = {
        "friction": friction,
        "colour": tuple(map(float, model.geom_rgba[geom])),
    }
    match model.geom_type[geom]:
        case kinds.mjGEOM_BOX:
            return Box(name, (2 * a, 2 * b, 2 * c), Pose(), **look), Pose()
        case kinds.mjGEOM_SPHERE:
            return Sphere(name, a, Pose(), **look), Pose()
        case kinds.mjGEOM_CYLINDER:
            return Cylinder(name, a, 2 * b, Pose(), **look), Pose()
        case kinds.mjGEOM_CAPSULE:
            return Capsule(name, a, 2 * b, Pose(), **look), Pose()
        case kinds.mjGEOM_MESH:
            vertices, frame = hull_of(reading, geom)
            return ConvexMesh(name, vertices, Pose(), **look), frame
    raise refused(reading, geom)


def refused(reading: Reading, geom: int) -> DescriptionError:
    kind = mujoco.mjtGeom(reading.model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
    return reading.refuse(
        f"{reading.name('geom', geom)} is of type {kind}, which no scene holds; make it a box, "
        "sphere, cylinder, capsule or mesh"
    )


def hull_of(reading: Reading, geom: int) -> tuple[Any, Pose]:
    """The corners of a mesh's convex hull in their frame, and that in the geom's."""
    model, mesh, where = (
        reading.model,
        int(reading.model.geom_dataid[geom]),
        reading.name("geom", geom),
    )
    first = model.mesh_vertadr[mesh]
    vertices = model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(float)
    points, graph = vertices, int(model.mesh_graphadr[mesh])
    if graph >= 0:
        count = int(model.mesh_graph[graph])
        points = vertices[model.mesh_graph[graph + 2 + count : graph + 2 + 2 * count]]
    if len(points) > MOST:
        ways = directions(400)
        corners = {int(k) for k in np.argmax(directions(MOST - 6) @ points.T, axis=1)}
        corners |= {int(k) for sign in (1, -1) for k in np.argmax(sign * points, axis=0)}
        kept = points[sorted(corners)[:MOST]]
        gap = float(((ways @ points.T).max(axis=1) - (ways @ kept.T).max(axis=1)).max())
        reason = f"{len(kept)} of {len(points)} corners; up to {1000 * gap:.2g} mm smaller"
        reading.tell("geom mesh (hull)", APPROXIMATED, reason, [where])
        points = kept
    corners_, frame = principal(points)
    first = model.mesh_faceadr[mesh]
    faces = vertices[model.mesh_face[first : first + model.mesh_facenum[mesh]]]
    volume = abs(float(np.linalg.det(faces - vertices.mean(axis=0)).sum()) / 6)
    hull = ConvexMesh("hull", corners_, Pose()).volume
    if hull > CONCAVE * volume:
        reason = (
            f"it is concave: its hull has {hull / max(volume, 1e-12):.3g} times its volume; "
            "MuJoCo collides the hull, too; coacd splits a mesh into convex ones"
        )
        reading.tell("geom mesh (concave)", APPROXIMATED, reason, [where])
    return corners_, frame
