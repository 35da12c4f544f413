"""Omniverse PhysX with one planted fault each: its stage says something else than the scene.

Workers load the adapter from here as `tests.sims.ovphysx_faults:FaultyOvPhysX`; its setting `fault`
names the quantity.
"""

from __future__ import annotations

import re

import pytest_simbench.sims.ovphysx.adapter as adapter

from pytest_simbench.scene import Scene

from .planted import Planting

FAULTS: dict[str, tuple[str, str, str]] = {
    "ground/height": (
        "ground",
        "axis",
        '"Z"\ndouble3 xformOp:translate = (0, 0, 0.01)\n'
        'uniform token[] xformOpOrder = ["xformOp:translate"]',
    ),
    "body/brick/com": ("body_1", "physics:centerOfMass", "(0.01, 0, 0)"),
    "body/brick/gravity": (
        "body_1",
        "physics:mass",
        "0.23\nbool physxRigidBody:disableGravity = true",
    ),
    "body/brick/margin": (
        "body_1",
        "material:binding:physics",
        "</World/friction_0p7>\nfloat physxCollision:restOffset = 0.002",
    ),
    "link/panda_link4/restitution": ("friction_1p0", "physics:restitution", "0.5"),
    "link/panda_link4/margin": (
        "link_4",
        "material:binding:physics",
        "</World/friction_1p0>\nfloat physxCollision:restOffset = 0.002",
    ),
    "link/panda_link4/gravity": (
        "link_4",
        "physics:mass",
        "3.587895\nbool physxRigidBody:disableGravity = true",
    ),
    "joint/panda_joint4/friction": (
        "joint_3",
        "physxJointAxis:angular:armature",
        "0.1\nfloat physxJointAxis:angular:staticFrictionEffort = 0.5",
    ),
}
"""Prim, attribute and wrong value, by the quantity that must be found wrong."""


def edit(text: str, fault: str) -> str:
    """The stage with one attribute of another value."""
    prim, attribute, value = FAULTS[fault]
    pattern = rf'(def \w+ "{prim}".*?\n[\w\[\] ]+ {attribute} = )[^\n]+'
    wrong, count = re.subn(pattern, lambda m: m[1] + value, text, count=1, flags=re.S)
    if count != 1 or wrong == text:
        raise ValueError(f"the stage has no {attribute} at {prim} to be changed")
    return wrong


class FaultyOvPhysX(Planting, adapter.OvPhysX):
    """Hands PhysX a stage in which one attribute has another value."""

    def _start(self) -> None:
        if self.settings.fault:
            self._text = edit(self._text, self.settings.fault)
        super()._start()

    def load(self, scene: Scene) -> None:
        adapter.OvPhysX.load(self, scene)
