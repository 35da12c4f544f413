"""Friction of pairs: each engine makes that of two surfaces by a rule of its own.

Every rule is a mean: of two equal frictions it makes the same one. A scene of one friction is
therefore the same by every rule. For other scenes `combined` finds the frictions of the surfaces
with which an engine's rule gives each pair what the scene's rule gives it, or nearly so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from pytest_simbench.scene.pose import FloatArray

if TYPE_CHECKING:
    from pytest_simbench.scene.scene import Scene

LEAST = 1e-6
"""Stands for no friction where a rule cannot have it."""


def _of_means(pairs: FloatArray, asked: FloatArray, count: int) -> FloatArray:
    """Numbers (count,) of which each pair (n, 2) has the mean `asked` (n,), or nearly so."""
    share = np.zeros((len(pairs), count))
    share[np.arange(len(pairs))[:, None], pairs] = 0.5
    return np.asarray(np.linalg.lstsq(share, asked, rcond=None)[0])


def _of_largest(pairs: FloatArray, asked: FloatArray, count: int) -> FloatArray:
    """Numbers of which no pair has a larger maximum than `asked`: the largest such."""
    found = np.full(count, np.inf)
    for pair, most in zip(pairs, asked, strict=True):
        found[pair] = np.minimum(found[pair], most)
    return found


def _of_smallest(pairs: FloatArray, asked: FloatArray, count: int) -> FloatArray:
    """Numbers of which no pair has a smaller minimum than `asked`: the smallest such."""
    return -_of_largest(pairs, -asked, count)


def _transformed(
    there: Callable[[FloatArray], FloatArray], back: Callable[[FloatArray], FloatArray]
) -> Callable[[FloatArray, FloatArray, int], FloatArray]:
    return lambda pairs, asked, count: back(_of_means(pairs, there(asked), count))


RULES: dict[str, Callable[[FloatArray, FloatArray], FloatArray]] = {
    "maximum": np.maximum,
    "minimum": np.minimum,
    "mean": lambda a, b: (a + b) / 2,
    "geometric": lambda a, b: np.sqrt(a * b),
    "harmonic": lambda a, b: 2 * a * b / np.maximum(a + b, LEAST),
}
"""What a rule makes of the frictions of two surfaces. An engine that takes their product is given
the roots, and is `geometric`."""

_SOLVED: dict[str, Callable[[FloatArray, FloatArray, int], FloatArray]] = {
    "maximum": _of_largest,
    "minimum": _of_smallest,
    "mean": _of_means,
    "geometric": _transformed(lambda mu: np.log(np.maximum(mu, LEAST)), np.exp),
    "harmonic": _transformed(
        lambda mu: 1 / np.maximum(mu, LEAST), lambda r: 1 / np.maximum(r, LEAST)
    ),
}


def combined(scene: Scene, rule: str) -> tuple[Scene, str]:
    """The scene with frictions for an engine that has another rule.

    Args:
        scene: whose pairs have friction by `Scene.friction_rule`.
        rule: the engine's, one of `RULES`.

    Returns:
        The scene as the engine is to have it, and a sentence on the pair whose friction is farthest
        from the one asked for; empty where all are right to 0.001.
    """
    names = ["the ground", *(body.name for body in scene.bodies)]
    own = [scene.ground_friction, *(body.friction for body in scene.bodies)]
    still = [True, *(body.fixed for body in scene.bodies)]
    if scene.robot is not None:
        names.append(scene.robot.name)
        own.append(scene.robot.friction)
        still.append(False)
    if rule == scene.friction_rule or len(scene.frictions) == 1:
        return scene, ""
    found = [(a, b) for a, b in combinations(range(len(own)), 2) if not (still[a] and still[b])]
    pairs, frictions = np.array(found, dtype=int).reshape(-1, 2), np.array(own)
    first, second = pairs.T
    asked = RULES[scene.friction_rule](frictions[first], frictions[second])
    solved = np.maximum(_SOLVED[rule](pairs, asked, len(own)), 0.0)
    solved = np.where(np.isfinite(solved), solved, frictions)  # of what can touch nothing
    gaps = np.abs(RULES[rule](solved[first], solved[second]) - asked)
    ground, *others = solved.tolist()
    robot = scene.robot and replace(scene.robot, friction=others.pop())
    bodies = tuple(body.with_friction(mu) for body, mu in zip(scene.bodies, others, strict=True))
    made = replace(scene, bodies=bodies, robot=robot, ground_friction=ground, friction_rule=rule)
    if not len(gaps) or gaps.max() < 1e-3:
        return made, ""
    worst = int(gaps.argmax())
    a, b = found[worst]
    return made, (
        f"the friction of pairs is nearly that of the scene: of {names[a]} and {names[b]} it is "
        f"off by {gaps[worst]:.2g}, of no pair by more (the engine takes the {rule} of two "
        "surfaces)"
    )
