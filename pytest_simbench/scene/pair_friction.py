"""A scene with frictions for an engine whose rule for two surfaces is another one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np

from pytest_simbench.scene.friction import RULES, SOLVED
from pytest_simbench.scene.scene import Scene


def combined(scene: Scene, rule: str, links: Sequence[str] = ()) -> tuple[Scene, str]:
    """The scene with frictions for an engine that has another rule.

    Args:
        scene: whose pairs have friction by `Scene.friction_rule`.
        rule: the engine's, one of `RULES`; empty where nobody knows it: each surface then keeps its
            own, and that the pairs are not known is told.
        links: of the reduced robot, those with shapes.

    Returns:
        The scene as the engine is to have it, and a sentence on the pair whose friction is farthest
        from the one asked for; empty where all are right to 0.001.
    """
    if not rule:
        unknown = "what the friction of two surfaces is where they differ, the adapter does not say"
        return scene, unknown if len(scene.frictions) > 1 else ""
    if rule == scene.friction_rule or len(scene.frictions) == 1:
        return scene, ""
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
    solved = np.maximum(SOLVED[rule](pairs, asked, len(own)), 0.0)
    solved = np.where(np.isin(np.arange(len(own)), pairs), solved, frictions)
    gaps = np.abs(RULES[rule](solved[first], solved[second]) - asked)
    ground, *others = solved.tolist()
    robot = scene.robot and replace(scene.robot, friction=others.pop())
    bodies = tuple(body.with_friction(mu) for body, mu in zip(scene.bodies, others, strict=True))
    made = replace(scene, bodies=bodies, robot=robot, ground_friction=ground, friction_rule=rule)
    if not len(gaps) or gaps.max() < 1e-3:
        return made, ""
    worst = int(gaps.argmax())
    a, b = found[worst]
    other = names[b] if a != b else "itself"
    return made, (
        f"the friction of pairs is nearly that of the scene: of {names[a]} and {other} it is "
        f"off by {gaps[worst]:.2g}, of no pair by more (the engine takes the {rule} of two "
        "surfaces)"
    )
