"""Tasks against measured data: each repetition is held against a motion that was measured."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, ClassVar, Generic, Self, TypeVar, get_args

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from pytest_simbench.data.measured import Half, Measured, MeasuredMotion
from pytest_simbench.scene import FloatArray
from pytest_simbench.scene.checks import check_choice, check_count
from pytest_simbench.tasks.base import Task

M = TypeVar("M", bound=MeasuredMotion)


class MeasuredTask(Task, Generic[M]):
    """A task against the measured data of that name. Its start is not disturbed: there is one truth
    for one start.

    Attributes:
        smallest: how many motions its smallest version goes through, where it has a field `most`.

    Raises:
        SceneError: a half that is none, or `most` that is no number of motions.
    """

    study_timeout: ClassVar[float] = 300.0
    shares_worker: ClassVar[bool] = True
    data: ClassVar[str]
    smallest: ClassVar[int | None] = None
    half: Half

    def __post_init__(self) -> None:
        check_choice(self.half, f"the half of {self.data}", get_args(Half))
        if (most := getattr(self, "most", None)) is not None:
            check_count(most, f"`most` of {self.data}")

    @property
    @abstractmethod
    def chosen(self) -> Sequence[M]:
        """The motions that repetitions go through."""

    @property
    def repetitions(self) -> int:
        """Each motion once."""
        return len(self.chosen)

    different = repetitions

    def smoke(self) -> Self:
        return replace(self, most=self.smallest) if self.smallest else self  # type: ignore[type-var]

    def sample(self, seed: int) -> tuple[str, int]:
        return self.data, self.real(seed).number

    def real(self, seed: int) -> M:
        """The motion of a seed: consecutive seeds go through all of them before one comes again."""
        return self.chosen[seed % len(self.chosen)]

    def parameters(self) -> dict[str, Any]:
        """The data by their digest."""
        told = {f"task.{item.name}": getattr(self, item.name) for item in fields(self)}  # type: ignore[arg-type]
        return {
            name: value.digest if isinstance(value, Measured) else value
            for name, value in told.items()
        }


def poses_at(at: FloatArray, time: FloatArray, states: FloatArray) -> tuple[FloatArray, Rotation]:
    """Positions [m], (m, 3), and turns of a body at times [s], (m,), within those of its states,
    (n,): position, quaternion w, x, y, z, (n, 7) or wider. Between two it moves evenly."""
    position = np.stack([np.interp(at, time, column) for column in states[:, :3].T], axis=1)
    return position, Slerp(time, Rotation.from_quat(states[:, 3:7], scalar_first=True))(at)
