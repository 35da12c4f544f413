"""Newton with one planted fault: its solver's compiled model differs from the scene in one
quantity.

Loaded by workers as `tests.sims.newton_faults:FaultyNewton`, since Newton lives in an interpreter
of its own; the setting `fault` names the quantity.
"""

from __future__ import annotations

from typing import Any

from pytest_simbench.sims.newton.adapter import Newton

from .compiled_faults import Compiled, faults
from .planted import Plant, Planting


def compiled(s: Any) -> Compiled:
    """MuJoCo has numbers of its own for Newton's bodies and joints."""
    solver = s.solver

    def number(numbers: Any, labels: Any, name: str) -> int:
        known = [label.rpartition("/")[2] for label in labels]
        return int(numbers.numpy()[0].tolist().index(known.index(name)))

    def body(name: str) -> int:
        return number(solver.mjc_body_to_newton, s.model.body_label, name)

    joint = number(solver.mjc_jnt_to_newton_jnt, s.model.joint_label, "panda_joint4")
    return Compiled(solver.mj_model, solver.mj_data, body, joint, s._geom("ground"))


def effort_limit(s: Any) -> None:
    model, joint = s.solver.mj_model, compiled(s).joint
    model.actuator_forcerange[model.actuator_trnid[:, 0] == joint] *= 2.0
    model.jnt_actfrcrange[joint] *= 2.0


FAULTS: dict[str, Plant] = {
    **faults(compiled),
    "joint/panda_joint4/effort_limit": effort_limit,
}


class FaultyNewton(Planting, Newton):
    faults = FAULTS
