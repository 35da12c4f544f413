"""A scene with frictions for an engine whose rule for two surfaces is another one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.scene.body import Body
from pytest_simbench.scene.friction import RULES, SOLVED, error
from pytest_simbench.scene.penetration import penetration
from pytest_simbench.scene.scene import Scene

OF_PAIRS = "the friction of pairs is "
"""How a sentence on them begins."""

EXACT = 1e-3
"""A friction is right that is off by no larger share."""

TOUCHING = 1e-3
"""What is no farther apart at the start touches [m]."""

MOST = 3
"""So many pairs are named that are not right."""


def combined(scene: Scene, rule: str, links: Sequence[str] = ()) -> tuple[Scene, str]:
    """The scene with frictions for an engine that has another rule.

    Where no frictions give all pairs, those of what touches at the start come first, see `_ranks`.

    Args:
        scene: whose pairs have friction by `Scene.friction_rule`.
        rule: the engine's, as in `SimulatorInfo.friction_rule`. Where it is empty, each surface
            keeps its own, and that the pairs are not known is told.
        links: of the reduced robot, those with shapes.

    Returns:
        The scene as the engine is to have it, and a sentence on the pairs that have another
        friction than the one asked for; empty where all are right to 0.001 of it.
    """
    if not rule:
        unknown = f"{OF_PAIRS}not known where two surfaces differ: the adapter does not say"
        return scene, unknown if len(scene.frictions) > 1 else ""
    if scene.friction_rule in rule.split("|") or len(scene.frictions) == 1:
        return scene, ""
    rule = rule.partition("|")[0]
    names = ["the ground", *(body.name for body in scene.bodies)]
    own = [scene.ground_friction, *(body.friction for body in scene.bodies)]
    still = [True, *(body.fixed for body in scene.bodies)]
    parts = [["ground"], *([f"body/{body.name}"] for body in scene.bodies)]
    if scene.robot is not None:
        names.append(scene.robot.name)
        own.append(scene.robot.friction)
        still.append(False)
        parts.append([f"link/{link}" for link in links] or ["link/"])
    found = [
        (a, b)
        for a, b in combinations(range(len(own)), 2)
        if not (still[a] and still[b])
        and not all(scene.kept_apart(*pair) for pair in product(parts[a], parts[b]))
    ]
    if scene.robot is not None and scene.robot.self_collide:
        found.append((len(own) - 1, len(own) - 1))
    pairs, frictions = np.array(found, dtype=int).reshape(-1, 2), np.array(own)
    first, second = pairs.T
    asked = RULES[scene.friction_rule](frictions[first], frictions[second])
    ranks = np.zeros(len(pairs), dtype=int)
    for _ in range(2):
        solved = SOLVED[rule](pairs, asked, ranks, len(own))
        solved = np.where(np.isin(np.arange(len(own)), pairs), solved, frictions)
        got = RULES[rule](solved[first], solved[second])
        off = error(got, asked)
        if (off <= EXACT).all() or ranks.any():
            break
        ranks = _ranks(scene, found, still)
    ground, *others = solved.tolist()
    robot = scene.robot and replace(scene.robot, friction=others.pop())
    bodies = tuple(body.with_friction(mu) for body, mu in zip(scene.bodies, others, strict=True))
    made = replace(scene, bodies=bodies, robot=robot, ground_friction=ground, friction_rule=rule)
    wrong = sorted(np.flatnonzero(off > EXACT), key=lambda k: (ranks[k], -off[k]))
    told = []
    for k in wrong[:MOST]:
        a, b = found[k]
        other = names[b] if a != b else "itself"
        told.append(f"of {names[a]} and {other} it is {got[k]:.3g}, not {asked[k]:.3g}")
    if len(wrong) > MOST:
        told.append(f"and {len(wrong) - MOST} more")
    why = f"the engine takes the {rule} of two surfaces"
    return made, f"{OF_PAIRS}not the scene's: {'; '.join(told)} ({why})" if told else ""


def _ranks(
    scene: Scene, pairs: Sequence[tuple[int, int]], still: Sequence[bool]
) -> NDArray[np.int_]:
    """Of pairs of places among ground, bodies and robot: 1 of what touches where the scene is
    written; 2 of what is near, of a robot with what can move, of what touches nothing with what
    stands still; 3 of others."""
    poses = scene.written or [body.pose for body in scene.bodies]
    bodies = [body.moved_to(at) for body, at in zip(scene.bodies, poses, strict=True)]
    parts = [[part.moved_to(body.pose * part.pose) for part in body.parts] for body in bodies]
    lowest = [float(body.reach_placed(np.array([[0.0, 0.0, -1.0]]))[0]) for body in bodies]
    robot = len(bodies) + 1

    def near(a: int, b: int) -> bool:
        return a > 0 and b < robot and _near(bodies[a - 1], bodies[b - 1])

    def touch(a: int, b: int) -> bool:
        if a == 0:
            return b < robot and lowest[b - 1] >= -TOUCHING
        sides = product(parts[a - 1], parts[b - 1]) if near(a, b) else ()
        return any(_near(one, two) and penetration(one, two) >= -TOUCHING for one, two in sides)

    touching = {pair for pair in pairs if touch(*pair)}
    resting = {robot, *(place for pair in touching for place in pair)}
    ranks = []
    for a, b in pairs:
        held = b == robot != a and not still[a]
        falls = (still[a] and b not in resting) or (still[b] and a not in resting)
        second = held or falls or near(a, b)
        ranks.append(1 if (a, b) in touching else 2 if second else 3)
    return np.array(ranks)


def _near(a: Body, b: Body) -> bool:
    reach = (math.hypot(*a.extents) + math.hypot(*b.extents)) / 2
    return math.dist(a.pose.position, b.pose.position) <= reach
