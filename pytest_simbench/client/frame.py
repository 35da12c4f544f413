"""One picture of a film, as the worker sends it between a request and its answer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.worker.text import readable
from pytest_simbench.worker.wire import unpack


@dataclass(frozen=True)
class Frame:
    """One picture, or why there are no more.

    Attributes:
        time: simulated [s].
        picture: (height, width, 3), red, green, blue; None: the engine could not draw it.
        problem: why, as a sentence.
        seconds: that drawing took [s].
    """

    time: float
    picture: NDArray[np.uint8] | None
    problem: str
    seconds: float

    @classmethod
    def from_wire(cls, data: Any, size: tuple[int, int]) -> Frame:
        """What came for a picture of `size` (width, height); what is none is a problem."""
        try:
            time, seconds = float(data["time"]), float(data["seconds"])
            if "problem" in data:
                return cls(time, None, readable(str(data["problem"])), 0.0)
            picture = unpack(data["picture"])
            if picture.dtype == np.uint8 and picture.shape == (*size[::-1], 3):
                return cls(time, picture, "", max(0.0, seconds) if math.isfinite(seconds) else 0.0)
            came = f"{picture.dtype} {picture.shape}"
        except (KeyError, TypeError, ValueError, AttributeError):
            came = f"{data!r:.80}"
        return cls(
            0.0, None, f"the engine drew what is no picture of {size}: {readable(came)}", 0.0
        )
