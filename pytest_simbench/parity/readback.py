"""The template of what an adapter reads back: of which parts of a scene its engine is asked."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any

import numpy as np

from pytest_simbench.parity.quantities import touches
from pytest_simbench.scene import FloatArray


class ReadBack(ABC):
    """Reads the quantities of `parity.quantities` that an engine tells.

    It is a part of its adapter, and asks the engine about what the adapter built. Scene and robot
    give names, never values. What the engine does not tell is left out, and declared.

    Args:
        simulator: the adapter, whose world was loaded.

    Attributes:
        scene, prepared: the adapter's; the reduced robot is None in a scene without one.
    """

    def __init__(self, simulator: Any) -> None:
        self.scene, self.prepared = simulator.scene, simulator.prepared

    def all(self) -> dict[str, Any]:
        """Every quantity that the engine tells, by its name."""
        reported = self.world()
        for body in self.scene.bodies:
            reported |= self.body(f"body/{body.name}", body.name)
        if self.prepared is not None:
            robot = self.prepared.robot
            for name in self.prepared.links:
                reported |= self.link(f"link/{name}", name)
            for name in robot.joint_names:
                reported |= self.joint(f"joint/{name}", name)
            for k, points in enumerate(self.closures()):
                reported[f"closure/{k}/points"] = points
            coupled = self.coupled(robot.gripper.couplings)
            reported |= {} if coupled is None else {"gripper/coupled": float(coupled)}
        return reported | self.touches()

    @abstractmethod
    def world(self) -> dict[str, Any]:
        """Gravity, time step, and the ground's quantities."""

    @abstractmethod
    def body(self, prefix: str, name: str) -> dict[str, Any]:
        """The quantities of a body, their names behind the prefix."""

    @abstractmethod
    def link(self, prefix: str, name: str) -> dict[str, Any]:
        """The quantities of a link of the reduced robot; of one that moves with its inertia."""

    @abstractmethod
    def joint(self, prefix: str, name: str) -> dict[str, Any]:
        """The quantities of a driven joint."""

    def closures(self) -> Iterable[FloatArray]:
        """The points of each closure in the frames of its links, (2, 3) each [m]."""
        return ()

    def coupled(self, pairs: tuple[tuple[str, str], ...]) -> bool | None:
        """Whether the fingers of each pair are coupled; None: the engine does not tell."""
        return None

    def can_touch(self, a: str, b: str) -> bool:
        """Whether two of "ground", `body/NAME` and `link/NAME` can collide; of two links, whether
        any of their shapes can."""
        raise NotImplementedError

    def touches(self) -> dict[str, Any]:
        """What can collide with what, by `can_touch`."""
        return touches(self.scene, self.prepared, self.can_touch)


def one_value(values: Any) -> Any:
    """The number that all values are (frictions of a body's shapes, both ends of a force range).

    Where they differ: all of them, as an array (n,), which no scene asks for.
    """
    different = np.unique(values)
    return different[0] if len(different) == 1 else different
