"""Moments of a task: where its state is saved, and until which a difference is followed."""

from __future__ import annotations

from dataclasses import dataclass

from pytest_simbench.client.tape import Tape


@dataclass(frozen=True)
class Moment:
    """A moment of a task.

    Attributes:
        name: for tables.
        phase: of the task.
        operation: number of the operation in that phase before which it is, from 0.
    """

    name: str
    phase: str
    operation: int = 0

    def place(self, tape: Tape) -> int | None:
        """Number of the operation of a tape before which it is; None: there is none."""
        numbers = [k for k, operation in enumerate(tape) if operation.phase == self.phase]
        return numbers[self.operation] if self.operation < len(numbers) else None
