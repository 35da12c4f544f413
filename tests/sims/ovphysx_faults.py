"""Omniverse PhysX with one planted fault each: its stage says something else than the scene.

Workers load the adapter from here as `tests.sims.ovphysx_faults:FaultyOvPhysX`; its setting `fault`
names the quantity.
"""

from __future__ import annotations

import re
from typing import Any

from pytest_simbench.sims.ovphysx.adapter import OvPhysX

from .planted import Plant, Planting


def stage(prim: str, attribute: str, value: str) -> Plant:
    """Another value of one attribute in the stage, from which the world begins anew."""
    pattern = rf'(def \w+ "{prim}".*?\n[\w\[\] ]+ {attribute} = )[^\n]+'

    def plant(s: Any) -> None:
        wrong, count = re.subn(pattern, lambda m: m[1] + value, s._text, count=1, flags=re.S)
        if count != 1 or wrong == s._text:
            raise ValueError(f"the stage has no {attribute} at {prim} to be changed")
        s._text = wrong
        s._start()

    return plant


FAULTS: dict[str, Plant] = {
    "ground/height": stage(
        "ground",
        "axis",
        '"Z"\ndouble3 xformOp:translate = (0, 0, 0.01)\n'
        'uniform token[] xformOpOrder = ["xformOp:translate"]',
    ),
    "body/brick/com": stage("body_1", "physics:centerOfMass", "(0.01, 0, 0)"),
    "body/brick/gravity": stage(
        "body_1",
        "physics:mass",
        "0.23\nbool physxRigidBody:disableGravity = true",
    ),
    "body/brick/margin": stage(
        "body_1",
        "material:binding:physics",
        "</World/friction_0p7>\nfloat physxCollision:restOffset = 0.002",
    ),
    "link/panda_link4/restitution": stage("friction_1p0", "physics:restitution", "0.5"),
    "link/panda_link4/margin": stage(
        "link_4",
        "material:binding:physics",
        "</World/friction_1p0>\nfloat physxCollision:restOffset = 0.002",
    ),
    "link/panda_link4/gravity": stage(
        "link_4",
        "physics:mass",
        "3.587895\nbool physxRigidBody:disableGravity = true",
    ),
    "joint/panda_joint4/friction": stage(
        "joint_3", "physxJointAxis:angular:staticFrictionEffort", "0.5"
    ),
}


class FaultyOvPhysX(Planting, OvPhysX):
    faults = FAULTS
