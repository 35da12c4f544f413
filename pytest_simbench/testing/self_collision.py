"""Check of a robot whose links collide with each other."""

from __future__ import annotations

import numpy as np

from pytest_simbench.laws.mechanisms import MOUNT, Part, Y, mechanism
from pytest_simbench.scene import FloatArray, Scene, Vector3
from pytest_simbench.simulator import Capability
from pytest_simbench.testing.checks import check
from pytest_simbench.testing.subject import Subject, logged, require, require_close

_LENGTH = 0.3
"""Of the pendulums [m]."""

_APART = 0.16
"""Of their hinges [m]; 0.1 m less 6 cm of thickness is between them."""

_START = 1.0
"""From where the first one falls [rad]. It strikes at -0.34."""


@check(Capability.SELF_COLLIDE)
def links_collide_when_asked(subject: Subject) -> None:
    """A pendulum, with a weight hinged within it, falls beside one that hangs, both from a beam
    that they reach into. Where links collide, it takes the other one along (0.2 rad in 0.8 s) and
    turns back before 0.8 rad; where not, it swings on beyond that and the other one hangs still
    (1 mrad). Up to the strike both move alike (2 mrad): links that one joint joins never touch."""
    apart, together = (_swings(subject, collide) for collide in (False, True))
    before = np.minimum.accumulate(apart[:, 0]) > -0.2
    off = float(np.abs(apart - together)[before].max())
    require_close("what collisions change before the strike", off, 0.0, 2e-3, "rad")
    away = float(np.abs(apart[:, -1]).max())
    require_close("how far the hanging link moves untouched", away, 0.0, 1e-3, "rad")
    reach = -float(apart[:, 0].min())
    require(reach > 0.8, f"a link that touches none swings up to {reach:.3g} rad only")
    struck, reach = -float(together[:, -1].min()), -float(together[:, 0].min())
    require(struck > 0.2, f"a link that another one strikes moves by {struck:.3g} rad only")
    require(reach < 0.8, f"a link that strikes another one swings on up to {reach:.3g} rad")


def _swings(subject: Subject, collide: bool) -> FloatArray:
    """Positions of the three joints over 0.8 s, (n, 3) [rad]."""
    name = "colliding links" if collide else "passing links"
    inertia: Vector3 = (8e-3, 8e-3, 1e-3)
    bob, small = (0.06, 0.1, _LENGTH), (0.03, 0.1, 0.03)
    centre, at = (0.0, 0.0, -_LENGTH / 2), (_APART, 0.0, 0.0)
    robot = mechanism(
        name,
        Part("falling", Y, centre=centre, inertia=inertia, start=_START, shape=bob),
        Part("weight", Y, centre, (0.0, 0.0, -0.01), 0.2, shape=small),
        Part("hanging", Y, at, centre, inertia=inertia, shape=bob, on=MOUNT),
        friction=0.0,
        self_collide=collide,
        shape=(0.6, 0.04, 0.04),
    )
    with subject.world(Scene(name, robot=robot)) as world:
        return np.asarray(logged(world.wait(0.8, log_period=0.01)).joints[:, 0])
