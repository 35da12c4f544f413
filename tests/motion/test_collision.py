"""The planning scene sees each contact, and none that is not there: checked without Coal."""

from __future__ import annotations

from itertools import product

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from pytest_simbench.motion.collision import MARGIN, PlanningScene, convex_hull
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.registry import find
from pytest_simbench.scene import FloatArray
from pytest_simbench.tasks import Stacking
from pytest_simbench.tasks.base import Jitter

CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


def distance(first: FloatArray, second: FloatArray) -> float:
    """Between the hulls of two sets of points [m], 0 where they overlap: the shortest vector of
    their difference (P. Wolfe, Finding the nearest point in a polytope, 1976)."""
    basis = [first[0] - second[0]]
    while True:
        rows = np.array(basis).T
        weights, _ = nnls(
            np.vstack([rows, np.full(len(basis), 1e3)]), np.array([0.0, 0.0, 0.0, 1e3])
        )
        nearest = rows @ (weights / weights.sum())
        further = first[np.argmin(first @ nearest)] - second[np.argmax(second @ nearest)]
        if nearest @ (nearest - further) < 1e-12:
            return float(np.linalg.norm(nearest))
        basis = [point for point, w in zip(basis, weights, strict=True) if w > 1e-12] + [further]


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_a_hull_is_as_far_away_as_its_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(300, 3)) * [0.05, 0.03, 0.1]  # most of them are within
    place = pin.SE3(pin.Quaternion(*rng.normal(size=4)).normalized().matrix(), rng.normal(size=3))
    half = rng.uniform(0.01, 0.1, 3)
    found = coal.distance(
        convex_hull(points),
        coal.Transform3s(),
        coal.Box(*(2 * half)),
        coal.Transform3s(place.rotation, place.translation),
        coal.DistanceRequest(),
        coal.DistanceResult(),
    )
    box = CORNERS * half @ place.rotation.T + place.translation
    assert max(found, 0.0) == pytest.approx(distance(points, box), abs=1e-5)


@pytest.mark.parametrize("name", ["panda", "ur5", "xarm7"])
def test_links_are_as_far_from_cubes_as_the_scene_says(name: str) -> None:
    robot = find(name)
    scene = Stacking(robot=robot).scene(2022, Jitter())
    model = RobotModel(robot)
    planning = PlanningScene(model, scene)
    rng = np.random.default_rng(1)
    home = model.home
    near = 0
    for _ in range(400):
        arm = home + rng.normal(0.0, 0.4, model.arm)
        away = closest(planning, arm)
        seen = planning.collision(arm)
        near += away < MARGIN
        if away < MARGIN - 1e-4:
            assert seen is not None
        elif away > MARGIN + 1e-4 and seen is not None:
            assert seen[1] not in {body.name for body in scene.bodies}
    assert near > 20  # else the test sees nothing


def closest(planning: PlanningScene, arm: FloatArray) -> float:
    """The least distance of a moving link from a body [m]."""
    model, geometry = planning.model, planning._geometry
    fingers = np.full(len(model.robot.joints) - model.arm, planning.opening)
    q = np.concatenate([arm, fingers])
    pin.updateGeometryPlacements(model.pin, model.data, geometry, planning._exact, q)

    def points(index: int) -> FloatArray:
        shape, at = geometry.geometryObjects[index].geometry, planning._exact.oMg[index]
        box = isinstance(shape, coal.Box)
        local = CORNERS * shape.halfSide if box else np.asarray(shape.points())
        return np.asarray(local @ at.rotation.T + at.translation)

    bodies = [points(index) for index in planning._bodies.values()]
    found = [np.inf]
    for link in planning._links:
        if geometry.geometryObjects[link].parentJoint == 0:
            continue
        part = points(link)
        low, high = part.min(axis=0), part.max(axis=0)
        for body in bodies:
            gap = np.maximum(body.min(axis=0) - high, low - body.max(axis=0)).max()
            if gap < 2 * MARGIN:
                found.append(distance(part, body))
    return min(found)
