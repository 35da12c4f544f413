"""Loops of links, closed by MuJoCo's constraint `connect`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from pytest_simbench.scene import Closure, FloatArray
from pytest_simbench.simulator import lazy_import

mujoco = lazy_import("mujoco")


def close_loops(spec: Any, closures: Iterable[Closure]) -> None:
    """Hold the points together, as stiffly as the step allows.

    MuJoCo's `connect` takes the point of the first link, and finds that of the second at the
    model's own zero posture, where the loop is open. So two sites are held together.
    """
    for k, closure in enumerate(closures):
        names = []
        for link, point in (
            (closure.first, closure.first_point),
            (closure.second, closure.second_point),
        ):
            names.append(f"closure {k} {link}")
            spec.body(link).add_site(name=names[-1], pos=point)
        spec.add_equality(
            name=f"closure {k}",
            type=mujoco.mjtEq.mjEQ_CONNECT,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=names[0],
            name2=names[1],
            solref=[2 * spec.option.timestep, 1.0],
        )


def closed(model: Any, active: Any) -> dict[str, FloatArray]:
    """The quantity `closure/NUMBER/points` of each active closure, held by two sites or, as with
    Newton, by two bodies with a point each."""
    loops = np.flatnonzero((model.eq_type == mujoco.mjtEq.mjEQ_CONNECT) & active)
    return {
        f"closure/{k}/points": _points(model, number) for k, number in enumerate(loops.tolist())
    }


def _points(model: Any, number: int) -> FloatArray:
    """What a closure holds together, (2, 3), each in the frame of its link [m]."""
    if model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE:
        sites = [model.eq_obj1id[number], model.eq_obj2id[number]]
        return np.array(model.site_pos[sites])
    return np.array(model.eq_data[number, :6]).reshape(2, 3)
