"""How deep two bodies overlap."""

from __future__ import annotations

import numpy as np

from pytest_simbench.scene.bodies import Box, Compound, ConvexMesh
from pytest_simbench.scene.body import Body
from pytest_simbench.scene.overlap import box_corners, distance, overlaps, parted
from pytest_simbench.scene.pose import FloatArray


def penetration(a: Body, b: Body, share: float = 0.1) -> float:
    """How deep two bodies overlap [m]; 0 or less when they are apart or touch.

    Exact among boxes and meshes, and among spheres and capsules. A box or cylinder beside one of
    these, and two cylinders, count as if their edges were rounded by `share` of their shortest half
    edge: two bodies that do not overlap are never said to. The depth is then at most those radii.
    """
    offset = np.subtract(b.pose.position, a.pose.position)
    half_a, half_b = np.asarray(a.extents) / 2, np.asarray(b.extents) / 2
    if np.linalg.norm(offset) > np.linalg.norm(half_a) + np.linalg.norm(half_b):
        return 0.0
    if isinstance(a, Compound) or isinstance(b, Compound):
        return _deepest(a, b, share)
    turn_a, turn_b = a.pose.rotation(), b.pose.rotation()
    flat_a, flat_b = _flat(a), _flat(b)
    if (isinstance(a, ConvexMesh) or isinstance(b, ConvexMesh)) and flat_a and flat_b:
        return parted(offset, turn_a, flat_a, turn_b, flat_b)
    if not (isinstance(a, Box) and isinstance(b, Box)):
        (core_a, depth_a), (core_b, depth_b) = a.core(share), b.core(share)
        return depth_a + depth_b - distance(offset, core_a, turn_a, core_b, turn_b)
    return float(overlaps(offset[None], turn_a[None], half_a[None], turn_b[None], half_b[None])[0])


def _deepest(a: Body, b: Body, share: float) -> float:
    """How deep any shape of one body is in one of the other [m]; 0 or less as `penetration`. Bowls
    of many boxes are asked about often, so all pairs of boxes are looked at together."""
    poses = [[body.pose * part.pose for part in body.parts] for body in (a, b)]
    at, to = (np.array([pose.position for pose in side]) for side in poses)
    halves = [np.array([part.extents for part in body.parts]) / 2 for body in (a, b)]
    own, other = (np.linalg.norm(half, axis=1) for half in halves)
    near = np.linalg.norm(at[:, None] - to, axis=2) <= own[:, None] + other
    boxes = [np.array([isinstance(part, Box) for part in body.parts]) for body in (a, b)]
    flat = near & boxes[0][:, None] & boxes[1]
    found = [0.0] * (not near.all())
    if flat.any():
        turns = [np.array([pose.rotation() for pose in side]) for side in poses]
        i, j = np.nonzero(flat)
        depths = overlaps(to[j] - at[i], turns[0][i], halves[0][i], turns[1][j], halves[1][j])
        found += depths.tolist()
    found += [
        penetration(a.parts[i].moved_to(poses[0][i]), b.parts[j].moved_to(poses[1][j]), share)
        for i, j in np.argwhere(near & ~flat)
    ]
    return max(found)


def _flat(body: Body) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Corners, normals of faces and directions of edges of a body that has only flat faces."""
    if isinstance(body, ConvexMesh):
        return body.hull.points, body.hull.normals, body.hull.edges
    if isinstance(body, Box):
        return box_corners(body.size), np.eye(3), np.eye(3)
    return None
