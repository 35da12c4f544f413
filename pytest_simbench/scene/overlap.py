"""How deep boxes overlap, many pairs at once: the separating-axis test. How far hulls are apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from pytest_simbench.scene.pose import FloatArray, unit_rotation

PARALLEL = 1e-9
"""Two edges whose directions' product is shorter than this are parallel and give no axis."""


def box_corners(size: Sequence[float] | FloatArray) -> FloatArray:
    """Corners (8, 3) of a box of edge lengths `size` about its centre [m]."""
    return np.asarray(np.array(list(product((-0.5, 0.5), repeat=3))) * np.asarray(size))


def rotations(quaternions: FloatArray) -> FloatArray:
    """Rotation matrices (n, 3, 3) of quaternions w, x, y, z, (n, 4), normalised first."""
    unit = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    return np.moveaxis(unit_rotation(unit.T), 2, 0)


def rotated(unit: FloatArray, vectors: FloatArray) -> FloatArray:
    """Vectors (n, 3) turned by unit quaternions (n, 4); at each look, so in few calls of numpy."""
    products = (unit[:, :, None] * unit[:, None]).reshape(-1, 16)
    turned = (products @ _FROM_PRODUCTS).reshape(-1, 3, 3) @ vectors[:, :, None]
    return np.asarray(turned[:, :, 0])


def _from_products() -> FloatArray:
    """What makes rotation matrices, (9,), of the products of two numbers of a quaternion, (16,)."""

    def turn(numbers: FloatArray) -> FloatArray:  # quadratic in them; of unit ones a rotation
        return unit_rotation(numbers) + (numbers @ numbers - 1) * np.eye(3)

    pairs = [[(turn(a + b) - turn(a) - turn(b)) / 2 for b in np.eye(4)] for a in np.eye(4)]
    return np.array(pairs).reshape(16, 9)


_FROM_PRODUCTS = _from_products()


def overlaps(
    offset: FloatArray,
    turn_a: FloatArray,
    half_a: FloatArray,
    turn_b: FloatArray,
    half_b: FloatArray,
) -> FloatArray:
    """How far each pair of boxes would have to be moved apart [m], (n,); below 0: they are apart.

    Two convex boxes are apart when one of 15 axes (3 face normals each and the 9 products of their
    edges) separates their projections.

    Args:
        offset: from the centre of a to that of b [m], (n, 3).
        turn_a, turn_b: their rotation matrices, (n, 3, 3).
        half_a, half_b: half of their edges [m], (n, 3).
    """
    edges_a, edges_b = turn_a.transpose(0, 2, 1), turn_b.transpose(0, 2, 1)  # rows are edges
    crosses = np.cross(edges_a[:, :, None], edges_b[:, None]).reshape(-1, 9, 3)
    axes = np.concatenate([edges_a, edges_b, crosses], axis=1)
    lengths = np.linalg.norm(axes, axis=2)
    real = lengths > PARALLEL
    axes = axes / np.where(real, lengths, 1.0)[:, :, None]
    reach = np.einsum("nki,ni->nk", np.abs(axes @ turn_a), half_a)
    reach += np.einsum("nki,ni->nk", np.abs(axes @ turn_b), half_b)
    away = np.abs(np.einsum("nki,ni->nk", axes, offset))
    depth: FloatArray = np.where(real, reach - away, np.inf).min(axis=1)
    return depth


Flat = tuple[FloatArray, FloatArray, FloatArray]
"""Of a body with flat faces alone: corners [m], normals of faces and directions of edges."""


def parted(offset: FloatArray, turn_a: FloatArray, a: Flat, turn_b: FloatArray, b: Flat) -> float:
    """The same as `overlaps` of one pair of bodies with flat faces: their axes are the normals of
    both and the products of their edges."""
    points_a, normals_a, edges_a = (rows @ turn_a.T for rows in a)
    points_b, normals_b, edges_b = (rows @ turn_b.T for rows in b)
    crosses = np.cross(edges_a[:, None], edges_b[None]).reshape(-1, 3)
    lengths = np.linalg.norm(crosses, axis=1)
    crosses = crosses[lengths > PARALLEL] / lengths[lengths > PARALLEL, None]
    axes = np.concatenate([normals_a, normals_b, crosses])
    on_a, on_b = points_a @ axes.T, (points_b + offset) @ axes.T
    depths = np.minimum(on_a.max(axis=0) - on_b.min(axis=0), on_b.max(axis=0) - on_a.min(axis=0))
    return float(depths.min())


@dataclass(frozen=True)
class Hull:
    """A box of half edges `half` [m], (3,), widened by a disc of radius `disc` [m] about z."""

    half: FloatArray
    disc: float = 0.0

    def reach(self, directions: FloatArray) -> FloatArray:
        """How far it reaches from its centre in directions (n, 3) [m], (n,)."""
        flat = np.hypot(directions[:, 0], directions[:, 1])
        return np.asarray(np.abs(directions) @ self.half + self.disc * flat)

    def farthest(self, direction: FloatArray) -> FloatArray:
        """Its point that lies farthest in a direction (3,)."""
        point = np.where(direction < 0, -self.half, self.half)
        flat = float(np.hypot(direction[0], direction[1]))
        if flat > 0:
            point[:2] += self.disc / flat * direction[:2]
        return point


@dataclass(frozen=True)
class Corners:
    """The convex hull of points (n, 3) [m]."""

    points: FloatArray

    def reach(self, directions: FloatArray) -> FloatArray:
        """How far it reaches from the origin in directions (n, 3) [m], (n,)."""
        return np.asarray((directions @ self.points.T).max(axis=1))

    def farthest(self, direction: FloatArray) -> FloatArray:
        """Its point that lies farthest in a direction (3,)."""
        return np.asarray(self.points[int(np.argmax(self.points @ direction))])


Core = Hull | Corners
"""What `distance` knows: it tells how far it reaches."""

STEPS, CLOSE = 64, 1e-9
"""The most of a search for a distance, and where it ends [m]."""


def distance(offset: FloatArray, a: Core, turn_a: FloatArray, b: Core, turn_b: FloatArray) -> float:
    """How far two hulls are apart [m], 0 where they overlap: the algorithm of Gilbert, Johnson and
    Keerthi (1988), which finds the point of their Minkowski difference nearest to the origin.

    Args:
        offset: from the centre of a to that of b [m].
        turn_a, turn_b: their rotation matrices.
    """

    def farthest(direction: FloatArray) -> FloatArray:
        of_a = turn_a @ a.farthest(direction @ turn_a)
        return np.asarray(of_a - offset - turn_b @ b.farthest(-direction @ turn_b))

    return _nearest_to_origin(farthest, -offset)


def _nearest_to_origin(farthest: Callable[[FloatArray], FloatArray], start: FloatArray) -> float:
    """Distance from the origin of a convex body that tells its farthest point in a direction."""
    nearest = farthest(-start)
    corners = [nearest]
    for _ in range(STEPS):
        length = float(np.linalg.norm(nearest))
        if length < CLOSE:
            return 0.0
        found = farthest(-nearest)
        if nearest @ (nearest - found) <= CLOSE * length:
            return length
        nearest, corners = _of_simplex([*corners, found])
    return float(np.linalg.norm(nearest))


def _of_simplex(corners: list[FloatArray]) -> tuple[FloatArray, list[FloatArray]]:
    """The point of a simplex of up to 4 corners nearest to the origin, and the face it lies in."""
    best, face = min(((c, [c]) for c in corners), key=lambda pair: float(pair[0] @ pair[0]))
    for count in range(2, len(corners) + 1):
        for some in combinations(corners, count):
            edges = np.array(some[1:]) - some[0]
            weights = np.linalg.lstsq(edges.T, -some[0], rcond=None)[0]
            point = some[0] + weights @ edges
            inside = (weights >= 0).all() and weights.sum() <= 1
            if inside and point @ point < best @ best - 1e-18:
                best, face = point, list(some)
    return best, face[:4]
