"""Nesting: the height of the stack is geometry's, and an engine's errors are seen."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_simbench.experiment.case import Case
from pytest_simbench.scene import Pose
from pytest_simbench.scene.penetration import penetration
from pytest_simbench.tasks import Nesting
from pytest_simbench.tasks.nesting import FLOOR, FRICTION, HEIGHT, LEAN, STEP, THICK, a_bowl
from tests.conftest import performed
from tests.tasks.scripted import Mishap, move, perform


def depth(step: float) -> float:
    """How deep two bowls are in each other that stand so far above each other [m]."""
    bowl, bottom = a_bowl()
    poses = {name: Pose.at(0.0, 0.0, bottom + k * step) for k, name in enumerate(("low", "high"))}
    low, high = (bowl.changed(name=name, pose=pose) for name, pose in poses.items())
    return penetration(low, high)


@pytest.mark.parametrize("apart", [1e-4, 1e-3])
def test_the_walls_meet_where_geometry_says(apart: float) -> None:
    assert depth(STEP + apart) <= 0.0
    assert depth(STEP - apart) == pytest.approx(apart * np.sin(LEAN), rel=1e-3)
    assert np.tan(LEAN) > 2 * FRICTION
    assert STEP > THICK  # the floors do not touch


def test_a_bowl_turns_as_its_parts() -> None:
    """Against the moments of points spread evenly in it."""
    bowl, bottom = a_bowl()
    rng = np.random.default_rng(1)
    high = np.array(bowl.extents) / 2
    points = rng.uniform(-high, high, (200_000, 3))
    inside = np.zeros(len(points), dtype=bool)
    for part in bowl.shapes:
        local = (points - part.pose.position) @ part.pose.rotation()
        normals = part.hull.normals
        reach = (np.array(part.vertices) @ normals.T).max(axis=0)
        inside |= (local @ normals.T <= reach).all(axis=1)
    kept = points[inside]
    assert kept.mean(axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=1.5e-3)  # 3 standard errors
    squares = np.mean(kept**2, axis=0)
    assert bowl.moments == pytest.approx(bowl.mass * (squares.sum() - squares), rel=0.05)
    assert bottom == pytest.approx(high[2], abs=HEIGHT / 10)
    assert high[0] > FLOOR


def test_the_whole_score() -> None:
    """The second bowl ends 0.3 mm too high, nested, and leans; the third 0.7 mm too low, and sinks
    by 1 mm from one of 50 samples to the next."""
    outcome, process = perform(
        Nesting(3, settle=1.0),
        Mishap("fall", 0.1, move("bowl_2", z=3e-4 - 0.005, tilt=0.2)),
        Mishap("fall", 0.2, move("bowl_3", z=6e-4 - 0.01)),
        Mishap("rest", 0.3, move("bowl_3", z=-1e-3)),
    )
    assert outcome.metrics == pytest.approx(
        {"height_error": 0.7, "tilt": np.degrees(0.2), "restless": 100 / np.sqrt(49)}, rel=0.01
    )
    assert outcome.details == {"steps": pytest.approx([STEP + 3e-4, STEP - 7e-4])}
    assert (process.counts, [*process.marks]) == ([(2, 3)], ["start", "end"])


def test_on_an_engine(case: Case) -> None:
    record = performed(case, Nesting().smoke())
    assert record.metrics["height_error"] < 0.1
    assert record.metrics["tilt"] < 0.1
