"""What a worker sends, by type: an answer to each request, and frames of a film in between. Nothing
else is used, or written to a record."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NotRequired, TypedDict

import msgspec
import numpy as np
from numpy.typing import NDArray

from pytest_simbench.worker.wire import readable, unpack


class Hello(TypedDict):
    pid: int
    version: str
    python: str


@dataclass(frozen=True)
class Constructed:
    """A simulator that a worker made.

    Attributes:
        versions: of the packages that it runs on, by name.
        untested: why this is no version that the adapter was tested with; empty if it is one.
    """

    settings: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    untested: str = ""


class State(TypedDict):
    """Simulated time [s]; joints (2, n_joints) and bodies (n_free, 13) as `client.world.World`."""

    time: float
    joints: np.ndarray
    bodies: np.ndarray


class Loaded(State):
    excused: list[str]
    timestep: float


class Moved(State):
    """`aside`: wall time of readings that are no part of the motion [s]."""

    log: dict[str, np.ndarray]
    aside: NotRequired[float]


class FileRead(TypedDict):
    """A scene, its keyframes, and the lines of the account of what was carried, as they cross the
    boundary."""

    scene: dict[str, Any]
    starts: list[dict[str, Any]]
    account: list[dict[str, str]]


class Stats(TypedDict):
    stepping: dict[str, float]
    peak_rss_mb: float | None


ANSWERS: dict[str, Any] = {
    "hello": Hello,
    "construct": Constructed,
    "read_file": FileRead,
    "compile": None,
    "load": Loaded,
    "watch": None,
    "read_again": None,
    "read_back": dict[str, Any],
    "misfit": float,
    "state": State,
    "follow": Moved,
    "wait": Moved,
    "close_loop": Moved,
    "save": None,
    "restore": State,
    "contact_count": int,
    "contact_forces": list[tuple[str, str, np.ndarray]],
    "joint_wrenches": np.ndarray,
    "render": np.ndarray,
    "film": float | None,
    "stats": Stats,
    "close": None,
}
"""By operation of `worker.server.Server`."""


def checked(operation: str, answer: Any) -> Any:
    """The answer to a request, as its type.

    Raises:
        msgspec.ValidationError: it is of another one; the message says where in it.
    """
    return msgspec.convert(answer, ANSWERS[operation])


def is_picture(drawn: np.ndarray, size: tuple[int, int]) -> bool:
    """Whether it is one of `size` (width, height)."""
    return drawn.dtype == np.uint8 and drawn.shape == (*size[::-1], 3)


@dataclass(frozen=True)
class Frame:
    """One picture of a film, or why there are no more.

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
            if is_picture(picture, size):
                return cls(time, picture, "", max(0.0, seconds) if math.isfinite(seconds) else 0.0)
            came = f"{picture.dtype} {picture.shape}"
        except (KeyError, TypeError, ValueError, AttributeError):
            came = f"{data!r:.80}"
        return cls(
            0.0, None, f"the engine drew what is no picture of {size}: {readable(came)}", 0.0
        )
