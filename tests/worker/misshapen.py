"""MuJoCo with an adapter that returns what is no state of the scene, in the way that UNRULY names.

Loaded by workers as `tests.worker.misshapen:Misshapen`.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import numpy as np
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.scene import FloatArray

Change = Callable[[Any], Any]


def _with(index: Any, value: Any) -> Change:
    def change(state: FloatArray) -> FloatArray:
        state = state.copy()
        state[index] = value
        return state

    return change


JOINTS: dict[str, Change] = {
    "too few joints": lambda q: q[:, :-1],
    "no velocities": lambda q: q[0],
    "joints transposed": lambda q: q.T,
    "joints as a list": lambda q: q.tolist(),
    "joints of float32": lambda q: q.astype(np.float32),
    "joints of int": lambda q: np.zeros_like(q, dtype=int),
    "joints of objects": lambda q: q.astype(object),
    "complex joints": lambda q: q.astype(complex),
    "joints exchanged": lambda q: q[:, [0, 3, 2, 1, 4, 5, 6, 7, 8]],
    "joints reversed": lambda q: q[:, ::-1].copy(),
    "joints not a number": _with((0, 4), np.nan),
    "joints of nothing": lambda q: None,
}
BODIES: dict[str, Change] = {
    "too few bodies": lambda b: b[:-1],
    "too many bodies": lambda b: np.vstack([b, b[:1]]),
    "no velocity columns": lambda b: b[:, :7],
    "bodies of float32": lambda b: b.astype(np.float32),
    "bodies of objects": lambda b: b.astype(object),
    "bodies exchanged": lambda b: b[::-1].copy(),
    "quaternion not a number": _with((0, 3), np.nan),
    "quaternion of length 2": _with((1, slice(3, 7)), (2.0, 0.0, 0.0, 0.0)),
    "quaternion of zeros": _with((0, slice(3, 7)), 0.0),
    "quaternion x y z w": lambda b: b[:, [0, 1, 2, 4, 5, 6, 3, 7, 8, 9, 10, 11, 12]],
    "position infinite": _with((0, 0), np.inf),
}
TIMES: dict[str, Change] = {
    "time as a text": str,
    "time of nothing": lambda t: None,
    "time complex": complex,
    "time an array": lambda t: np.array([t]),
    "time not a number": lambda t: np.nan,
}
LATER_TIMES: dict[str, Change] = {
    "time nan": lambda t: np.nan,
    "time inf": lambda t: np.inf,
    "time stands": lambda t: 0.3,
    "time runs back": lambda t: 0.6 - t,
    "time jumps": lambda t: t + 100.0,
}
BUILT: dict[str, Change] = {
    "nothing read back": lambda found: None,
    "texts read back": lambda found: {**found, "gravity": "downward"},
}
LATER: dict[str, Change] = {
    "later float32": lambda q: q.astype(np.float32),
    "later too few": lambda q: q[:, :-1],
    "later nothing": lambda q: None,
    "later a text": str,
}


class Misshapen(MuJoCo):
    @property
    def time(self) -> float:
        time, fault = super().time, os.environ["UNRULY"]
        if fault == "time slow":
            return time / 2
        if time > 0.31:
            time = LATER_TIMES.get(fault, lambda t: t)(time)
        return TIMES.get(fault, lambda t: t)(time)  # type: ignore[no-any-return]

    def read_back(self) -> dict[str, Any]:
        return BUILT.get(os.environ["UNRULY"], lambda found: found)(super().read_back())  # type: ignore[no-any-return]

    def joint_state(self) -> FloatArray:
        state, fault = super().joint_state(), os.environ["UNRULY"]
        if fault == "joints 1 and 3 exchanged":  # both stand at 0 at the start
            return state[:, [2, 1, 0, 3, 4, 5, 6, 7, 8]]
        if super().time > 0.3:
            state = LATER.get(fault, lambda q: q)(state)
        return JOINTS.get(fault, lambda q: q)(state)  # type: ignore[no-any-return]

    def body_state(self) -> FloatArray:
        return BODIES.get(os.environ["UNRULY"], lambda b: b)(super().body_state())  # type: ignore[no-any-return]
