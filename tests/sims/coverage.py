"""Changes that are planted in a loaded world, and which quantities none of them changes."""

from __future__ import annotations

from collections.abc import Iterable

from pytest_simbench.testing.faults import FAULTS


def pattern(quantity: str) -> str:
    """`body/cube/mass` as `body/*/mass`."""
    kind, _, rest = quantity.partition("/")
    return f"{kind}/*/{rest.rpartition('/')[2]}" if "/" in rest else quantity


def uncovered(
    reported: Iterable[str], planted: Iterable[str], impossible: Iterable[str] = ()
) -> set[str]:
    """Patterns of what is reported, but neither changed by the kit's faults nor by `planted`.

    No link is round, so none is asked for.
    """
    kit = {fault.quantity for fault in FAULTS.values()}
    found = {pattern(quantity) for quantity in [*kit, *planted]}
    return {pattern(q) for q in reported} - found - set(impossible) - {"link/*/rounds"}
