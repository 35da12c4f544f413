"""What running a seed again gave: the same, or when and how far it parted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pytest_simbench.records.metrics import significant
from pytest_simbench.repeatability.episode import Episode
from pytest_simbench.repeatability.motions import Difference


@dataclass(frozen=True)
class Again:
    """One way of running again, and what came of it.

    Attributes:
        way: what was done in between, for tables.
        difference: where it parted from the first run; None: nowhere.
        changed: counts of the task's outcome that are not the same.
        left_at: when the task no longer asked for what the tape has next [s].
        skipped: why it was not run, "" when it was.
        failure: the error that ended it, "" when there was none.
        claimed: whether the adapter claims that this way gives the same.
    """

    way: str
    difference: Difference | None = None
    changed: tuple[str, ...] = ()
    left_at: float | None = None
    skipped: str = ""
    failure: str = ""
    claimed: bool = True

    @property
    def identical(self) -> bool:
        """Whether it ran and every bit was the same."""
        return not (self.skipped or self.failure or self.difference)

    @property
    def text(self) -> str:
        """The result in words."""
        if self.skipped or self.failure:
            return self.skipped or self.failure
        if self.difference is None:
            return "bit-identical"
        d = self.difference
        growth = ", ".join(
            f"{significant(1000 * gap)} mm {after:g} s later"
            for after, gap in d.growth.items()
            if gap is not None
        )
        what = f"first differs at t = {d.first:.2f} s"
        what += f" ({d.body})" if d.body else " (robot)"
        what += f", then {growth}" if growth else ""
        what += f", {significant(1000 * d.largest)} mm at most"
        return what + (f"; changed {', '.join(self.changed)}" if self.changed else "")

    def to_wire(self) -> dict[str, Any]:
        """Plain data, `records.repeatability.Way`."""
        own = {**vars(self), "identical": self.identical, "changed": list(self.changed)}
        found = own.pop("difference")
        if found is None:
            return {**own, **dict.fromkeys(("first", "body", "growth", "largest"))}
        growth = {f"{after:g}": gap for after, gap in found.growth.items()}
        return {**own, **vars(found), "growth": growth}

    @classmethod
    def from_wire(cls, data: Mapping[str, Any]) -> Again:
        found = None
        if data["first"] is not None:
            growth = {float(after): gap for after, gap in data["growth"].items()}
            found = Difference(data["first"], data["body"], growth, data["largest"])
        own = {key: data[key] for key in ("way", "left_at", "skipped", "failure")}
        return cls(
            **own, difference=found, changed=tuple(data["changed"]),
            claimed=data.get("claimed", True),
        )  # fmt: skip


@dataclass(frozen=True)
class Replay:
    """All ways of running one seed again in one simulator.

    Attributes:
        simulator: its name.
        claims: whether its adapter claims that it is deterministic.
        first: the run that the others are compared with.
        again: the ways, with their results.
    """

    simulator: str
    claims: bool
    first: Episode
    again: tuple[Again, ...]

    def to_wire(self) -> dict[str, Any]:
        """Plain data for the run's records."""
        return {
            "claims": self.claims,
            "counts": dict(self.first.counts),
            "again": [again.to_wire() for again in self.again],
        }

    def assert_as_claimed(self) -> None:
        """Raise AssertionError when a way that is claimed to give the same does not, or when the
        simulator could not run again what it ran before.

        Claimed are, with the capability `deterministic`, all ways but those that restore a state,
        and with `exact_restore` those.
        """
        bad = [
            f"{again.way}: {again.text}"
            for again in self.again
            if again.failure or (again.claimed and not again.identical and not again.skipped)
        ]
        if bad:
            head = "claims to be deterministic, but" if self.claims else "could not run again"
            raise AssertionError(f"{self.simulator} {head}\n  " + "\n  ".join(bad))
