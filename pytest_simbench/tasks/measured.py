"""Tasks against measured data: each repetition is held against a motion that was measured."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from pytest_simbench.data.measured import Motion
from pytest_simbench.tasks.base import Task


class MeasuredTask(Task):
    """A task against measured data. Its start is not disturbed: there is one truth for one start.

    Attributes:
        data: name of the data set.
    """

    study_timeout: ClassVar[float] = 300.0
    shares_worker: ClassVar[bool] = True
    data: ClassVar[str]

    @property
    @abstractmethod
    def chosen(self) -> Sequence[Motion]:
        """The motions that repetitions go through."""

    @property
    def repetitions(self) -> int:
        """Each motion once."""
        return len(self.chosen)

    def sample(self, seed: int) -> tuple[str, int]:
        return self.data, self.chosen[self.place(seed)].number

    def place(self, seed: int) -> int:
        """Which of the motions is that of a seed: consecutive seeds go through all of them before
        one comes again."""
        return seed % len(self.chosen)
