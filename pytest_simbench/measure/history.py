"""The releases of one simulator at one test, in order: what each scored, and where it changed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from pytest_simbench.ground.versions import RELEASE, VersionedName, release_numbers
from pytest_simbench.measure.change_points import ChangePoint, change_points
from pytest_simbench.measure.limits import CRASHED
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.measure.speed import without_speed
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.phenomena import PHENOMENON
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import grouped, series

FEWEST = 3
"""Releases that make a history; two are compared by verdicts."""

COSTS = ("cpu_cost", "ram_peak")
"""Costs of which there is a history: the machine's speed can be taken out of the one, and the other
does not depend on it."""

SMALLEST = 0.1
"""Relative change of a cost that is told. One hour of a machine differs from the next by 4 to 6 %
after its speed is taken out (docs/gate.md), and a release's repetitions share their hour."""


@dataclass(frozen=True)
class Course:
    """One metric over the releases.

    Attributes:
        metric: which.
        values: of each release by seed; empty where no repetition has one.
        changes: supported change points; their places count releases that have values.
    """

    metric: Metric
    values: tuple[Mapping[int, float], ...]
    changes: tuple[ChangePoint, ...] = ()


@dataclass(frozen=True)
class History:
    """One test of one simulator over its releases.

    Attributes:
        simulator: without a version.
        task, test: what was done; the test without its parameters.
        variant: mode and profile, and further parameters of the test.
        releases: versions, oldest first.
        results: of each release.
        courses: of each metric and cost.
    """

    simulator: str
    task: str
    test: str
    variant: str
    releases: tuple[str, ...]
    results: tuple[ResultSet, ...]
    courses: tuple[Course, ...] = field(default=())

    @property
    def identity(self) -> tuple[str, ...]:
        """What tells it from others of its simulator and task."""
        return self.test, self.variant

    @property
    def title(self) -> str:
        return f"{self.simulator}, {self.task} ({self.variant})"

    def sentences(self) -> list[str]:
        """What changed with which release, how much, and how sure; and which releases crashed."""
        found = []
        for course in self.courses:
            present = [v for v, values in zip(self.releases, course.values, strict=True) if values]
            metric = course.metric
            for change in course.changes:
                verb = "fell" if change.after < change.before else "rose"
                found.append(
                    f"{metric.title} {verb} with {present[change.place]}: "
                    f"{metric.format(change.before)} -> {metric.format(change.after)}, "
                    f"p = {change.p_value:.2g}"
                )
        if not found:
            found.append("no change is supported by these repetitions")
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


def histories(records: Iterable[Record], metrics: Mapping[str, Sequence[Metric]]) -> list[History]:
    """The histories in a run: of each simulator with three or more releases, each test but laws.

    Args:
        records: of the run.
        metrics: of each task, by its name.
    """
    of_releases = (r for r in records if VersionedName.of(r.simulator).kind == RELEASE)
    no_laws = (r for r in of_releases if not r.settings.get(PHENOMENON))  # see `law_history`
    found = []
    for task, of_task in grouped(no_laws, lambda r: r.task).items():
        rows: dict[tuple[str, ...], dict[str, list[Record]]] = {}
        for row in series(of_task):
            name, key = VersionedName.of(row.key.simulator), row.key
            place = (name.base, key.mode, key.profile, key.function, key.parameters)
            rows.setdefault(place, {})[name.which] = row.records
        for (base, mode, profile, function, parameters), releases in rows.items():
            if len(releases) >= FEWEST:
                order = tuple(sorted(releases, key=release_numbers))
                sets = tuple(ResultSet(releases[v], metrics.get(task, ())) for v in order)
                variant = " ".join(filter(None, (mode, profile, parameters)))
                found.append(History(base, task, function, variant, order, sets))
    number = sum(len(_courses(history)) for history in found)
    return [replace(h, courses=tuple(_changed(c, number) for c in _courses(h))) for h in found]


def _courses(history: History) -> list[Course]:
    """Each metric, cost and the crashes over the releases; without those that nobody has."""
    results = history.results
    metrics = list(results[-1].metrics.values())
    metrics += [results[-1].metric(name) for name in COSTS if name not in results[-1].metrics]
    courses = [Course(m, tuple(_values(m.name, results, k) for k in range(len(results))))
               for m in metrics]  # fmt: skip
    courses.append(Course(CRASHED, tuple(result.crashed_by_seed() for result in results)))
    return [course for course in courses if any(course.values)]


def _values(name: str, results: Sequence[ResultSet], place: int) -> Mapping[int, float]:
    """A metric of one release by seed; of a cost as on a machine as fast as at the first one."""
    first = next((result for result in results if result.ok), None)
    if first is not None and results[place].ok:
        evened = without_speed(name, first, results[place])
        if evened is not None:
            return evened[1]
    return results[place].by_seed(name)


def _changed(course: Course, rows: int) -> Course:
    present = [values for values in course.values if values]
    found = change_points(present, rows=rows)
    if course.metric.name in COSTS:
        found = [c for c in found if abs(c.after - c.before) > SMALLEST * abs(c.before)]
    return replace(course, changes=tuple(c for c in found if _matters(course.metric, c)))


def _matters(metric: Metric, change: ChangePoint) -> bool:
    """Whether a change is one that means anything, and that a reader sees in three digits: a
    deterministic engine's rounding is significant too."""
    shown = metric.format(change.before) != metric.format(change.after)
    return shown and abs(change.after - change.before) >= metric.smallest_difference
