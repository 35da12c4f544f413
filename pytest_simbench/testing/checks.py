"""The list of checks: name, law, the capability each needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pytest_simbench.scene import Robot
from pytest_simbench.simulator import Capability
from pytest_simbench.testing.subject import Subject

Law = Callable[[Subject], None]

Unfit = Callable[[Robot], str | None]
"""Why a law cannot be asked of a robot, or None, see `testing.robots`."""


@dataclass(frozen=True)
class Check:
    """One law of the kit.

    Attributes:
        name: its function's name, part of the test's id.
        law: raises `ConformanceFailure` when the adapter breaks it.
        needs: the capability without which it is skipped.
        robot: for which robots it is skipped, and why; None of a law about no robot, or about a
            robot of its own.
    """

    name: str
    law: Law
    needs: Capability | None = None
    robot: Unfit | None = None

    @property
    def doc(self) -> str:
        return (self.law.__doc__ or "").strip()


CHECKS: dict[str, Check] = {}
"""All checks by name, in the order in which they were defined."""


def check(needs: Capability | None = None, robot: Unfit | None = None) -> Callable[[Law], Law]:
    """Add a function to `CHECKS` under its own name."""

    def add(law: Law) -> Law:
        name = getattr(law, "__name__", "")
        CHECKS[name] = Check(name, law, needs, robot)
        return law

    return add
