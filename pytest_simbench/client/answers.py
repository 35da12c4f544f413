"""What a worker answers to each request, by type: nothing else is used, or written to a record."""

from __future__ import annotations

from typing import Any, NotRequired, TypedDict

import msgspec
import numpy as np

from pytest_simbench.client.launch import Constructed


class Hello(TypedDict):
    pid: int
    version: str
    python: str


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
    starts: list[list[tuple[str, np.ndarray]]]
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
    "state": State,
    "follow": Moved,
    "wait": Moved,
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
