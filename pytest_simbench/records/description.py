"""What the numbers of a task mean, as a run folder and a saved benchmark tell it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from math import isfinite
from typing import Any, Protocol, Self

from pytest_simbench.records import checked
from pytest_simbench.records.checked import Name
from pytest_simbench.records.metrics import COSTS, CRASHED, Metric
from pytest_simbench.records.record import plain

SCHEMA = 1


class FolderLine:
    """A dataclass that is a line of a file of the run folder."""

    def to_dict(self) -> dict[str, Any]:
        """Plain data; numbers that JSON does not have are None."""
        found: dict[str, Any] = plain({"schema": SCHEMA, **asdict(self)})  # type: ignore[call-overload]
        return found

    @classmethod
    def from_dict(cls, data: Any, where: str = "line") -> Self:
        """What `data` hold; `where` names them in messages.

        Raises:
            CheckError: a part is missing or of the wrong type, or the schema is a newer one.
        """
        try:
            checked.schema(data, SCHEMA)
            whole = checked.plain(data)
            return checked.convert({k: v for k, v in whole.items() if v is not None}, cls)
        except checked.CheckError as error:
            raise checked.CheckError(f"{where}: {error}") from None


class Describing(Protocol):
    """What can be described: a task."""

    @property
    def name(self) -> str: ...

    @property
    def metrics(self) -> tuple[Metric, ...]: ...

    @property
    def references(self) -> Mapping[str, float]: ...


@dataclass(frozen=True)
class TaskDescription(FolderLine):
    """What a task's metrics and references mean.

    Attributes:
        metrics: what it measures, in the order of its tables.
        references: the value of a perfect simulator, by metric.

    Raises:
        ValueError: two metrics of one name.
    """

    task: Name
    metrics: tuple[Metric, ...]
    references: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if len({metric.name for metric in self.metrics}) < len(self.metrics):
            raise ValueError("two of the metrics have one name")

    @classmethod
    def of(cls, task: Describing) -> TaskDescription:
        """What a task says of itself; a reference that is no finite number is none.

        Raises:
            ValueError: a metric has the name of one that every task has.
        """
        every = {metric.name for metric in (*COSTS, CRASHED)}
        if taken := [metric.name for metric in task.metrics if metric.name in every]:
            raise ValueError(f"{task.name}: every task has a metric {taken[0]!r}; rename this one")
        known = {name: value for name, value in task.references.items() if isfinite(value)}
        return cls(task.name, tuple(task.metrics), known)


def by_task(descriptions: Iterable[TaskDescription]) -> dict[str, TaskDescription]:
    """What tests say of each task together; where they differ, the last one holds."""
    found: dict[str, TaskDescription] = {}
    for said in descriptions:
        known = found.setdefault(said.task, said)
        metrics = {metric.name: metric for metric in (*known.metrics, *said.metrics)}
        references = {**known.references, **said.references}
        found[said.task] = TaskDescription(said.task, tuple(metrics.values()), references)
    return found


@dataclass(frozen=True)
class Threshold(FolderLine):
    """A threshold that a test asked for.

    Attributes:
        metric: as the test named it.
        value: what it got: its own, or that of `--sim-threshold`.
    """

    test: Name
    metric: Name
    value: float
