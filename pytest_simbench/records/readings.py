"""What was read of a law in one repetition: measured, right, and how far off it may be."""

from __future__ import annotations

import math
from dataclasses import dataclass


def rounding(scale: float, steps: int) -> float:
    """What single precision may add up to in so many steps on a number of that size: half of the
    last digit, 2^-24 (IEEE 754), in each of the eight operations that a step is taken to have."""
    return scale * steps * 8 * 2.0**-24


@dataclass(frozen=True)
class Reading:
    """What an engine did, and what is right, in the law's unit.

    Attributes:
        value, exact: measured, and by the law.
        tolerance: by the step; above 0.

    Raises:
        ValueError: a number that is none, or a tolerance of 0.
    """

    value: float
    exact: float
    tolerance: float

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (self.value, self.exact))) or not self.tolerance > 0:
            raise ValueError(f"nothing can be read from {self}")

    @property
    def error(self) -> float:
        return abs(self.value - self.exact)

    @property
    def ratio(self) -> float:
        """Error over tolerance; at most 1 where the law is kept."""
        return self.error / self.tolerance
