"""What wedges and what jams, asked of forces within friction cones (a linear programme), which
knows no formula of Whitney's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from pytest_simbench.laws.insertion import Jamming, Leaning, Wedging
from pytest_simbench.scene import Body, Box, FloatArray
from pytest_simbench.scene.penetration import penetration


def cones(leaning: Leaning, friction: float) -> FloatArray:
    """Wrenches (x, z, about the centre) of the edges of both friction cones, (3, 4): the normal at
    the mouth is that of the peg's face, at the right wall that of the wall."""
    columns = []
    across, along = leaning.axes.T
    wall = np.array([-1.0, 0.0]), np.array([0.0, 1.0])
    for point, normal, tangent in ((np.zeros(2), across, along), (leaning.corner, *wall)):
        (x, z) = point - leaning.centre
        for side in (1.0, -1.0):
            force = normal + side * friction * tangent
            columns.append([*force, x * force[1] - z * force[0]])
    return np.array(columns).T


def strongest(leaning: Leaning, friction: float, moment: float) -> float | None:
    """The largest push that contacts can balance together with a moment [N]; None: no bound."""
    load = np.hstack([cones(leaning, friction), [[0.0], [-1.0], [0.0]]])
    found = linprog([0.0] * 4 + [-1.0], A_eq=load, b_eq=[0.0, 0.0, -moment])
    return float(found.x[-1]) if found.status == 0 else None


def squeezed(leaning: Leaning, friction: float) -> bool:
    """Whether a wall that presses with 1 N can be all that acts."""
    wall = np.array([[0.0, 0.0, 1.0, 1.0]])  # the normal parts of the second cone
    load = np.vstack([cones(leaning, friction), wall])
    return bool(linprog([0.0] * 4, A_eq=load, b_eq=[0.0, 0.0, 0.0, 1.0]).status == 0)


@pytest.mark.parametrize("friction", [0.2, 0.5, 0.9])
@pytest.mark.parametrize("tilt", [0.01, 0.1])
def test_what_is_pressed_holds_itself_up_to_the_critical_depth(
    friction: float, tilt: float
) -> None:
    law = Wedging(friction=friction, tilt=tilt)
    for share in (0.5, 0.9, 0.999, 1.001, 1.1, 2.0):
        assert squeezed(law.leaning(share), friction) == (share < 1)


@pytest.mark.parametrize("law", [Jamming(), Jamming(depth=0.2, tilt=0.1), Jamming(moment=3.0)])
def test_no_larger_push_is_balanced_than_the_critical_one(law: Jamming) -> None:
    assert law.critical == pytest.approx(strongest(law.leaning, law.friction, law.moment))
    assert not squeezed(law.leaning, law.friction)  # so the forces follow from the load
    small = Jamming(tilt=1e-6)
    assert small.critical == pytest.approx(
        2 * small.friction * small.moment / small.depth, rel=1e-4
    )


def test_what_wedges_holds_any_push_so_it_is_not_judged() -> None:
    law = Jamming(depth=0.02)
    assert squeezed(law.leaning, law.friction)
    assert strongest(law.leaning, law.friction, law.moment) is None


def test_a_peg_starts_in_contact_on_both_sides() -> None:
    bodies: list[Body] = list(Jamming().build().bodies)
    for peg, *walls in zip(bodies[::3], bodies[1::3], bodies[2::3], strict=True):
        assert isinstance(peg, Box)
        for wall in walls:
            assert penetration(peg, wall) == pytest.approx(0.0, abs=1e-9)
