"""What an adapter remembers of the scene, and how to replace it.

An adapter keeps the scene that it loaded, for names. Values that it reads back must come from the
engine. To see that they do, it is made to remember another scene of the same names: what it then
reads back must still be what the engine holds.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.scene import Body, Robot, Scene
from pytest_simbench.simulator.base import Simulator


@contextmanager
def remembering(simulator: Simulator, scene: Scene) -> Iterator[None]:
    """Have the adapter, and the objects of its own package that it holds, remember `scene`.

    Every `Scene`, `Robot`, `PreparedRobot` and `Body` among their attributes is replaced meanwhile.
    """
    replaced = list(_memories(simulator, scene))
    for owner, name, _, other in replaced:
        object.__setattr__(owner, name, other)
    try:
        yield
    finally:
        for owner, name, value, _ in replaced:
            object.__setattr__(owner, name, value)


def _memories(simulator: Simulator, scene: Scene) -> Iterator[tuple[Any, str, Any, Any]]:
    """Owner, attribute, value and its counterpart in `scene` of everything remembered."""
    packages = {cls.__module__.partition(".")[0] for cls in type(simulator).__mro__} - {"builtins"}
    waiting: list[Any] = [simulator]
    seen = set()
    while waiting:
        owner = waiting.pop()
        if id(owner) in seen:
            continue
        seen.add(id(owner))
        for name, value in vars(owner).items():
            other = _counterpart(value, scene)
            if other is not None:
                yield owner, name, value, other
            elif type(value).__module__.partition(".")[0] in packages and hasattr(
                value, "__dict__"
            ):
                waiting.append(value)


def _counterpart(value: Any, scene: Scene) -> Any:
    robot = scene.robot
    if isinstance(value, Scene):
        return scene
    if isinstance(value, Body):
        return scene.body(value.name)
    if isinstance(value, Robot):
        return robot
    if isinstance(value, PreparedRobot) and robot is not None:
        return PreparedRobot(robot)
    return None
