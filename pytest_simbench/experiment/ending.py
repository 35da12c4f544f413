"""What a repetition came to: its status, what ended it, and whether its outcome can be read."""

from __future__ import annotations

from pytest_simbench.client.errors import Interrupted, Where, WorkerError
from pytest_simbench.records.checked import LARGEST, short
from pytest_simbench.records.metrics import UnknownMetric
from pytest_simbench.records.record import Failure, Record, RecordError, Status
from pytest_simbench.tasks.base import Task
from pytest_simbench.worker.wire import LONGEST, readable, told

__tracebackhide__ = True  # a mistake in a task is told at its own line

ROUNDING = 1e-9
"""A value below the least that there can be by no more than this is the least. A share beyond 1 is
a mistake."""


def status(error: BaseException | None) -> Status:
    """`interrupted` is what somebody ended from outside, and only that: it may be run again."""
    if error is None:
        return "ok"
    outside = isinstance(error, Interrupted) or not isinstance(error, Exception)
    return "interrupted" if outside else "failed"


def failure(error: BaseException, where: Where) -> Failure:
    """What ended it, as its record keeps it."""
    if isinstance(error, WorkerError):
        message = readable(error.what, 2 * LONGEST)  # shortened where it arose
        return Failure(type(error).__name__, message, error.phase, error.log_tail)
    return Failure(readable(type(error).__name__), told(error), where.phase)


def checked(record: Record, task: Task) -> Record:
    """The record as a reader of its line has it.

    Raises:
        RecordError: no reader takes it; a value is not finite, too large, or one that its metric
            cannot have; or it has a name that none of the task's metrics has, while one of these
            has no value.
    """
    names = {metric.name for metric in task.metrics}
    if names - record.metrics.keys() and (others := record.metrics.keys() - names):
        unknown = UnknownMetric(min(others), names, f" in the outcome of {task.name}")
        raise RecordError(str(unknown))
    data = record.to_dict()
    values = data["metrics"]
    for name, value in values.items():
        given = record.metrics[name]
        number = isinstance(value, float | int) and abs(value) <= LARGEST
        if not number and (value is not None or given is not None):
            raise RecordError(
                f"{name} of {task.name} must be a number up to 1e100 or None, not {short(given)}"
            )
    for metric in task.metrics:
        value = values.get(metric.name)
        if value is not None and not metric.holds(value):
            if metric.bounded or metric.least is None or value < metric.least - ROUNDING:
                raise RecordError(f"{metric.name} of {task.name} cannot be {value:g}")
            values[metric.name] = metric.least
    return Record.from_dict(data, f"the outcome of {task.name}")
