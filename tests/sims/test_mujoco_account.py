"""Nothing of MuJoCo's own schema is dropped in silence.

All kinds of elements that MuJoCo's specification of a model has are walked, and all of their
attributes, so what a later release adds is asked, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from pytest_simbench.sims.mujoco.reading import Reading  # noqa: E402

from pytest_simbench.simulator import DescriptionError  # noqa: E402

ALL = """
<mujoco>
  <extension><plugin plugin="mujoco.pid"><instance name="pid"/></plugin></extension>
  <asset><mesh name="wedge" vertex="0 0 0  .1 0 0  0 .1 0  .1 .1 0  0 0 .06  0 .1 .06"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 .1"/>
    <body name="post" pos="1 0 .2" quat="2 .3 .4 .5">
      <geom name="pole" type="cylinder" size=".05 .2"/>
    </body>
    <body name="box" pos="0 0 .3">
      <joint name="free" type="free" frictionloss=".1" damping=".1" stiffness=".1"/>
      <geom name="brick" type="box" size=".05 .04 .03" quat="2 .3 .4 .5" fluidshape="ellipsoid"/>
      <geom size=".03" group="1"/>
    </body>
    <body name="rock" pos="0 .8 .3" quat="2 .3 .4 .5">
      <inertial pos="0 0 0" mass="1" diaginertia=".01 .012 .015" quat="2 .3 .4 .5"/>
      <freejoint/><geom name="stone" type="box" mesh="wedge" fitscale=".9"/>
      <geom type="mesh" mesh="wedge"/>
    </body>
    <body name="arm" pos="0 2 1">
      <joint name="elbow" axis="0 .6 .8" pos="0 .1 0" damping=".1" armature=".1" limited="true"
        frictionloss=".1" stiffness="1" springref="5" range="-50 60" ref="1" margin=".1"
        actuatorfrclimited="true" actuatorfrcrange="-90 90"/>
      <frame name="frame" pos="0 0 .1" quat="2 .3 .4 .5">
        <geom name="palm" type="box" size=".1 .1 .1" quat="2 .3 .4 .5"
          fluidshape="ellipsoid"/>
      </frame>
      <site name="wrist" pos="0 0 .4"/>
      <body name="hand" pos="0 0 .4" quat="2 .3 .4 .5">
        <inertial pos="0 0 0" mass="1" diaginertia=".01 .012 .015" quat="2 .3 .4 .5"/>
        <joint name="slide" type="slide"/><geom type="box" size=".1 .1 .1"/>
        <site name="tip" quat="2 -.3 -.4 -.5"/>
      </body>
    </body>
    <body name="door" pos="0 4 1"><joint name="hinge"/><geom type="box" size=".1 .1 .1"/></body>
    <site name="there"/>
  </worldbody>
  <deformable>
    <flex name="cloth" dim="1" body="post" vertex="0 0 0 .1 0 0" element="0 1"/>
  </deformable>
  <tendon>
    <fixed name="rope"><joint joint="hinge" coef="1"/></fixed>
    <spatial name="band"><site site="there"/><site site="tip"/></spatial>
  </tendon>
  <actuator>
    <motor name="motor" joint="slide" forcerange="-9 9"/>
    <motor name="push" joint="slide" ctrlrange="-1 1"/>
    <general name="servo" joint="elbow" gainprm="20" biastype="affine" biasprm="1 -20 -2"
      ctrlrange="-1 1" forcerange="-9 9"/>
    <velocity name="speed" joint="hinge" kv="2" ctrlrange="-1 1" forcerange="-9 9"/>
    <general name="lag" joint="hinge" dyntype="filter"/>
    <motor name="winch" tendon="rope"/>
    <plugin name="own" joint="hinge" plugin="mujoco.pid" instance="pid"/>
  </actuator>
  <equality>
    <connect name="connect" body1="hand" body2="door" anchor="0 0 0"/>
    <weld name="weld" body1="arm" body2="door" relpose="0 2 0 1 0 0 0"/>
    <weld name="sites" site1="tip" site2="wrist"/>
    <joint name="gears" joint1="slide" joint2="hinge" polycoef="0 .5 0 0 0"/>
    <tendon name="ropes" tendon1="rope"/>
    <weld name="tied" body1="box" body2="rock"/>
  </equality>
  <contact>
    <pair name="pair" geom1="brick" geom2="stone"/>
    <exclude name="exclude" body1="box" body2="post"/>
  </contact>
  <sensor><clock name="clock"/></sensor>
  <keyframe><key name="key" ctrl=".1 .1 .1 .1 .1 .1 .1"/></keyframe>
</mujoco>
"""
"""One of each kind, written so that its attributes act."""

NO_PHYSICS = {
    "names, looks, relatives, and what the compiler makes other attributes of": "*/alt */ialt "
    "*/castshadow */childclass */classname */compiler */content_type */file */frame */group */id "
    "*/info */material */name */parent */plugin */rgba/* */signature */userdata body/*/default "
    "body/*/explicitinertial body/*/fuse body/*/simple geom/*/hfieldname site/*/fromto/* "
    "site/*/meshname site/*/size/* site/*/type mesh/*/smoothnormal mesh/*/user[ftn]* "
    "mesh/*/needsdf mesh/*/octree_maxdepth mesh/*/refquat/0 actuator/*/type "
    "actuator/*/inheritrange equality/*/objtype compiler/LRopt compiler/a[!l]* compiler/[cpt]* "
    "compiler/discardvisual compiler/eulerseq compiler/fusestatic compiler/meshdir "
    "compiler/save* compiler/usethread compiler/balanceinertia site/wrist/quat/0",
    "of other kinds and states than this one": "joint/free/axis/* joint/free/pos/* joint/free/*ref "
    "joint/free/limited joint/free/springdamper/* joint/free/springyield joint/free/actfrc* "
    "joint/*/align actuator/*/actdim actuator/*/actlimited actuator/*/actrange/* "
    "actuator/*/dynprm/* actuator/*/ffrange/* actuator/*/velrange/* actuator/*/gear/[1-5] "
    "actuator/*/gainprm/[1-9] actuator/*/biasprm/[3-9] actuator/motor/biasprm/* actuator/*/*site "
    "actuator/motor/ctrl[lr]* equality/connect/data/[3-9] equality/*/data/11 "
    "equality/connect/data/10 equality/gears/data/[5-9] equality/gears/data/10 "
    "equality/weld/data/[0-26] equality/sites/data/? geom/palm/fitscale geom/brick/fitscale",
    "of what sleeps, which is an option": "body/*/sleep",
    "how the one input of a plain actuator is called": "actuator/*/ctrlspec",
    "walked on another of the kind": "body/world/* body/arm/* body/door/* body/box/* body/*/mocap "
    "body/post/[!pq]* geom/floor/* geom/pole/* joint/slide/* joint/hinge/* actuator/push/[!c]* "
    "geom/stone/[!f]* geom/stone/fluid* geom/stone/fromto* geom/palm/[!fpqst]* site/there/*",
}
"""Attributes (patterns of `KIND/NAME/ATTRIBUTE/PLACE`) that are not asked, by the reason."""

UNWALKED = (
    "Authored Camera Compiler Default Element HField Light Material Numeric Orientation Skin "
    "TendonPath Text Texture Tuple Wrap"
)
"""Kinds of elements that move nothing, or are parts of what is walked."""

TOGETHER: dict[str, dict[str, Any]] = {
    "actuator/*/target": {"target": "hinge"},
    "actuator/speed/target": {"target": "slide"},
    "actuator/*/delay": {"nsample": 2},
    "actuator/motor/biastype": {"biasprm": [1.0] + [0.0] * 9},
    "body/*/fullinertia/*": {"inertia": [0.0] * 3, "fullinertia": [0.01, 0.01, 0.01, 0.001, 0, 0]},
    "compiler/boundmass": {"boundmass": 5.0},
    "compiler/inertiafromgeom": {"inertiafromgeom": 1},
    "compiler/inertiagrouprange/*": {"inertiagrouprange": [0, 0]},
    "compiler/settotalmass": {"settotalmass": 20.0},
    "equality/*/name1": {"name1": "post"},
    "equality/*/name2": {"name2": "post"},
    "equality/sites/name?": {"name1": "there", "name2": "tip"},
    "equality/gears/name?": {"name1": "elbow", "name2": "slide"},
    "equality/gears/type": {"type": 3, "name1": "rope", "name2": ""},
    "exclude/*/bodyname?": {"bodyname1": "door"},
    "frame/*/scal*": {"scale": [2.0] * 3},
    "geom/*/con*": {"contype": 2, "conaffinity": 2},
    "geom/*/fromto/*": {"fromto": [0, 0, 0, 0, 0, 0.2], "type": 3},
    "geom/*/mass": {"mass": 3.0},
    "geom/*/meshname": {"meshname": "wedge", "type": 7},
    "geom/*/type": {"type": 3},
    "joint/*/springdamper/*": {"springdamper": [1.0, 1.0]},
    "joint/elbow/type": {"type": 2},
    "mesh/*/inertia": {"inertia": 3},
    "mesh/*/maxhullvert": {"maxhullvert": 4},
    "mesh/*/uservert": {"uservert": [0, 0, 0, 0.1, 0, 0, 0, 0.1, 0, 0, 0, 0.1]},
    "option/solver": {"solver": 0},
}
"""What is to be set besides, or instead of `another` value, by such patterns."""


def elements(spec: Any) -> dict[str, Any]:
    """All named ones that a specification holds, by kind and name."""
    lists = (getattr(spec, n) for n in dir(spec) if n.endswith("s") and n != "assets")
    found = [e for some in lists if isinstance(some, list) for e in some if e.name]
    named = {f"{type(e).__name__.removeprefix('Mjs').lower()}/{e.name}": e for e in found}
    return named | {"option": spec.option, "compiler": spec.compiler}


def attributes(thing: Any) -> Iterator[tuple[str, Any, int | None]]:
    """Name and value of all that it holds, of arrays each number and its place."""
    for name in dir(thing):
        value = None if name.startswith("_") else getattr(thing, name)
        if isinstance(value, np.ndarray):
            yield from ((name, x, k) for k, x in enumerate(np.nan_to_num(value).ravel().tolist()))
        elif not (value is None or callable(value) or isinstance(value, list)):
            yield name, value, None


def another(value: Any) -> Any:
    """Another value, allowed where the first one is."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, float):
        return 1.2 * value + 1e-3
    if isinstance(value, int):
        return 1 - value if value in (0, 1) else value + 1
    members = list(getattr(type(value), "__members__", {"": value}).values())
    return next((member for member in members if member != value), value)


def told_whole(reading: Reading, subject: str) -> bool:
    """Whether the account has it as not carried, by name."""
    kind, _, name = subject.partition("/")
    return any(
        state == "not carried" and (quantity == kind or quantity.startswith(f"{kind} ("))
        and name in names
        for (quantity, state, _), names in reading._told.items()
    )  # fmt: skip


def changed(subject: str, path: str, name: str, value: Any, place: int | None) -> Reading:
    """The file with another value of an attribute."""
    spec = mujoco.MjSpec.from_string(ALL)
    thing = elements(spec)[subject]
    if place is not None:
        value, number = getattr(thing, name).copy(), value
        value.flat[place] = number
    values = {name: value}
    for pattern, others in TOGETHER.items():
        values |= others if fnmatchcase(path, pattern) else {}
    for key, other in values.items():
        kind = type(getattr(thing, key))
        setattr(thing, key, kind(other) if hasattr(kind, "__members__") else other)
    spec.compile()
    return Reading("a.xml", spec)


SPEC = mujoco.MjSpec.from_string(ALL)


@pytest.mark.parametrize("subject", elements(SPEC))
def test_no_attribute_is_dropped_in_silence(subject: str) -> None:
    """Another value changes the scene or a line of its account; what the account has as not
    carried, by name, is told whole."""
    before, silent = Reading("a.xml", mujoco.MjSpec.from_string(ALL)), []
    asked = [] if told_whole(before, subject) else attributes(elements(SPEC)[subject])
    for name, value, place in asked:
        path = f"{subject}/{name}" + ("" if place is None else f"/{place}")
        if any(fnmatchcase(path, p) for text in NO_PHYSICS.values() for p in text.split()):
            continue
        try:
            after = changed(subject, path, name, another(value), place)
        except DescriptionError:  # told, too
            continue
        except ValueError as error:
            silent.append(f"{path}: {error}")
            continue
        if before.scene == after.scene and before.account == after.account:
            silent.append(path)
    assert not silent


def test_all_kinds_of_elements_are_walked() -> None:
    kinds = {name.removeprefix("Mjs") for name in dir(mujoco) if name.startswith("Mjs")}
    walked = {type(element).__name__.removeprefix("Mjs") for element in elements(SPEC).values()}
    assert kinds - walked <= set(UNWALKED.split())


SHORT: dict[str, dict[str, Any]] = {
    "adhesion": {"gain": 3.0}, "cylinder": {"timeconst": 1.0, "bias": 1.0, "area": 1.0},
    "damper": {"kv": 3.0}, "dcmotor": {"motorconst": [0.1, 0.1], "resistance": 1.0},
    "intvelocity": {"kp": 3.0}, "motor": {}, "muscle": {"tausmooth": 0.0},
    "pid": {"kp": 3.0}, "position": {"kp": 3.0},
    "velocity": {"kv": 3.0},
}  # fmt: skip
"""What MuJoCo's short forms of actuators need."""


FORMS = {n for n in dir(mujoco.MjsActuator) if n.startswith("set_to_")} - {"set_to_orientation"}
"""Orientation is one of ball joints, which no scene holds."""


@pytest.mark.parametrize("form", sorted(FORMS))
def test_short_forms_of_actuators_are_carried_or_told(form: str) -> None:
    spec = mujoco.MjSpec.from_string(ALL)
    servo = elements(spec)["actuator/servo"]
    servo.ctrlrange = [0.0, 1.0]
    getattr(servo, form)(**SHORT[form.removeprefix("set_to_")])
    before, after = (Reading("a.xml", s) for s in (mujoco.MjSpec.from_string(ALL), spec))
    assert before.scene != after.scene
    assert before.account != after.account
