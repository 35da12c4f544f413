"""What a repetition came to: its status, what ended it, and whether its outcome can be read."""

from __future__ import annotations

from pytest_simbench.client.errors import Interrupted, Where, WorkerError
from pytest_simbench.records.checked import short
from pytest_simbench.records.metrics import UnknownMetric
from pytest_simbench.records.record import Failure, Record, RecordError, Status
from pytest_simbench.tasks.base import Task
from pytest_simbench.worker.wire import LONGEST, readable, told

__tracebackhide__ = True  # a mistake in a task is told at its own line


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
    """The record as a reader of its line has it, where a number that is none is None.

    Raises:
        RecordError: no reader takes it, a proportion is not in 0..1, or a value has a name that
            none of the task's metrics has, while one of these has no value.
    """
    names = {metric.name for metric in task.metrics}
    if names - record.metrics.keys() and (others := record.metrics.keys() - names):
        unknown = UnknownMetric(min(others), names, f" in the outcome of {task.name}")
        raise RecordError(str(unknown))
    data = record.to_dict()
    for name, value in data["metrics"].items():
        if not isinstance(value, float | int | None):
            raise RecordError(f"{name} of {task.name} must be a number or None, not {short(value)}")
    found = Record.from_dict(data, f"the outcome of {task.name}")
    for metric in task.metrics:
        value = found.metrics.get(metric.name)
        # A distance below 0 may be rounding; a share beyond 1 is a mistake.
        if value is not None and metric.bounded and not metric.holds(value):
            raise RecordError(f"{metric.name} of {task.name} cannot be {value:g}")
    return found
