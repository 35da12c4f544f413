"""A contact task: bowls of many convex parts fall into each other. How high do they stand?

A bowl has eight flat walls that lean outwards by `LEAN`. The outer faces of the upper one lie on
the inner faces of the lower one, so each stands `THICK / sin(LEAN)` above the one below (geometry;
the floors do not touch). Friction is below tan(LEAN), so none sticks before it is there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.description.urdf import Link
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Compound, ConvexMesh, Pose, Scene, principal
from pytest_simbench.scene.checks import check_count, check_number
from pytest_simbench.tasks.base import Count, Jitter, Moment, Outcome, Randomness, Task
from pytest_simbench.tasks.resting import RESTLESS, SHORTEST, rates, rest
from pytest_simbench.tasks.settling import tilted

WALLS, LEAN = 8, math.radians(30.0)
"""Of a bowl, and how far they lean outwards from the vertical [rad]."""

FLOOR, HEIGHT, THICK = 0.025, 0.05, 0.003
"""From the middle of the floor to a wall, height of the walls, thickness of all [m]."""

MASS, FRICTION = 0.1, 0.2

GAP = 0.005
"""By which a bowl starts above where it will rest [m]."""

STEP = THICK / math.sin(LEAN)
"""From one bowl to the next, nested [m]: 6 mm."""

NESTED = 5e-4
"""A stack is nested whose bowls are off by no more than that each [m]."""

CHINA = (0.85, 0.88, 0.92, 1.0)


@dataclass(frozen=True)
class Nesting(Task):
    """Let bowls fall into each other.

    Attributes:
        bowls: how many, the lowest on the ground.
        settle: how long they have for it [s].
    """

    name: ClassVar[str] = "nesting"
    counted: ClassVar[str] = "bowls nested"
    moments: ClassVar[tuple[Moment, ...]] = (Moment("before they fall", "fall"),)
    references: ClassVar[Mapping[str, float]] = {
        "height_error": 0.0, "tilt": 0.0, "restless": 0.0,
    }  # fmt: skip

    bowls: int = 4
    settle: float = 3.0

    def __post_init__(self) -> None:
        check_count(self.bowls, f"the number of bowls of {self.name}")
        check_number(self.settle, f"the time [s] of {self.name}", SHORTEST)

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (
            Metric("height_error", "height error", unit="mm", better="lower", least=0,
                   resolution=0.01,
                   doc="of a bowl above the one below it, of that which is farthest off"),
            Metric("tilt", "tilt", unit="deg", better="lower", least=0,
                   doc="of the bowl that leans most"),
            Metric("restless", "restless", unit="mm/s", better="lower", least=0, resolution=0.1,
                   doc=f"root mean square speed in the last {RESTLESS:g} s, of the fastest bowl"),
        )  # fmt: skip

    def smoke(self) -> Nesting:
        return replace(self, bowls=2, settle=SHORTEST)

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        rng, (bowl, bottom) = Randomness.of(seed).start, a_bowl()
        placed = []
        for k in range(self.bowls):
            at = Pose.at(0.0, 0.0, bottom + k * (STEP + GAP))
            placed.append(bowl.changed(name=f"bowl_{k + 1}", pose=jitter.disturbed(at, rng)))
        return Scene("nesting", tuple(placed), ground_friction=FRICTION)

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        names = [f"bowl_{k + 1}" for k in range(self.bowls)]
        world.mark("start")
        seen = rest(world, self.settle, "fall")
        world.mark("end")
        poses = [world.pose(name) for name in names]
        steps = np.diff([pose.position[2] for pose in poses])
        off = np.abs(steps - STEP)
        count(int((off < NESTED).sum()) + 1, self.bowls)
        speeds = np.linalg.norm(rates(seen.time, seen.bodies[:, :, :3]), axis=1)
        tilts = [tilted(Pose(), pose) for pose in poses]
        return Outcome(
            {
                "height_error": 1000 * float(off.max(initial=0.0)),
                "tilt": max(tilts),
                "restless": 1000 * float(speeds.max()),
            },
            {"steps": steps.tolist()},
        )


def a_bowl() -> tuple[Compound, float]:
    """A bowl of nine convex parts, and how high its centre of mass is above its bottom [m]."""
    half = math.pi / WALLS
    turns = [2 * half * k for k in range(WALLS)]
    points = {"floor": [_corner(FLOOR, turn + half, z) for z in (-THICK, 0.0) for turn in turns]}
    thick = THICK / math.cos(LEAN)
    for k, turn in enumerate(turns):
        points[f"wall_{k + 1}"] = [
            _corner(FLOOR + z * math.tan(LEAN) + out, turn + side, z)
            for z in (-THICK, HEIGHT)
            for out in (0.0, thick)
            for side in (-half, half)
        ]
    parts = {name: principal(corners) for name, corners in points.items()}
    shapes = [ConvexMesh(name, *part, 0.0, FRICTION) for name, part in parts.items()]
    whole = Link("bowl")
    share = MASS / sum(shape.volume for shape in shapes)
    for shape in shapes:
        part = shape.changed(mass=share * shape.volume)
        whole.absorb(Link("", part.mass, inertia=np.diag(part.even_inertia())), part.pose)
    moments = tuple(map(float, np.diag(whole.inertia)))
    down = -float(whole.centre[2])
    lowered = tuple(shape.moved_to(shape.pose.translated(z=down)) for shape in shapes)
    bowl = Compound(
        "bowl", lowered, Pose(), MASS, FRICTION, CHINA, moments=moments  # type: ignore[arg-type]
    )  # fmt: skip
    return bowl, THICK - down


def _corner(apothem: float, turn: float, z: float) -> tuple[float, float, float]:
    """Of an octagon with sides that far from its middle [m], at its corner next to a turn [rad]."""
    radius = apothem / math.cos(math.pi / WALLS)
    return radius * math.cos(turn), radius * math.sin(turn), z
