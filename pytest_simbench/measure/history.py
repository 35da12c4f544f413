"""The releases of one simulator, in order: what each scored, and where it changed.

Laws are no sample (`measure.phenomena`), and one repetition of each is the rule, so there is
nothing to permute. A change of a law is one of size: beyond a tolerance that decides, and by a
factor of two at least. Where there are several repetitions, every one after it must lie beyond
every one before it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

from pytest_simbench.ground.versions import BUILD, RELEASE, VersionedName, release_numbers
from pytest_simbench.measure.change_points import ChangePoint, change_points, steps
from pytest_simbench.measure.phenomena import BROKEN, KEPT
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.measure.speed import without_speed
from pytest_simbench.records.metrics import CRASHED, Metric, significant
from pytest_simbench.records.phenomena import PHENOMENON, ordered
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import RowKey, grouped, labels, series

FEWEST = 3
"""Releases that make a history of a task; two are compared by verdicts."""

COSTS = ("cpu_cost", "ram_peak")
"""Costs of which there is a history: the machine's speed can be taken out of the one, and the other
does not depend on it."""

SMALLEST = 0.1
"""Relative change of a cost that is told. One hour of a machine differs from the next by 4 to 6 %
after its speed is taken out (docs/gate.md), and a release's repetitions share their hour."""

FEWEST_OF_LAWS = 2
"""Releases that make a history of laws: what changed between two is a fact."""

FACTOR = 2.0
"""By which an error over its tolerance must grow or shrink: a tolerance is a bound (`BROKEN`)."""

CLOSE = 0.1
"""Of a tolerance: where both releases are as close to a law, nothing is told of it."""


@dataclass(frozen=True)
class History:
    """A test of a simulator over its releases.

    Attributes:
        simulator: without a version.
        task, test: what was done; the test without its parameters.
        variant: mode and profile, and further parameters of the test.
        releases: versions, oldest first; then builds, with an `@` before their names.
    """

    simulator: str
    task: str
    test: str
    variant: str
    releases: tuple[str, ...]

    @property
    def title(self) -> str:
        return f"{self.simulator}, {self.task} ({self.variant})"

    def sentences(self) -> list[str]:
        """What each release changed, in words."""
        raise NotImplementedError


@dataclass(frozen=True)
class MetricCourse:
    """One metric over the releases.

    Attributes:
        values: of each release by seed; empty where no repetition has one.
        changes: supported change points; their places count releases that have values.
        shown: whether a supported change shows in print, told or too small for that.
    """

    metric: Metric
    values: tuple[Mapping[int, float], ...]
    changes: tuple[ChangePoint, ...] = ()
    shown: bool = False


@dataclass(frozen=True)
class TaskHistory(History):
    """A task over the releases: the results of each, and the courses of each metric and cost."""

    results: tuple[ResultSet, ...]
    courses: tuple[MetricCourse, ...] = field(default=())

    def sentences(self) -> list[str]:
        """What changed with which release, how much, and how sure; what some releases have no value
        of; and which releases crashed."""
        found = []
        for course in self.courses:
            sides = zip(self.releases, self.results, course.values, strict=True)
            if absent := [v for v, result, values in sides if result.ok and not values]:
                found.append(f"{course.metric.title} has no value with {', '.join(absent)}")
            present = [v for v, values in zip(self.releases, course.values, strict=True) if values]
            metric = course.metric
            for change in course.changes:
                verb = "fell" if change.after < change.before else "rose"
                p = change.p_value
                found.append(
                    f"{metric.title} {verb} with {present[change.place]}: "
                    f"{metric.format(change.before)} -> {metric.format(change.after)}, "
                    + (f"p = {p:.2g}" if p else "every repetition is the same")
                )
        if not found:
            small = ", ".join(course.metric.title for course in self.courses if course.shown)
            what = f"only small changes of {small} are" if small else "no change is"
            found.append(f"{what} supported by these repetitions")
        for release, result in zip(self.releases, self.results, strict=True):
            if result.crashed:
                cause, records = next(iter(result.causes().items()))
                total = len(result.ok) + len(result.crashed)
                message = records[0].error.message if records[0].error else ""
                found.append(
                    f"{release}: {len(result.crashed)} of {total} repetitions crashed, most often "
                    f"{cause}: {message[:200]}"
                )
        return found


def by_release(records: Iterable[Record]) -> dict[tuple[str, RowKey], dict[str, list[Record]]]:
    """The rows of each task by the release or build that they are of. What all releases of a
    simulator have in common is their task, and their key with the simulator's name alone and, among
    its parameters, what tells apart the rows that one release has of it."""
    found: dict[tuple[str, RowKey], dict[str, list[Record]]] = {}
    for task, of_task in grouped(records, lambda r: r.task).items():
        rows = grouped(
            series(of_task), lambda row: (VersionedName.of(row.key.simulator).base, *row.key[1:])
        )
        for alike in rows.values():
            releases = [*grouped(alike, lambda row: row.key.simulator).values()]
            told = labels([[row.records for row in of_one] for of_one in releases])
            for row, more in zip(chain(*releases), chain(*told), strict=True):
                name = VersionedName.of(row.key.simulator)
                label = name.which if name.kind == RELEASE else f"{BUILD}{name.which}"
                parameters = " ".join(filter(None, (row.key.parameters, more)))
                key = row.key._replace(simulator=name.base, parameters=parameters)
                found.setdefault((task, key), {})[label] = row.records
    return found


def histories(
    records: Iterable[Record], metrics: Mapping[str, Sequence[Metric]]
) -> list[TaskHistory]:
    """The histories in a run: of each simulator with three or more releases, each test but laws,
    by the metrics of each task."""
    of_releases = (r for r in records if VersionedName.of(r.simulator).kind == RELEASE)
    rows = by_release(r for r in of_releases if not r.settings.get(PHENOMENON))
    found = []
    for (task, key), releases in rows.items():
        if len(releases) >= FEWEST:
            order = tuple(sorted(releases, key=release_numbers))
            sets = tuple(ResultSet(releases[v], metrics.get(task, ())) for v in order)
            variant = " ".join(filter(None, (key.mode, key.profile, key.parameters)))
            found.append(TaskHistory(key.simulator, task, key.function, variant, order, sets))
    number = sum(len(_courses(history)) for history in found)
    return [replace(h, courses=tuple(_changed(c, number, h) for c in _courses(h))) for h in found]


def _courses(history: TaskHistory) -> list[MetricCourse]:
    """Each metric, cost and the crashes over the releases; without those that nobody has."""
    results = history.results
    metrics = list(results[-1].metrics.values())
    metrics += [results[-1].metric(name) for name in COSTS if name not in results[-1].metrics]
    first = next((result for result in results if result.ok), results[0])
    courses = (
        MetricCourse(metric, tuple(_values(metric, first, result) for result in results))
        for metric in (*metrics, CRASHED)
    )
    return [course for course in courses if any(course.values)]


def _values(metric: Metric, first: ResultSet, result: ResultSet) -> Mapping[int, float]:
    """A metric of one release by seed; of a cost as on a machine as fast as at the first one."""
    even = without_speed(metric.name, first, result)
    return result.by_seed(metric) if even is None else even[1]


def _changed(course: MetricCourse, rows: int, history: TaskHistory) -> MetricCourse:
    present = [values for values in course.values if values]
    sides = zip(history.results, course.values, strict=True)
    sole = all(result.sole(course.metric) for result, values in sides if values)
    found = steps(present) if sole else change_points(present, rows=rows)
    metric, told, shown, moved = course.metric, list[ChangePoint](), False, 0.0
    least = SMALLEST if metric.name in COSTS else 0.0
    for change in found:  # held against the last one told, or a little with each would be nothing
        before, after = change.before - moved, change.after
        moved = after - before
        if abs(moved) > least * abs(before) and metric.differs(before, after):
            told.append(replace(change, before=before))
            moved = 0.0
        shown = shown or metric.format(before) != metric.format(after)
    return replace(course, changes=tuple(told), shown=shown)


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
class LawRow:
    """One law, of a phenomenon, and what each release reached; None where it was not asked."""

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
class LawHistory(History):
    """All laws of a test over the releases, in the order of their phenomena."""

    laws: tuple[LawRow, ...]

    @property
    def title(self) -> str:
        return f"{self.simulator}, {len(self.laws)} laws ({self.variant})"

    def changed(self, release: str) -> list[str]:
        """What one release changed, law by law."""
        return [
            _told(law.name, before, now)
            for law in self.laws
            for place, before, now in law.changes()
            if self.releases[place] == release
        ]

    def _sides(self, old: str, new: str) -> list[tuple[str, Reached | None, Reached | None]]:
        """What two releases, which may have run none, reached, by the names of the laws."""
        rows = [(law.name, dict(zip(self.releases, law.reached, strict=True))) for law in self.laws]
        return [(name, of.get(old), of.get(new)) for name, of in rows]

    def lost(self, old: str, new: str) -> list[str]:
        """Laws that the old release keeps and the new one did not run."""
        sides = self._sides(old, new)
        return [name for name, before, now in sides if before and not now and before.most <= KEPT]

    def moved(self, old: str, new: str) -> list[str]:
        """Laws that two releases keep, one of them `FACTOR` times as closely."""
        return [
            f"{name} ({times(before)} -> {times(now)})"
            for name, before, now in self._sides(old, new)
            if before
            and now
            and KEPT >= max(before.most, now.most) > CLOSE
            and max(before.least, now.least) >= FACTOR * min(before.most, now.most)
        ]

    def sentences(self) -> list[str]:
        """The same; then what all keep and miss, and which changed nothing."""
        told = {release: self.changed(release) for release in self.releases}
        found = [f"{release}: {'; '.join(changed)}" for release, changed in told.items() if changed]
        if not found:
            found.append("no release changed a law")
        if alike := [v for k, v in enumerate(self.releases) if k and self._alike(k)]:
            found.append(f"not one reading changed, to the last bit, with {', '.join(alike)}")
        kept = [law for law in self.laws if all(r is None or r.most <= KEPT for r in law.reached)]
        missed = [law.name for law in self.laws
                  if all(r is None or r.least > BROKEN for r in law.reached)]  # fmt: skip
        ran = " that ran it" if any(None in law.reached for law in self.laws) else ""
        found.append(f"kept by all{ran}: {len(kept)} of {len(self.laws)} laws")
        if missed:
            found.append(f"broken by all{ran}: {', '.join(missed)}")
        return found

    def _alike(self, place: int) -> bool:
        """Whether a release reads as the one before it on all laws."""
        pairs = [(law.reached[place - 1], law.reached[place]) for law in self.laws]
        return all(a and b and a.errors and a.errors == b.errors for a, b in pairs)


def law_histories(records: Iterable[Record], fewest: int = FEWEST_OF_LAWS) -> list[LawHistory]:
    """The histories of laws in a run: of each simulator with so many releases and builds."""
    versions = (r for r in records if VersionedName.of(r.simulator).kind)
    ended = (r for r in versions if r.status != "interrupted")
    every = by_release(r for r in ended if r.settings.get(PHENOMENON))
    found = []
    for of, laws in grouped(every, lambda at: at[1]._replace(parameters="")).items():
        known = {label for law in laws for label in every[law]}
        releases = sorted(known, key=lambda label: (label[0] == BUILD, release_numbers(label)))
        if len(releases) >= fewest:
            tasks = [task for task, _ in laws]
            rows = [
                LawRow(
                    task if tasks.count(task) == 1 else f"{task} [{key.parameters}]",
                    str(next(iter(of_release.values()))[0].settings[PHENOMENON]),
                    tuple(Reached.of(of_release[v]) if v in of_release else None for v in releases),
                )
                for task, key in laws
                for of_release in [every[task, key]]
            ]
            places = ordered(row.phenomenon for row in rows)
            rows.sort(key=lambda row: places.index(row.phenomenon))
            variant = f"{of.mode} {of.profile}"
            told = of.simulator, "laws", of.function, variant, tuple(releases), tuple(rows)
            found.append(LawHistory(*told))
    return found


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
