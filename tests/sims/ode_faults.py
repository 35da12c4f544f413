"""ODE with one planted fault: a world that differs from the scene in one quantity.

Loaded by workers as `tests.sims.ode_faults:FaultyODE`, since ODE lives in the system's Python; the
setting `fault` names the quantity.
"""

from __future__ import annotations

import ctypes
import gc
import weakref
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar

import numpy as np
from pytest_simbench.sims.ode.adapter import ODE
from pytest_simbench.sims.ode.contacts import distinct
from pytest_simbench.sims.ode.library import (
    HI_STOP,
    MOST_FORCE,
    SOFTNESS,
    Mesh,
    body_id,
    library,
    place,
)
from pytest_simbench.sims.ode.settings import ODESettings

from pytest_simbench.scene import Pose, Scene
from pytest_simbench.simulator import Settings, lazy_import

ode = lazy_import("ode")


@dataclass(frozen=True)
class FaultySettings(ODESettings):
    """Adds `fault`, a key of `FAULTS` or "" for none."""

    fault: str = ""


class FaultyODE(ODE):
    profiles: ClassVar[Mapping[str, Settings]] = {
        name: FaultySettings(**asdict(settings)) for name, settings in ODE.profiles.items()
    }
    settings: FaultySettings

    def load(self, scene: Scene) -> None:
        super().load(scene)
        if self.settings.fault:
            FAULTS[self.settings.fault](self)


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


def surface(name: str, attribute: str, value: float) -> Callable[[Any], None]:
    return lambda s: setattr(part(s, name).surface, attribute, value)


def heavier(name: str, mass: float = 1.0, inertia: float = 1.0) -> Callable[[Any], None]:
    def plant(s: Any) -> None:
        body = part(s, name).body
        found = body.getMass()
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = [[inertia * i for i in row] for row in found.I]
        found.setParameters(mass * found.mass, 0, 0, 0, xx, yy, zz, xy, xz, yz)
        body.setMass(found)

    return plant


def ghost(name: str) -> Callable[[Any], None]:
    def plant(s: Any) -> None:
        geom = part(s, name).geoms[-1]._id()
        library().dGeomSetCategoryBits(geom, 0)
        library().dGeomSetCollideBits(geom, 0)

    return plant


def weightless(name: str) -> Callable[[Any], None]:
    return lambda s: part(s, name).body.setGravityMode(False)


def thinner(s: Any) -> None:
    x, y, z = part(s, "cube_05").geoms[0].getLengths()
    part(s, "cube_05").geoms[0].setLengths((x, 0.8 * y, z))


def aside(s: Any) -> None:
    part(s, "cube_05").frame = Pose.at(0.01, 0.0, 0.0)


def table_sunk(s: Any) -> None:
    x, y, z = part(s, "table").geoms[0].getPosition()
    part(s, "table").geoms[0].setPosition((x, y, z - 0.012))


def damped(name: str) -> Callable[[Any], None]:
    def plant(s: Any) -> None:
        tell = library().dBodySetLinearDamping
        tell.argtypes = [ctypes.c_void_p, ctypes.c_double]
        tell(body_id(part(s, name).body), 1e-4)

    return plant


def step(s: Any) -> None:
    s.settings = replace(s.settings, timestep=0.003)


def joint(parameter: int, share: float) -> Callable[[Any], None]:
    def plant(s: Any) -> None:
        found = s._axes["panda_joint4"].joint
        found.setParam(parameter, share * found.getParam(parameter))

    return plant


def lighter_rotor(s: Any) -> None:
    s._drives.rotors["panda_joint4"].motor.setParam(SOFTNESS, 1.0)


def uncoupled(s: Any) -> None:
    s._drives.pinion.release()


FAULTS: dict[str, Callable[[Any], None]] = {
    "gravity": lambda s: s.world.setGravity((0.0, 0.0, -9.7)),
    "timestep": step,
    "ground/height": lambda s: part(s, "ground").geoms[0].setParams((0.0, 0.0, 1.0), 0.01),
    "ground/friction": surface("ground", "friction", 0.5),
    "ground/restitution": surface("ground", "bounce", 0.5),
    "body/cube_05/friction": surface("cube_05", "friction", 0.5),
    "body/cube_05/restitution": surface("cube_05", "bounce", 0.5),
    "body/cube_05/mass": heavier("cube_05", mass=2.0),
    "body/cube_05/inertia": heavier("cube_05", inertia=1.2),
    "body/cube_05/com": aside,
    "body/cube_05/damping": damped("cube_05"),
    "body/cube_05/gravity": weightless("cube_05"),
    "body/cube_05/touches": ghost("cube_05"),
    "body/cube_05/dynamic": lambda s: part(s, "cube_05").body.setKinematic(),
    "body/cube_05/boxes": thinner,
    "body/table/pose": table_sunk,
    "link/panda_link4/restitution": surface("panda_link4", "bounce", 0.5),
    "link/panda_link4/damping": damped("panda_link4"),
    "link/panda_link4/mass": heavier("panda_link4", mass=1.2),
    "link/panda_link4/inertia": heavier("panda_link4", inertia=1.2),
    "link/panda_link4/gravity": weightless("panda_link4"),
    "link/panda_link4/touches": ghost("panda_link4"),
    "joint/panda_joint4/limits": joint(HI_STOP, 0.9),
    "joint/panda_joint4/effort_limit": joint(MOST_FORCE, 2.0),
    "joint/panda_joint4/damping": joint(SOFTNESS, 0.9),
    "joint/panda_joint4/armature": lighter_rotor,
    "gripper/coupled": uncoupled,
}
