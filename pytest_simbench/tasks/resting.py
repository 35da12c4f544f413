"""The end of a task: how calmly do things rest?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from pytest_simbench.client.errors import EngineFailed
from pytest_simbench.client.motion import Motion
from pytest_simbench.client.world import World
from pytest_simbench.ground.errors import NotSupportedError
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import FloatArray, Scene

RESTLESS = 0.5
"""The last seconds over which it is measured how calmly things rest [s]."""

SHORTEST = 2 * RESTLESS
"""For things to come to rest, those last seconds included [s]."""

LOG_PERIOD = 0.01
"""Between two samples of a motion [s]."""

LOOKS = 10
"""So often the forces of contacts are asked for while things rest."""

FORCE_JITTER = Metric(
    "force_jitter", "restless forces", unit="%", least=0, better="lower",
    doc=f"spread of the forces of contacts over {LOOKS} looks in the last {RESTLESS:g} s, of the "
        "weight of all free bodies; of simulators that tell them, where not all sleeps by then",
)  # fmt: skip

Forces = Mapping[tuple[str, str], FloatArray]
"""As `World.contact_forces`."""


def rest(world: World, seconds: float, phase: str) -> Motion:
    """Wait for so long [s], `SHORTEST` at least, and return the motion of the last `RESTLESS`."""
    with world.phase(phase):
        world.wait(seconds - RESTLESS)
    with world.phase("rest"):
        return world.wait(RESTLESS, log_period=LOG_PERIOD)


def calm(world: World, seconds: float, phase: str) -> tuple[Motion, list[Forces]]:
    """The same, and the forces of contacts now and then in that motion; none where the simulator
    does not tell them of this scene, or all sleeps from the first look on, which changes none."""
    with world.phase(phase):
        world.wait(seconds - RESTLESS)
    parts: list[Motion] = []
    forces: list[Forces] = []
    began = world.time
    with world.phase("rest"):
        for k in range(1, LOOKS + 1):
            until = began + k * RESTLESS / LOOKS
            parts.append(world.wait(until - world.time, log_period=LOG_PERIOD))
            found = told_forces(world) if k == 1 or forces else None
            if found is not None:
                forces.append(_with_asleep(world, found, forces[-1] if forces else {}))
    awake = any(part.bodies[:, :, 7:].any() for part in parts[1:])
    return Motion.joined(parts), forces if awake else []


def _with_asleep(world: World, found: Forces, before: Forces) -> Forces:
    """The forces, and those of the look before on bodies that sleep since then: they stand still,
    and nothing is told of what holds them."""
    rows = zip(world.scene.free_bodies, world.bodies, strict=True)
    moves = {f"body/{body.name}": bool(row[7:].any()) for body, row in rows}
    held = dict(found)
    for pair, force in before.items():
        ends = [moves.get(name) for name in pair]
        if False in ends and True not in ends and not np.any(found.get(pair, 0.0)):
            held[pair] = force
    return held


def told_forces(world: World) -> Forces | None:
    """The forces of contacts; None where the simulator does not tell them of this scene."""
    try:
        return world.contact_forces()
    except EngineFailed as error:
        if error.remote != NotSupportedError.__name__:
            raise
        return None


def spread(scene: Scene, forces: Sequence[Forces]) -> float | None:
    """Of the forces of all pairs over several looks, of the free bodies' weight [%]; None without
    looks or weight."""
    weight = sum(body.mass for body in scene.free_bodies) * float(np.linalg.norm(scene.gravity))
    if not forces or not weight:
        return None
    pairs = sorted({pair for found in forces for pair in found if pair[0] < pair[1]})
    rows = [[found[p][:3] if p in found else np.zeros(3) for p in pairs] for found in forces]
    each = np.array(rows).reshape(len(forces), -1)
    return 100 * float(np.sqrt(each.var(axis=0).sum())) / weight


def by_poses(motion: Motion) -> FloatArray:
    """The bodies of all samples but the last, as fast as their poses change until the next one."""
    now, then = motion.bodies[:-1], motion.bodies[1:]
    step = np.diff(motion.time).reshape(-1, 1, 1)
    turns = [Rotation.from_quat(rows[..., [4, 5, 6, 3]].reshape(-1, 4)) for rows in (now, then)]
    turned = (turns[1] * turns[0].inv()).as_rotvec().reshape(*now.shape[:2], 3)
    ways = then[..., :3] - now[..., :3]
    return np.concatenate([now[..., :7], ways / step, turned / step], axis=2)


def rates(time: FloatArray, values: FloatArray) -> FloatArray:
    """Root mean squares of the rates at which values change, (...).

    They are of the values: the speeds that an engine tells may be others.

    Args:
        time: of the samples [s], (n,).
        values: (n, ...).
    """
    step = np.diff(time).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(np.sqrt(np.mean((np.diff(values, axis=0) / step) ** 2, axis=0)))
