"""Adapters that plant a fault in a loaded world, for engines in interpreters of their own.

Workers load them from `ENGINE_faults.py`, so this module imports nothing but the contract.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, make_dataclass
from typing import Any, ClassVar

from pytest_simbench.scene import Scene
from pytest_simbench.simulator import Settings

Plant = Callable[[Any], None]
"""Changes a quantity in the engine of a loaded simulator, behind the adapter's back."""


class Planting:
    """To be put before an adapter among the bases. Its settings have `fault` besides, the quantity
    in which a fault is planted, "" for none; several have `;` between them.

    Attributes:
        faults: by quantity.
    """

    faults: ClassVar[Mapping[str, Plant]]
    profiles: ClassVar[Mapping[str, Settings]]
    settings: Any

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.profiles = {name: _with_fault(settings) for name, settings in cls.profiles.items()}

    def load(self, scene: Scene) -> None:
        super().load(scene)
        for quantity in filter(None, self.settings.fault.split(";")):
            self.faults[quantity](self)


def _with_fault(settings: Settings) -> Settings:
    values = {f.name: getattr(settings, f.name) for f in fields(settings)}
    kind = make_dataclass("Faulty", [("fault", str, "")], bases=(type(settings),), frozen=True)
    return kind(**values)
