"""Wait for a count only while something can change it.

What moved in the last second is carried on to the end of the wait: as fast, faster by as much as
it grew since the second before, and with a margin. The wait ends early when with all of that no
body could lose its support and no count could change. A body that falls, rolls, turns or creeps
keeps it running. A body that creeps back after it has nearly stood still for a second is not
foreseen: 1 mm out and, over nine seconds, 0.8 mm back. What the scene does by itself is: a body
that moves as prescribed, and a force that starts or ends.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from pytest_simbench.client.motion import Motion
from pytest_simbench.client.world import World
from pytest_simbench.records.notes import Wait
from pytest_simbench.scene import FloatArray, Scene

SAMPLING = 0.05
"""While everything settles [s]; 20 Hz cost nothing."""

WINDOW = 1.0
"""Motion is looked at over the last one and the one before [s]."""

MARGIN = 3.0
"""Times what moved, as it is carried on."""

LEAST = 1e-6
"""What any body may move, however still it is [m]. It is small: a cube of the pyramid that turns
over once comes to lie one edge farther, 5 cm, which is where it counts as moved."""

SUPPORT = 0.04
"""A body that moves by less than this share of its smallest edge keeps its contacts: 2 mm of the
study's cubes, which tip when they are 25 mm off."""

STILL = 0.01
"""The robot is at rest when no joint would move farther than this [rad, m]."""


@dataclass(frozen=True)
class Slack:
    """How far any point of a body must move, at least, to change a count [m]."""

    body: str
    count: str
    distance: float


def settle(
    world: World, seconds: float, slacks: Callable[[Motion], Iterable[Slack]], *, full: bool
) -> tuple[Motion, Wait]:
    """Wait `seconds` [s] of simulated time, or shorter where nothing can change any more. The costs
    of stepping are those of the work before.

    Args:
        slacks: of the task's counts, for what the wait was so far.
        full: wait all of it in any case.

    Returns:
        The motion, without a sample if it was too short for one; and how it ended.
    """
    world.worked = world.stats()["stepping"]
    began, parts = world.time, []
    ends = [] if full else np.arange(WINDOW, seconds - WINDOW / 2, WINDOW).tolist()
    for end in [*ends, seconds]:
        parts.append(world.wait(max(0.0, began + end - world.time), log_period=SAMPLING))
        since = world.time - 2 * WINDOW
        if len(parts) > 1 and end < seconds and not _acts(world.scene, since, began + seconds):
            bound = _bound(world.scene, parts, seconds - end, slacks)
            if bound is not None:
                return Motion.joined(parts), Wait(world.time - began, seconds, *bound)
    return Motion.joined(parts), Wait(world.time - began, seconds)


def _acts(scene: Scene, since: float, until: float) -> bool:
    """Whether a body moves as prescribed, or a force starts or ends between two times [s]."""
    wrenches = [wrench for body in scene.bodies for wrench in body.wrenches]
    return any(body.velocity.any() for body in scene.prescribed_bodies) or any(
        since < time < until for wrench in wrenches for time in (wrench.start, wrench.end)
    )


def _bound(
    scene: Scene, parts: list[Motion], left: float, slacks: Callable[[Motion], Iterable[Slack]]
) -> tuple[str, float, float] | None:
    """What is nearest to a change, how far its body may move in the time that is left [s], and how
    far it would have to [m]; None where something can change."""
    bodies = scene.free_bodies
    radii = np.array([np.linalg.norm(body.extents) / 2 for body in bodies])
    was, moved = (_moved(motion.bodies, radii) for motion in parts[-2:])
    reaches = LEAST + carried_on(was, moved, left)
    reach = {body.name: float(far) for body, far in zip(bodies, reaches, strict=True)}
    found = [Slack(body.name, "support", SUPPORT * min(body.extents)) for body in bodies]
    swung, swings = (np.ptp(motion.joints[:, 0], axis=0) for motion in parts[-2:])
    if (carried_on(swung, swings, left) > STILL).any() or any(
        reach[slack.body] >= slack.distance for slack in found
    ):
        return None
    found += slacks(Motion.joined(parts))
    nearest = min(found, key=lambda slack: slack.distance - reach[slack.body])
    told = f"{nearest.count} of {nearest.body}", reach[nearest.body], nearest.distance
    return told if reach[nearest.body] < nearest.distance else None


def carried_on(before: FloatArray, last: FloatArray, left: float) -> FloatArray:
    """How far what moved so far in the last window and in the one before may come in the time that
    is left [s], margin included."""
    windows = left / WINDOW
    return MARGIN * windows * (last + windows * np.maximum(last - before, 0.0))


def _moved(rows: FloatArray, radii: FloatArray) -> FloatArray:
    """How far from where it was last any point of each body was in a window, at most [m]; rows are
    (n, m, 7 or more): position [m], quaternion."""
    places, turns = rows[..., :3], rows[..., 3:7]
    apart = np.linalg.norm(places - places[-1], axis=2)
    chords = np.minimum(
        np.linalg.norm(turns - turns[-1], axis=2), np.linalg.norm(turns + turns[-1], axis=2)
    )
    angles = 4 * np.arcsin(np.minimum(chords / 2, 1.0))
    return np.asarray((apart + angles * radii).max(axis=0))
