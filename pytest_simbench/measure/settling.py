"""Where a scene's bodies end in each simulator, beside the noise of the scene itself.

One trajectory is no verdict: before two simulators or releases are called different, the start is
moved a little within each, and the time step made finer.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.records.record import Record
from pytest_simbench.records.series import Configured, configured, grouped, settled

TASK = "settling"
"""The task whose records these are (`tasks.settling`)."""

ALIKE = 1.0
"""Two ends are alike where no body lies farther apart [mm]: what tables print of a length."""


@dataclass(frozen=True)
class Ends:
    """Where the bodies of some repetitions ended.

    Attributes:
        places: of the bodies' origins [mm], (repetitions, bodies, 3).
        starts: number of the stored start of each, (repetitions,); 0 where there are none.
        crashed: how many repetitions besides did not finish.
        premises: share of the premises that hold, mean of the repetitions; None without any.
    """

    places: NDArray[np.float64]
    starts: NDArray[np.int64]
    crashed: int
    premises: float | None

    @property
    def means(self) -> dict[int, NDArray[np.float64]]:
        """By start, (bodies, 3): ends of different starts are never held against each other."""
        numbers = np.unique(self.starts).tolist()
        return {k: self.places[self.starts == k].mean(axis=0) for k in numbers}


@dataclass(frozen=True)
class Settled:
    """One scene, and its free bodies by name, in several simulators.

    Attributes:
        written: of each simulator what became of the scene as it is written.
        moved: the same with starts moved by at most so much [m], smallest first.
        finer: the same with time steps so many times as fine.
        cost: CPU seconds for a simulated second, of the scene as it is written.
    """

    scene: str
    bodies: Sequence[str]
    written: Mapping[Configured, Ends]
    moved: Mapping[float, Mapping[Configured, Ends]]
    finer: Mapping[int, Mapping[Configured, Ends]]
    cost: Mapping[Configured, float | None]

    def only(self, chosen: Sequence[Configured]) -> Settled:
        """The same of some simulators alone."""

        def among(ends: Mapping[Configured, Ends]) -> dict[Configured, Ends]:
            return {who: ends[who] for who in chosen if who in ends}

        return replace(
            self,
            written=among(self.written),
            moved={amount: among(ends) for amount, ends in self.moved.items()},
            finer={times: among(ends) for times, ends in self.finer.items()},
        )

    def apart(self, a: Ends, b: Ends) -> tuple[float, str]:
        """How far apart the body lies that two ends have farthest apart [mm], and its name; nan
        where they have no start in common: nobody knows."""
        first, second = a.means, b.means
        gaps = [np.linalg.norm(first[k] - second[k], axis=1) for k in first.keys() & second.keys()]
        widest = np.max(gaps, axis=0) if gaps else np.full(len(self.bodies), np.nan)
        worst = int(widest.argmax())
        return float(widest[worst]), self.bodies[worst]

    def noise(self, who: Configured, moved: float) -> float | None:
        """How far any body ends from where it ends as written, with starts moved by so much [mm];
        None where that was not tried, or none of them ended."""
        own, others = self.written[who], self.moved.get(moved, {}).get(who)
        if others is None:
            return None
        means = own.means
        ways = [
            float(np.linalg.norm(place - means[start], axis=1).max())
            for place, start in zip(others.places, others.starts.tolist(), strict=True)
            if start in means
        ]
        return max(ways, default=None)

    def change(self, who: Configured, finer: int) -> float | None:
        """How far any body ends from where it ends as written, with a step so many times as fine
        [mm]; None where that was not tried, or they have no start in common."""
        other = self.finer.get(finer, {}).get(who)
        gap = math.nan if other is None else self.apart(self.written[who], other)[0]
        return None if math.isnan(gap) else gap

    def places(self, ends: Mapping[Configured, Ends]) -> list[list[Configured]]:
        """Simulators by where the bodies end: two that are alike are in one group, also through a
        third one. The largest group comes first."""
        groups: list[list[Configured]] = []
        for who in (who for who, found in ends.items() if len(found.places)):
            near = [g for g in groups if any(self._alike(ends, who, other) for other in g)]
            groups = [g for g in groups if g not in near]
            groups.append([*(other for g in near for other in g), who])
        return sorted(groups, key=len, reverse=True)

    def _alike(self, ends: Mapping[Configured, Ends], a: Configured, b: Configured) -> bool:
        return self.apart(ends[a], ends[b])[0] <= ALIKE

    def tried(self, a: Configured, b: Configured) -> float | None:
        """The largest move of the start of which both have an end [m]; None where there is none:
        nobody knows what a moved start does."""
        known = [m for m in self.moved if None not in (self.noise(a, m), self.noise(b, m))]
        return max(known, default=None)

    def explained(self, a: Configured, b: Configured) -> float | None:
        """The smallest tried move of the start that moves an end of one of two simulators as far as
        theirs are apart [m]; None where no move does, which is known as far as they were `tried`.
        """
        gap = self.apart(self.written[a], self.written[b])[0]
        for moved in self.moved:
            if max(self.noise(who, moved) or 0.0 for who in (a, b)) >= gap:
                return moved
        return None


def settlings(records: Iterable[Record]) -> list[Settled]:
    """The scenes of a run that were left to themselves in two simulators at least, or moved; those
    of one name have the name of their test, too."""
    own = [record for record in settled(records) if record.task == TASK]
    scenes = [(s[0], made) for s in grouped(own, _scene).values() if (made := _settled(s))]
    names = [made.scene for _, made in scenes]
    found = []
    for first, made in scenes:
        if names.count(made.scene) > 1:
            test = f"{first.function.rpartition('::')[2]} {first.variant}".rstrip()
            made = replace(made, scene=f"{made.scene} ({test})")
        found.append(made)
    return found


def _scene(record: Record) -> tuple[object, ...]:
    """What scene it is; starts that were moved are the same scene."""
    keys = ("task.scene_digest", "task.seconds", "task.starts")
    return (record.settings.get("task.scene"), *(record.settings.get(key) for key in keys))


def _settled(records: Sequence[Record]) -> Settled | None:
    done = next((record for record in records if record.ok and "places" in record.details), None)
    if done is None:
        return None
    bodies = list(done.details["places"])
    written: dict[Configured, Ends] = {}
    moved: dict[float, dict[Configured, Ends]] = {}
    finer: dict[int, dict[Configured, Ends]] = {}
    cost: dict[Configured, float | None] = {}
    for who, own in configured(records, _start_and_step).items():
        groups = grouped(own, _start_and_step)
        steps = [step for amount, step in groups if not amount]
        for (amount, step), group in groups.items() if steps else ():
            ends, times = _ends(group, bodies), round(max(steps) / step) if step else 1
            if amount:
                moved.setdefault(amount, {})[who] = ends
            elif times > 1:
                finer.setdefault(times, {})[who] = ends
            else:
                written[who] = ends
                cost[who] = next((c for r in group if (c := r.cost("cpu_cost")) is not None), None)
    written = {who: ends for who, ends in written.items() if len(ends.places)}
    if not written or (len(written) < 2 and not moved):
        return None
    return Settled(
        str(done.settings.get("task.scene")), bodies, written,
        dict(sorted(moved.items())), dict(sorted(finer.items())), cost,
    )  # fmt: skip


def _ends(records: Sequence[Record], bodies: Sequence[str]) -> Ends:
    places, starts = [], []
    for record in records:
        told = record.details.get("places")
        if record.ok and isinstance(told, Mapping) and list(told) == list(bodies):
            places.append([np.multiply(told[name][:3], 1000.0) for name in bodies])
            starts.append(record.seed % int(record.settings.get("task.starts") or 1))
    shares = [record.metrics.get("premises") for record in records if record.ok]
    known = [share for share in shares if share is not None]
    return Ends(
        np.array(places, dtype=float).reshape(-1, len(bodies), 3),
        np.array(starts, dtype=int),
        sum(record.status == "failed" for record in records),
        float(np.mean(known)) if known else None,
    )


def _start_and_step(record: Record) -> tuple[float, float]:
    """By how much the start was moved, and the time step."""
    moved, step = (record.settings.get(key) for key in ("task.moved", "timestep"))
    return float(moved or 0.0), float(step or 0.0)
