"""ODE with one planted fault: a world that differs from the scene in one quantity.

Loaded by workers as `tests.sims.ode_faults:FaultyODE`, since ODE lives in the system's Python; the
setting `fault` names the quantity.
"""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace
from typing import Any

import numpy as np
from pytest_simbench.sims.ode.adapter import ODE
from pytest_simbench.sims.ode.contacts import distinct
from pytest_simbench.sims.ode.library import Mesh, library, place, set_damping

from pytest_simbench.scene import Pose
from pytest_simbench.simulator import lazy_import

from .planted import Plant, Planting

ode = lazy_import("ode")


class Mortal(ODE):
    """Counts as contacts how many of another world's shapes outlive it, without Python's collector
    of circles, which destroys ODE's objects in any order."""

    def contact_count(self) -> int:
        gc.disable()
        other = ODE(self.settings)
        other.load(self.scene)
        parts = [other._ground, *other._bodies.values(), *other._links.values()]
        shapes = [weakref.ref(geom) for part in parts for geom in part.geoms]
        assert len(shapes) > 10
        del parts
        other.close()
        del other
        alive = sum(shape() is not None for shape in shapes)
        gc.enable()
        return alive


class Tip(ODE):
    """Counts as contacts how many a box has of the tip of a cone in it, the most over some turns of
    both. The cone's 40 triangles meet in the tip, 0.1 mm deep."""

    filtered = True

    def contact_count(self) -> int:
        turns = 2 * np.pi * np.arange(40) / 40
        rim = np.stack([0.01 * np.cos(turns), 0.01 * np.sin(turns), np.full(40, 0.01)], axis=1)
        triangles = np.stack([np.zeros((40, 3)), np.roll(rim, -1, axis=0), rim], axis=1)
        cone, box = Mesh(ode.SimpleSpace(), triangles), ode.GeomBox(None, (0.1, 0.1, 0.1))
        most = 0
        for turn in np.linspace(0.0, np.pi / 2, 100):
            w, x, y, z = np.cos(turn / 2), *(np.sin(turn / 2) * np.array([2.0, 3.0, 6.0]) / 7)
            turned = Pose((0.0, 0.0, 0.0), (w, x, y, z))
            place(cone, turned)
            place(box, turned * Pose.at(0.0, 0.0, -0.0499))
            contacts = ode.collide(cone, box)
            kept = distinct(contacts) if self.filtered else contacts
            deep = [c for c in kept if c.getContactGeomParams()[2] > 0.5e-4]
            most = max(most, len(deep))
        return most


class RawTip(Tip):
    """The same, as ODE tells them."""

    filtered = False


def part(s: Any, name: str) -> Any:
    if name == "ground":
        return s._ground
    return s._links[name] if name.startswith("panda") else s._bodies[name]


def surface(name: str, attribute: str, value: float) -> Plant:
    return lambda s: setattr(part(s, name).surface, attribute, value)


def ghost(name: str) -> Plant:
    def plant(s: Any) -> None:
        geom = part(s, name).geoms[-1]._id()
        library().dGeomSetCategoryBits(geom, 0)
        library().dGeomSetCollideBits(geom, 0)

    return plant


def weightless(name: str) -> Plant:
    return lambda s: part(s, name).body.setGravityMode(False)


def uncoupled(s: Any) -> None:
    for pinion in s._drives.pinions.values():
        pinion.release()


FAULTS: dict[str, Plant] = {
    "timestep": lambda s: setattr(s, "settings", replace(s.settings, timestep=0.003)),
    "ground/height": lambda s: part(s, "ground").geoms[0].setParams((0.0, 0.0, 1.0), 0.01),
    "body/cube_05/com": lambda s: setattr(part(s, "cube_05"), "frame", Pose.at(0.01, 0.0, 0.0)),
    "body/cube_05/gravity": weightless("cube_05"),
    "body/cube_05/touches": ghost("cube_05"),
    "body/cube_05/dynamic": lambda s: part(s, "cube_05").body.setKinematic(),
    "link/panda_link4/restitution": surface("panda_link4", "bounce", 0.5),
    "link/panda_link4/damping": lambda s: set_damping(part(s, "panda_link4").body, np.r_[1e-4, 0]),
    "link/panda_link4/gravity": weightless("panda_link4"),
    "link/panda_link4/touches": ghost("panda_link4"),
    "gripper/coupled": uncoupled,
}


class FaultyODE(Planting, ODE):
    faults = FAULTS
