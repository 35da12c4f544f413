"""The account of a file: what of its shapes, options, fields and objects was carried, or not.

A field of the compiled model that differs from that of a plain ball, on a free joint or a hinge,
and of which told.py knows nothing, is told as not carried: later releases may have more of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pytest_simbench.description.carried import CARRIED, NOT_CARRIED, named
from pytest_simbench.scene import FloatArray
from pytest_simbench.simulator import lazy_import

from .told import DERIVED, HELD, HELD_BY_DRIVES, OBJECTS, OPTIONS, SOLVER, TOLD, TOLD_ON_JOINTS

if TYPE_CHECKING:
    from .reading import Reading

mujoco = lazy_import("mujoco")

PLAIN = """<mujoco><worldbody><body name="b"><{} name="j"/><geom size="1"/></body></worldbody>
<actuator><motor joint="j"/></actuator><equality><weld body1="b"/></equality></mujoco>"""

NAMED = {"jnt": "joint", "dof": "joint", "eq": "equality"}
"""What names an element, by how its fields begin."""


def tell_the_rest(reading: Reading) -> None:
    """What its bodies and links, once they are read, have not told by themselves."""
    _tell_shapes(reading)
    _tell_options(reading)
    model, roots = reading.model, [p.root for p in reading.placed if p.root]
    geoms = reading.solid if reading.ground is None else [*reading.solid, reading.ground]
    free = {
        "geom": geoms,
        "body": [*range(1, model.nbody)],
        "jnt": [int(model.body_jntadr[root]) for root in roots],
        "dof": [int(model.body_dofadr[root]) + k for root in roots for k in range(6)],
    }
    _tell_fields(reading, "freejoint", free, TOLD, DERIVED)
    joints = [link.joint for link in reading.links]
    held = {
        "jnt": joints,
        "dof": [int(model.jnt_dofadr[joint]) for joint in joints],
        "actuator": sorted(int(k) for drive in reading.tree.drives for k in drive.numbers),
        "eq": sorted(reading.tree.constraints.carried),
    }
    _tell_fields(reading, "joint", held, TOLD_ON_JOINTS, DERIVED | HELD_BY_DRIVES)
    _tell_objects(reading)


def _tell_shapes(reading: Reading) -> None:
    model, scene = reading.model, reading.scene
    reading.tell("body mass, inertia, pos, quat", CARRIED, "as compiled, in full digits")
    reading.tell("geom type, size, pos, quat", CARRIED, f"{len(reading.solid)} shapes that collide")
    reading.tell("option gravity", CARRIED, f"{values_of(np.array([scene.gravity]))} m/s^2")
    reading.tell(
        "geom friction (sliding)",
        CARRIED,
        f"{values_of(np.array(sorted(scene.frictions)))}; of two surfaces the larger counts",
    )
    masks = np.stack([model.geom_contype, model.geom_conaffinity], axis=1)
    if seen := np.flatnonzero(~masks.any(axis=1)).tolist():
        names = (reading.name("geom", geom) for geom in seen)
        reading.tell("geom (visual)", NOT_CARRIED, "it cannot collide; its mass counts", names)


def _tell_options(reading: Reading) -> None:
    option = reading.model.opt
    plain = mujoco.MjModel.from_xml_string(PLAIN.format("joint")).opt
    told = {name: values_of(np.array([getattr(option, name)])) for name in SOLVER}
    reading.tell(
        "option " + ", ".join(SOLVER),
        NOT_CARRIED,
        "each engine has the options of its profile; in the file: "
        + ", ".join(f"{name} {value}" for name, value in told.items()),
    )
    for name in dir(plain):
        if name.startswith("_") or name in (*SOLVER, "gravity"):
            continue
        value = np.array([getattr(option, name)])
        if not np.array_equal(value, [getattr(plain, name)]):
            reason = OPTIONS.get(name, "each engine has the options of its profile")
            reason = f"{reason}; in the file: {values_of(value)}"
            reading.tell(f"option {name}", NOT_CARRIED, reason)


def _tell_fields(
    reading: Reading,
    joint: str,
    rows: Mapping[str, list[int]],
    told: Mapping[str, tuple[str, str, bool]],
    known: frozenset[str],
) -> None:
    """What a plain ball with a motor and a weld has not.

    Args:
        reading: of the file.
        joint: of the ball, an element's name.
        rows: numbers of the elements that are looked at, by kind.
        told: as `TOLD`.
        known: fields that are carried, follow from what is, or are no physics.
    """
    model, plain = reading.model, mujoco.MjModel.from_xml_string(PLAIN.format(joint))
    for kind, numbers in rows.items():
        for field in dir(plain) if numbers else ():
            if not field.startswith(f"{kind}_") or field in known:
                continue
            found = np.asarray(getattr(model, field))[numbers]
            usual = np.asarray(getattr(plain, field))[-1]
            if field == "geom_friction":
                found, usual = found[:, 1:], usual[1:]
            quantity, reason, always = told.get(
                field, (field.replace("_", " ", 1), "no scene holds it", False)
            )
            odd = np.any(np.reshape(found != usual, (len(found), -1)), axis=1)
            if odd.any() or always:
                own = [n for n, differs in zip(numbers, odd, strict=True) if differs]
                if kind == "dof":
                    own = sorted({int(model.dof_jntid[dof]) for dof in own})
                names = (reading.name(NAMED.get(kind, kind), number) for number in own)
                reading.tell(quantity, NOT_CARRIED, f"{reason}; {values_of(found)}", names)


def _tell_objects(reading: Reading) -> None:
    model, carried = reading.model, {k for drive in reading.tree.drives for k in drive.numbers}
    left = [k for k in range(getattr(model, "nactuator", model.nu)) if k not in carried]
    if left:
        names = [reading.name("actuator", k) for k in left]
        reading.tell("actuator", NOT_CARRIED, HELD, names)
    for count, (kind, reason) in OBJECTS.items():
        left = list(range(getattr(model, count, 0)))
        if left:
            reading.tell(kind, NOT_CARRIED, reason, [reading.name(kind, k) for k in left])


def values_of(values: FloatArray) -> str:
    """The different rows that there are, the first few of many."""
    rows = np.unique(np.reshape(values, (len(values), -1)), axis=0)
    return named(" ".join(f"{value:.7g}" for value in row.tolist()) for row in rows)
