"""Which simulators are known, and which of them are here."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from importlib.metadata import EntryPoint, entry_points

from pytest_simbench.simulator.base import Simulator
from pytest_simbench.simulator.errors import SimulatorError

GROUP = "pytest_simbench.simulators"
"""Entry-point group in which adapters register, `name = "package.module:Class"`."""


class UnknownSimulatorError(SimulatorError):
    """A simulator's name that nobody registered."""


@cache
def registered() -> dict[str, EntryPoint]:
    """Entry points of all adapters by simulator name, sorted."""
    return {entry.name: entry for entry in sorted(entry_points(group=GROUP), key=lambda e: e.name)}


def check_names(names: Iterable[str]) -> None:
    """Raise `UnknownSimulatorError` for the first name that is not registered."""
    for name in names:
        if name not in registered():
            raise UnknownSimulatorError(
                f"unknown simulator {name!r}; choose from {', '.join(registered())}, or all"
            )


@cache
def adapter(name: str) -> type[Simulator]:
    """The adapter class of a simulator. Its engine is not imported.

    Raises:
        UnknownSimulatorError: the message lists the known names.
        SimulatorError: the adapter's own module does not import.
    """
    check_names([name])
    entry = registered()[name]
    try:
        cls = entry.load()
    except Exception as error:
        raise SimulatorError(
            f"the adapter of {name} ({entry.value}) does not import: "
            f"{type(error).__name__}: {error}"
        ) from error
    if not (isinstance(cls, type) and issubclass(cls, Simulator)):
        raise SimulatorError(f"{entry.value}, registered as {name}, is no Simulator subclass")
    return cls
