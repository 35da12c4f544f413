"""Which states a world can be in, whatever happened in it.

A world whose cubes left the room, sank into the ground or stand inside each other has diverged,
as one whose state is no number: it is a failure of the simulation and has no score. The limits
are far beyond all that can happen to a cube; one that lies beside the table or was thrown three
metres is where it may be.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from pytest_simbench.scene.bodies import Box
from pytest_simbench.scene.overlap import overlaps, rotations
from pytest_simbench.scene.penetration import penetration
from pytest_simbench.scene.pose import FloatArray, Pose
from pytest_simbench.scene.scene import Scene

DEEPEST = 1 / 3
"""Share of the thinner body's shortest edge to which two bodies, or a body and the ground, may
overlap. The softest contacts of any engine's defaults give way by 1 mm of 50."""

THICK = 0.9
"""Layer in which the overlap of two bodies that are not both boxes is measured, as a share of half
their shortest edge: the core within it never counts as less than that."""

FASTEST = 30.0
"""No point of a body is faster [m/s]: ten times what the arm can throw, and twice a fall from the
ceiling of the room."""


def implausible(scene: Scene, bodies: FloatArray, striking: bool = False) -> str | None:
    """Why these states of the free bodies cannot be, as a sentence; None when they can.

    Looked at after every motion and wait, in the pytest process: under a millisecond for 21
    cubes. Where bodies are `striking` each other right then, how deep they are in each other is not
    looked at: soft contacts stop a marble of 16 mm 16 mm deep.
    States are rows as of `World.bodies`, (n_free, 13).
    """
    if not len(bodies):
        return None
    free = scene.free_bodies
    if not np.isfinite(bodies).all():
        row = int(np.argmin(np.isfinite(bodies).all(axis=1)))
        return f"the state of {free[row].name!r} is not finite"
    position = bodies[:, :3]
    half = np.array([body.extents for body in free]) / 2
    x, y, height = scene.room
    beyond = (np.abs(position[:, :2]) > (x, y)).any(axis=1) | (position[:, 2] > height)
    for k in np.flatnonzero(beyond):
        at = ", ".join(f"{value:.3g}" for value in position[k])
        return (
            f"{free[k].name!r} left the room: it is at ({at}) m, and the room of scene "
            f"{scene.name!r} goes {x:g} m to each side in x, {y:g} m in y, and {height:g} m up"
        )
    radius = np.linalg.norm(half, axis=1)
    speed = np.linalg.norm(bodies[:, 7:10], axis=1) + radius * np.linalg.norm(
        bodies[:, 10:], axis=1
    )
    for k in np.flatnonzero(speed > FASTEST):
        return f"{free[k].name!r} moves at {speed[k]:.3g} m/s, and nothing here can be so fast"
    return None if striking else _too_deep(scene, bodies)


def _too_deep(scene: Scene, bodies: FloatArray) -> str | None:
    """The first body that is inside the ground or another body."""
    everything = (*scene.free_bodies, *scene.fixed_bodies)
    names = [body.name for body in everything]
    fixed = [body.pose.as_array() for body in scene.fixed_bodies]
    states = np.concatenate([bodies[:, :7], np.reshape(fixed, (-1, 7))])
    half = np.array([body.extents for body in everything]) / 2
    boxes = np.array([isinstance(body, Box) for body in everything])
    limit = 2 * half.min(axis=1) * DEEPEST
    position, turn = states[:, :3], rotations(states[:, 3:])
    down = np.einsum("ni,ni->n", np.abs(turn[:, 2]), half)
    for k in np.flatnonzero(~boxes):
        down[k] = everything[k].reach(-turn[k, 2][None])[0]
    depth = down - position[:, 2]
    for k in np.flatnonzero(depth[: len(bodies)] > limit[: len(bodies)]):
        if scene.kept_apart("ground", f"body/{names[k]}"):
            continue
        return f"{names[k]!r} is {1000 * depth[k]:.0f} mm deep in the ground"
    pairs = [(a, b) for a, b in combinations(range(len(names)), 2) if a < len(bodies)]
    if scene.apart:
        told = [f"body/{name}" for name in names]
        pairs = [(a, b) for a, b in pairs if not scene.kept_apart(told[a], told[b])]
    if not pairs:
        return None
    a, b = np.array(pairs).T
    offset, radius = position[b] - position[a], np.linalg.norm(half, axis=1)
    near = np.linalg.norm(offset, axis=1) < radius[a] + radius[b]
    a, b, offset = a[near], b[near], offset[near]
    into = overlaps(offset, turn[a], half[a], turn[b], half[b])
    for k in np.flatnonzero(~(boxes[a] & boxes[b])):  # of these, boxes around them overlap sooner
        first, second = (everything[n].moved_to(Pose.from_array(states[n])) for n in (a[k], b[k]))
        into[k] = min(into[k], penetration(first, second, THICK))
    for k in np.flatnonzero(into > np.minimum(limit[a], limit[b])):
        return f"{names[a[k]]!r} and {names[b[k]]!r} overlap by {1000 * into[k]:.0f} mm"
    return None
