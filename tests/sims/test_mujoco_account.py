"""Nothing of MuJoCo's own schema is dropped in silence."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from pytest_simbench.sims.mujoco.reading import Reading  # noqa: E402

from .test_mujoco_reading import SMALL  # noqa: E402

NO_PHYSICS = {
    "geom": "alt castshadow classname compiler frame group id info material name parent plugin "
    "rgba signature userdata hfieldname set_frame",
    "body": "alt childclass classname compiler default frame frames id info name parent plugin "
    "signature simple userdata ialt sleep fuse first_body",
    "joint": "alt axis classname compiler frame group id info name parent signature userdata pos "
    "range ref margin limited solref_limit solimp_limit springref springdamper actfrclimited "
    "actfrcrange actgravcomp align springyield",
    "option": "apirate",
    "mesh": "classname compiler content_type file id info material name plugin signature "
    "smoothnormal usernormal usertexcoord userfacetexcoord userfacenormal needsdf octree_maxdepth "
    "userface usernode usertet",
}
"""Attributes that are no physics, that MuJoCo's free joints do not heed, or that only say how the
text of the file is to be read; lists of children and objects."""

VALUES: dict[str, Any] = {
    "geom.type": 3, "geom.fromto": None, "geom.meshname": None, "geom.condim": 4,
    "geom.contype": None, "geom.conaffinity": None, "geom.typeinertia": 1, "geom.mass": 3.0,
    "geom.fluid_ellipsoid": 1.0, "geom.fluid_coefs": None, "geom.fitscale": None,
    "geom.solmix": 2.0, "geom.solref": [0.05, 1.0], "geom.solimp": [0.8, 0.9, 0.01, 0.5, 2.0],
    "body.explicitinertial": None, "body.fullinertia": None, "body.inertia": None,
    "body.mass": None, "body.ipos": None, "body.iquat": None, "body.mocap": None,
    "joint.type": None, "joint.solref_friction": None, "joint.solimp_friction": None,
    "option.integrator": 1, "option.o_friction": None, "mesh.inertia": 3,
    "option.disableflags": 1 << 4, "option.enableflags": 1, "mesh.maxhullvert": 4,
    "mesh.uservert": None,
}  # fmt: skip
"""Values that are another one and allowed; None: it needs others with it, see `TOGETHER`."""

TOGETHER: dict[str, Any] = {
    "geom.fromto": lambda s: setattr_(s.geom("g"), fromto=[0, 0, 0, 0, 0, 0.2], type=3),
    "geom.meshname": lambda s: setattr_(s.geom("g"), meshname="wedge", type=7),
    "geom.fitscale": lambda s: setattr_(s.geom("g"), meshname="wedge", type=6, fitscale=0.5),
    "geom.fluid_coefs": lambda s: setattr_(
        s.geom("g"), fluid_ellipsoid=1.0, fluid_coefs=[0.1] * 5
    ),
    "geom.contype": lambda s: setattr_(s.geom("g"), contype=2, conaffinity=2),
    "geom.conaffinity": lambda s: setattr_(s.geom("g"), contype=2, conaffinity=2),
    "body.mass": lambda s: inertial(s),
    "body.inertia": lambda s: inertial(s, inertia=[0.02, 0.02, 0.03]),
    "body.ipos": lambda s: inertial(s, ipos=[0.01, 0, 0]),
    "body.iquat": lambda s: inertial(s, iquat=[0.8, 0.6, 0, 0], inertia=[0.02, 0.02, 0.03]),
    "body.fullinertia": lambda s: setattr_(
        s.body("box"), mass=1.0, ipos=[0, 0, 0], explicitinertial=True,
        fullinertia=[0.01, 0.01, 0.01, 0.001, 0, 0],
    ),
    "joint.solref_friction": lambda s: setattr_(
        s.joint("f"), frictionloss=0.1, solref_friction=[0.05, 1]
    ),
    "joint.solimp_friction": lambda s: setattr_(
        s.joint("f"), frictionloss=0.1, solimp_friction=[0.8, 0.9, 0.01, 0.5, 2]
    ),
    "option.o_friction": lambda s: setattr_(s.option, o_friction=[0.5, 0.5, 0.1, 0.1, 0.1]),
    "mesh.uservert": lambda s: setattr_(
        s.mesh("wedge"), uservert=[0, 0, 0, 0.1, 0, 0, 0, 0.1, 0, 0, 0, 0.1]
    ),
    **{
        f"compiler.{name}": (lambda s, n=name, v=value: setattr_(s.compiler, **{n: v}))
        for name, value in {
            "boundmass": 5.0, "boundinertia": 0.1, "settotalmass": 20.0, "inertiafromgeom": 1,
            "inertiagrouprange": [0, 0],
        }.items()
    },
}  # fmt: skip


def setattr_(thing: Any, **values: Any) -> None:
    for name, value in values.items():
        setattr(thing, name, value)


def inertial(spec: Any, **values: Any) -> None:
    own = {"mass": 1.0, "ipos": [0, 0, 0], "inertia": [0.01] * 3, "explicitinertial": True}
    setattr_(spec.body("box"), **own | values)


def subject(spec: Any, kind: str) -> Any:
    name = {"geom": "g", "body": "box", "joint": "f", "mesh": "wedge"}.get(kind)
    return getattr(spec, kind) if name is None else getattr(spec, kind)(name)


def attributes(kind: str) -> list[str]:
    """Of an element, that hold a value and are physics."""
    thing = subject(mujoco.MjSpec.from_string(SMALL), kind)
    names = [name for name in dir(thing) if not name.startswith("_")]
    plain = (bool, int, float, str, np.ndarray)
    return [
        name
        for name in names
        if name not in NO_PHYSICS[kind].split()
        and not callable(getattr(thing, name))
        and (isinstance(getattr(thing, name), plain) or hasattr(getattr(thing, name), "value"))
    ]


def another(value: Any) -> Any:
    """Another value of an attribute."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, np.ndarray):
        return value + np.linspace(0.1, 0.2, value.size).reshape(value.shape)
    if isinstance(value, float):
        return value * 1.5 + 0.01
    return type(value)(int(value) + 1)


CHANGES = [
    f"{kind}.{name}" for kind in NO_PHYSICS for name in attributes(kind)
    if VALUES.get(f"{kind}.{name}", 0) is not None
] + list(TOGETHER)  # fmt: skip


@pytest.mark.skipif(not hasattr(mujoco.MjSpec, "geom"), reason="of a release that names elements")
@pytest.mark.parametrize("change", CHANGES)
def test_nothing_is_dropped_in_silence(change: str) -> None:
    """A physical attribute that is changed changes the scene or a line of its account."""
    plain, spec = mujoco.MjSpec.from_string(SMALL), mujoco.MjSpec.from_string(SMALL)
    if change in TOGETHER:
        if change == "compiler.inertiagrouprange":
            for one in (plain, spec):
                one.body("box").add_geom(type=2, size=[0.05, 0, 0], group=1)
        if change == "compiler.inertiafromgeom":
            inertial(spec)
        if change.partition(".")[2] in ("inertia", "ipos", "iquat", "inertiafromgeom"):
            inertial(plain)
        if change.startswith("joint.sol"):
            setattr_(plain.joint("f"), frictionloss=0.1)
        if change == "geom.fluid_coefs":
            setattr_(plain.geom("g"), fluid_ellipsoid=1.0)
        if change == "geom.fitscale":
            setattr_(plain.geom("g"), meshname="wedge", type=6)
        TOGETHER[change](spec)
    else:
        kind, _, name = change.partition(".")
        thing = subject(spec, kind)
        setattr(thing, name, VALUES.get(change, another(getattr(thing, name))))
    before, after = Reading("a.xml", plain), Reading("a.xml", spec)
    same = before.scene == after.scene and before.account == after.account
    assert not same, f"{change} is dropped in silence"
