"""Laws of a peg in a slot: when does it wedge, when does it jam? (Whitney, Quasi-static assembly of
compliantly supported rigid parts, J. Dyn. Sys. Meas. Control 104 (1982) 65.)

A peg of width d leans in a slot. Its left face lies on the edge of the mouth, at a depth l above
its end; its right corner on the right wall. No arm takes part, and there is no gravity.

Whether a peg that nothing holds stays wedged between two fixed walls is not decided for rigid
bodies: where the contacts can press against each other, both rest and motion are consistent. So
`Wedging` has one wall press with a known force, and `Jamming` lies where no such forces are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pytest_simbench.laws.base import Law, Reading, Watched
from pytest_simbench.laws.free import WEIGHTLESS
from pytest_simbench.laws.mechanisms import MOUNT, Part, mechanism
from pytest_simbench.laws.sticking import BETWEEN, SHARES, fan
from pytest_simbench.scene import Box, FloatArray, Pose, Scene, Trajectory, Wrench

LENGTH, THICK, MASS = 0.3, 0.1, 1.0
"""Of the peg: along the slot, across the plane [m], [kg]."""

WALL = (0.2, 0.2, 0.4)
"""Edges of each wall of a slot [m]."""

MOUTHS = [Pose.at(0.0, 0.3 * (k - 2.5), 1.0) for k in range(len(SHARES))]
"""The left edge of each slot's mouth."""


@dataclass(frozen=True)
class Leaning:
    """A peg in two-point contact, in the plane x (across the slot), z (out of it), from the edge of
    the mouth.

    Attributes:
        width: of the peg [m].
        depth: from its end to the edge, along its face [m].
        tilt: its top to the left [rad].
    """

    width: float
    depth: float
    tilt: float

    @cached_property
    def axes(self) -> FloatArray:
        """Of the peg, across and along it, as columns (2, 2)."""
        cos, sin = math.cos(self.tilt), math.sin(self.tilt)
        return np.array([[cos, -sin], [sin, cos]])

    @property
    def corner(self) -> FloatArray:
        """What touches the right wall [m], (2,)."""
        return self.axes @ [self.width, -self.depth]

    @property
    def centre(self) -> FloatArray:
        """Of the peg [m], (2,)."""
        return self.axes @ [self.width / 2, LENGTH / 2 - self.depth]

    def push(self, moment: float, friction: float) -> float:
        """The largest force into the slot, through the peg's centre, that a moment which tilts the
        peg further keeps from moving it [N]: friction is used up at both contacts."""
        across, along = self.axes.T
        edge, corner = across + friction * along, np.array([-1.0, friction])
        levers = [_cross(-self.centre, edge), _cross(self.corner - self.centre, corner)]
        sums = np.array([[*levers, 0.0], [*np.transpose([edge, corner])[0], 0.0],
                         [edge[1], corner[1], -1.0]])  # fmt: skip
        return float(np.linalg.solve(sums, [-moment, 0.0, 0.0])[2])


def _cross(a: FloatArray, b: FloatArray) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def slot(k: int, leaning: Leaning, friction: float, *wrenches: Wrench) -> tuple[Box, Box, Pose]:
    """A peg, the left wall of its slot, and where the right one stands."""
    (x, z), half = leaning.centre.tolist(), leaning.tilt / 2
    turn = (math.cos(half), 0.0, -math.sin(half), 0.0)
    at = Pose(MOUTHS[k].translated(x=x, z=z).position, turn)
    size = (leaning.width, THICK, LENGTH)
    peg = Box(f"peg {k}", size, at, MASS, friction, wrenches=wrenches)
    beside = MOUTHS[k].translated(x=-WALL[0] / 2, z=-WALL[2] / 2)
    right = beside.translated(x=float(leaning.corner[0]) + WALL[0])
    return peg, Box(f"left {k}", WALL, beside, friction=friction), right


@dataclass(frozen=True)
class Wedging(Law, phenomenon="sticking", quantity="largest depth that wedges", unit="m"):
    """A peg that the right wall presses with Q against the edge of the mouth: two forces hold it,
    so they are along the line between the contacts (statics). It leans by atan(l / d) from the
    normal of the peg's face, and by less from that of the wall, so friction holds it where l < mu d
    (Whitney 1982: wedging), whatever Q. Deeper pegs turn, until they lean by so much less that
    l = mu d. Six depths; a peg has turned that did half of what the least deep one of these must.
    Tolerance: half of the gap between the depths on either side; no step."""

    friction: float = 0.5
    width: float = 0.2
    tilt: float = 0.1
    press: float = 20.0
    seconds: float = 0.5

    @property
    def critical(self) -> float:
        """Depth [m]."""
        return self.friction * self.width

    def leaning(self, share: float) -> Leaning:
        return Leaning(self.width, share * self.critical, self.tilt)

    def build(self) -> Scene:
        bodies, jaws = [], []
        for k, share in enumerate(SHARES):
            *free, right = slot(k, self.leaning(share), self.friction)
            bodies += free
            jaws.append(
                Part(
                    f"wall {k}", (-1.0, 0.0, 0.0), right.position, on=MOUNT, slides=True,
                    mass=0.5, inertia=(0.01,) * 3, shape=WALL,
                    stiffness=1e5, damping=2e3, effort=self.press,
                )
            )  # fmt: skip
        robot = mechanism("walls", *jaws, base=Pose(), friction=self.friction)
        return Scene(self.name, tuple(bodies), robot, gravity=WEIGHTLESS)

    def commands(self) -> Trajectory:
        """Set points so far inside the pegs that each drive presses with its limit."""
        return Trajectory.holding(self.seconds, np.full(len(SHARES), self.width / 2))

    def read(self, seen: Watched) -> Reading:
        least = self.friction * BETWEEN / 2
        tilts = [-2 * math.atan2(row[5], row[3]) for row in seen.bodies[-1]]
        return fan(self.critical, [self.tilt - tilt > least for tilt in tilts])


@dataclass(frozen=True)
class Jamming(Law, phenomenon="sticking", quantity="largest push that jams", unit="N"):
    """A peg that a moment M tilts is pushed into a slot with F, through its centre. Both contacts
    press with about N = M / l, and their friction holds up to 2 mu N: it jams where F < 2 mu M / l
    (Whitney 1982: jamming, M / (r F) above l / (2 mu r) with r = d / 2). `Leaning.push` has the
    same without the small angle. It lies deeper than mu d, so nothing is wedged and the forces
    follow from the load. Once it moves, l grows and less holds it: so the push begins when the
    moment has closed both contacts. Six pushes; a peg has moved that went half as far as the least
    push that must move it takes it. Tolerance: half of the gap between the pushes on either side;
    no step."""

    friction: float = 0.3
    width: float = 0.1
    depth: float = 0.06
    tilt: float = 0.02
    moment: float = 1.0
    begin: float = 0.1
    seconds: float = 0.6

    @property
    def leaning(self) -> Leaning:
        return Leaning(self.width, self.depth, self.tilt)

    @property
    def critical(self) -> float:
        """Push [N]."""
        return self.leaning.push(self.moment, self.friction)

    def build(self) -> Scene:
        bodies = []
        for k, share in enumerate(SHARES):
            tilting = Wrench(torque=(0.0, -self.moment, 0.0))
            push = Wrench(force=(0.0, 0.0, -share * self.critical), start=self.begin)
            *free, right = slot(k, self.leaning, self.friction, tilting, push)
            bodies += [*free, Box(f"right {k}", WALL, right, friction=self.friction)]
        return Scene(self.name, tuple(bodies), gravity=WEIGHTLESS)

    def read(self, seen: Watched) -> Reading:
        start = 1.0 + float(self.leaning.centre[1])
        least = BETWEEN * self.critical / MASS * (seen.end - self.begin) ** 2 / 4
        return fan(self.critical, [start - row[2] > least for row in seen.bodies[-1]])
