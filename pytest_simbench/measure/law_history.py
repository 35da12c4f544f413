"""The laws over the releases of one simulator: which release keeps, breaks or misses which.

Laws are no sample (`measure.phenomena`), and one repetition of each is the rule, so there is
nothing to permute. A change is one of size: beyond a tolerance that decides, and by a factor of
two at least. Where there are several repetitions, every one after it must lie beyond every one
before it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from pytest_simbench.ground.versions import BUILD, RELEASE, VersionedName, release_numbers
from pytest_simbench.measure.phenomena import BROKEN, KEPT
from pytest_simbench.records.metrics import significant
from pytest_simbench.records.phenomena import PHENOMENA, PHENOMENON
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import grouped, series

FEWEST = 2
"""Releases that make a history: what changed between two is a fact."""

FACTOR = 2.0
"""By which an error over its tolerance must grow or shrink: a tolerance is a bound (`BROKEN`)."""


@dataclass(frozen=True)
class Reached:
    """What a release made of a law.

    Attributes:
        least, most: error over tolerance, of all repetitions; infinite where one failed.
        errors: of each repetition, in the law's unit.
        message: of a repetition that failed; empty where none did.
    """

    least: float
    most: float
    errors: tuple[float, ...] = ()
    message: str = ""

    @classmethod
    def of(cls, records: Sequence[Record]) -> Reached:
        ratios = [r.metrics.get("ratio") if r.ok else None for r in records]
        known = [math.inf if ratio is None else ratio for ratio in ratios]
        errors = [error for r in records if r.ok and (error := r.metrics.get("error")) is not None]
        failures = [r.error for r in records if r.error]
        message = f"{failures[0].type}: {failures[0].message}" if failures else ""
        return cls(min(known), max(known), tuple(errors), message)


@dataclass(frozen=True)
class Row:
    """One law over the releases.

    Attributes:
        name: of the law.
        phenomenon: that it is of.
        reached: by each release; None where it was not asked.
    """

    name: str
    phenomenon: str
    reached: tuple[Reached | None, ...]

    def changes(self) -> Iterator[tuple[int, Reached, Reached]]:
        """The places of releases that changed it, what was before, and what they reached."""
        before: Reached | None = None
        for place, now in enumerate(self.reached):
            if now is None:
                continue
            if before is None or _worse(before, now) or _worse(now, before):
                if before is not None:
                    yield place, before, now
                before = now


@dataclass(frozen=True)
class LawHistory:
    """All laws of a test over the releases of one simulator.

    Attributes:
        simulator: without a version.
        test: without its parameters.
        variant: mode and profile.
        releases: versions, oldest first; then builds, with an `@` before their names.
        laws: in the order of their phenomena.
    """

    simulator: str
    test: str
    variant: str
    releases: tuple[str, ...]
    laws: tuple[Row, ...]
    task: str = "laws"

    @property
    def identity(self) -> tuple[str, ...]:
        """What tells it from others of its simulator."""
        return self.test, self.variant

    @property
    def title(self) -> str:
        return f"{self.simulator}, {len(self.laws)} laws ({self.variant})"

    def sentences(self) -> list[str]:
        """What each release changed, in words; what all keep and miss; which changed nothing."""
        found = []
        for place, release in enumerate(self.releases):
            changed = [
                _told(law.name, before, now)
                for law in self.laws
                for at, before, now in law.changes()
                if at == place
            ]
            if changed:
                found.append(f"{release}: {'; '.join(changed)}")
        if not found:
            found.append("no release changed a law")
        if alike := [v for k, v in enumerate(self.releases) if k and self._alike(k)]:
            found.append(f"not one reading changed, to the last bit, with {', '.join(alike)}")
        kept = [law for law in self.laws if all(r is None or r.most <= KEPT for r in law.reached)]
        missed = [law.name for law in self.laws
                  if all(r is None or r.least > BROKEN for r in law.reached)]  # fmt: skip
        found.append(f"kept by all: {len(kept)} of {len(self.laws)} laws")
        if missed:
            found.append(f"broken by all: {', '.join(missed)}")
        return found

    def _alike(self, place: int) -> bool:
        """Whether a release reads as the one before it on all laws."""
        pairs = [(law.reached[place - 1], law.reached[place]) for law in self.laws]
        return all(a and b and a.errors and a.errors == b.errors for a, b in pairs)


def law_histories(records: Iterable[Record]) -> list[LawHistory]:
    """The histories of laws in a run: of each simulator with two or more releases and builds."""
    versions = (r for r in records if VersionedName.of(r.simulator).kind)
    by_law = grouped((r for r in versions if r.settings.get(PHENOMENON)), lambda r: r.task)
    places: dict[tuple[str, ...], dict[tuple[str, str], dict[str, list[Record]]]] = {}
    for law, of_law in by_law.items():
        for row in series(of_law):
            name, key = VersionedName.of(row.key.simulator), row.key
            laws = places.setdefault((name.base, key.function, key.mode, key.profile), {})
            label = name.which if name.kind == RELEASE else f"{BUILD}{name.which}"
            laws.setdefault((law, key.parameters), {})[label] = row.records
    found = []
    for (base, function, mode, profile), laws in places.items():
        known = {label for row in laws.values() for label in row}
        releases = sorted(known, key=lambda label: (label[0] == BUILD, release_numbers(label)))
        if len(releases) >= FEWEST:
            rows = [_row(law, laws, releases) for law in laws]
            rows.sort(key=lambda row: _order(row.phenomenon))
            variant = f"{mode} {profile}"
            found.append(LawHistory(base, function, variant, tuple(releases), tuple(rows)))
    return found


def _row(
    law: tuple[str, str],
    laws: dict[tuple[str, str], dict[str, list[Record]]],
    releases: Sequence[str],
) -> Row:
    name, parameters = law
    of_release = laws[law]
    alone = sum(other == name for other, _ in laws) == 1
    phenomenon = next(iter(of_release.values()))[0].settings[PHENOMENON]
    return Row(
        name if alone else f"{name} [{parameters}]",
        str(phenomenon),
        tuple(Reached.of(of_release[v]) if v in of_release else None for v in releases),
    )


def _order(phenomenon: str) -> int:
    return PHENOMENA.index(phenomenon) if phenomenon in PHENOMENA else len(PHENOMENA)


def _worse(better: Reached, worse: Reached) -> bool:
    """Whether the one decides against a release, and the other is better by `FACTOR`."""
    if math.isinf(better.most):
        return False
    return worse.least > BROKEN and worse.least >= FACTOR * better.most


def _told(law: str, before: Reached, now: Reached) -> str:
    sizes = f"({times(before)} -> {times(now)})"
    if math.isinf(now.most):
        return f"{law} fails ({times(before)} before): {now.message[:200]}"
    if now.most <= KEPT:
        return f"{law} is kept {sizes}"
    if before.most <= KEPT:
        return f"{law} is broken {sizes}"
    return f"{law} is missed by {'more' if _worse(before, now) else 'less'} {sizes}"


def times(reached: Reached) -> str:
    """Error over tolerance, the worst of the repetitions, for people."""
    return "fails" if math.isinf(reached.most) else f"{significant(reached.most, 2)}x"
