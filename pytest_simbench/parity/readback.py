"""The template of what an adapter reads back: of which parts of a scene its engine is asked.

An adapter keeps the scene that it loaded, for names. To see that what it reads back comes from the
engine, it is made to remember another scene of the same names (`remembering`): what it then reads
back must still be what the engine holds.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from pytest_simbench.description.shapes import Outline, outlines
from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.parity.quantities import named, touches
from pytest_simbench.scene import Body, Coupling, FloatArray, Robot, Scene
from pytest_simbench.simulator.base import Simulator, named_parts


class ReadBack(ABC):
    """Reads the quantities of `parity.quantities` that an engine tells.

    It is a part of its adapter, and asks the engine about what the adapter built. Scene and robot
    give names, never values. What the engine does not tell is left out, and declared. The methods
    name quantities without what they are of: `mass`, not `body/cube/mass`.

    Args:
        simulator: the adapter, whose world was loaded.
        ground, bodies, links: what stands for them, bodies and links by name: anything by which
            the methods ask the engine, called a part.

    Attributes:
        scene, prepared: the adapter's; the reduced robot is None in a scene without one.
        grounded: whether the world has a ground, as each but that of a user's file has.
    """

    grounded = True

    def __init__(
        self, simulator: Any, ground: Any, bodies: Mapping[str, Any], links: Mapping[str, Any]
    ) -> None:
        self.scene, self.prepared = simulator.scene, simulator.prepared
        self.ground, self.bodies, self.links = ground, bodies, links

    def all(self) -> dict[str, Any]:
        """Every quantity that the engine tells, by its name."""
        reported = self.world() | named("ground", **self.surface(self.ground))
        reported.pop("ground/margin", None)
        for body in self.scene.bodies:
            part = self.bodies[body.name]
            found = self.part(part) | self.body(part, body.name)
            reported |= named(f"body/{body.name}", **found)
        if self.prepared is not None:
            robot = self.prepared.robot
            for name in self.prepared.links:
                found = self.part(self.links[name])
                if name != self.prepared.root:
                    found |= self.inertial(self.links[name])
                reported |= named(f"link/{name}", **found)
            for name in robot.joint_names:
                reported |= named(f"joint/{name}", **self.joint(name))
            for k, (points, rigid) in enumerate(self.closures()):
                reported |= named(f"closure/{k}", points=points, rigid=float(rigid))
            for pair in robot.couplings:
                if (told := self.coupling(pair)) is not None:
                    reported[f"coupling/{pair.follower}"] = told
            coupled = self.coupled(robot.gripper.couplings)
            reported |= {} if coupled is None else {"gripper/coupled": float(coupled)}
        reported |= self.touches()
        return {k: v for k, v in reported.items() if self.grounded or "ground/" not in k}

    def part(self, part: Any) -> dict[str, Any]:
        """Pose, shapes and surface of a body or link."""
        shapes = list(self.shapes(part))
        surface = self.surface(part) if shapes else {}
        return {"pose": self.pose(part), **outlines(shapes, self.asked(part)), **surface}

    @abstractmethod
    def world(self) -> dict[str, Any]:
        """Gravity, time step, and the ground's height."""

    @abstractmethod
    def pose(self, part: Any) -> Any:
        """Of the frame of a body or link, (7,)."""

    @abstractmethod
    def shapes(self, part: Any) -> Iterable[Outline]:
        """Of a body or link."""

    def asked(self, part: Any) -> list[FloatArray] | None:
        """The reaches that the scene asks for, of an engine whose shapes are measured; None: as
        exactly as they were made."""
        return None

    @abstractmethod
    def surface(self, part: Any) -> dict[str, Any]:
        """Friction, restitution and margin of the ground, a body or a link."""

    @abstractmethod
    def inertial(self, part: Any) -> dict[str, Any]:
        """Mass, centre of mass, inertia, damping and gravity of a body or link that moves."""

    @abstractmethod
    def body(self, part: Any, name: str) -> dict[str, Any]:
        """What a body has beside shapes and surface; of one that forces move with its inertia."""

    @abstractmethod
    def joint(self, name: str) -> dict[str, Any]:
        """The quantities of a driven joint; `rest` where it has a spring."""

    def closures(self) -> Iterable[tuple[FloatArray, bool]]:
        """The points of each closure in the frames of its links, (2, 3) [m], and whether it is a
        weld."""
        return ()

    def coupled(self, pairs: tuple[Coupling, ...]) -> bool | None:
        """Whether the fingers of each pair are coupled; None: the engine does not tell."""
        found = [self.coupling(pair) for pair in pairs]
        if any(told is None for told in found):
            return None
        return all(np.array_equal(told, [1.0, 0.0]) for told in found if told is not None)

    def coupling(self, pair: Coupling) -> FloatArray | None:
        """Ratio and offset of two joints, (2,); None: the engine does not tell."""
        return None

    def touches(self) -> dict[str, Any]:
        """What can collide with what: all of the shapes of two parts, of two links any."""
        parts = named_parts(self.ground, self.bodies, self.links)

        def can_touch(a: str, b: str) -> bool:
            found = np.asarray(self.collide(parts[a], parts[b]), dtype=bool)
            if a.startswith("link/") and b.startswith("link/"):
                return bool(found.any())
            return bool(found.size and found.all())

        return touches(self.scene, self.prepared, can_touch)

    def collide(self, first: Any, second: Any) -> Any:
        """Whether shapes of two parts can collide: of each of one and each of the other, (n, m)."""
        raise NotImplementedError


def felt(force: FloatArray, mass: float, gravity: FloatArray) -> float:
    """Share of gravity that a constant force on a link has it feel; gravity in [m/s^2]."""
    gravity = np.asarray(gravity)
    return float(force @ gravity / (mass * gravity @ gravity)) if gravity.any() else 0.0


def one_value(values: Any) -> Any:
    """The number that all values are (frictions of a body's shapes, both ends of a force range).

    Where they differ: all of them, as an array (n,), which no scene asks for.
    """
    values = np.ravel(values)
    return values[0] if values.size and (values == values[0]).all() else np.unique(values)


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
