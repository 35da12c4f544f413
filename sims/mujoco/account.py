"""The account of a file: what of its shapes, options, fields and objects was carried, or not.

A field of the compiled model that differs from that of a plain ball, on a free joint or a hinge,
and of which the tables here know nothing, is told as not carried: later releases may have more.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pytest_simbench.description.carried import CARRIED, NOT_CARRIED, named
from pytest_simbench.scene import FloatArray
from pytest_simbench.simulator import lazy_import

if TYPE_CHECKING:
    from .reading import Reading

mujoco = lazy_import("mujoco")

SOLVER = ("timestep", "integrator", "cone", "impratio", "solver", "iterations", "tolerance")
"""Options that are always told."""

AIR = "there is no air and no water in a scene: drag and lift are missing"

OPTIONS = {
    "density": AIR,
    "viscosity": AIR,
    "wind": AIR,
    "magnetic": "nothing in a scene is magnetic",
    "disableflags": "gravity, contact and, but for what one joint joins, filterparent are "
    "carried; all else acts",
    "enableflags": "a switch of MuJoCo's own",
}

SOFT = (
    "softness of contacts means something else in every engine: how deep bodies sink in, and how "
    "far they bounce, may differ"
)

TOLD: dict[str, tuple[str, str, bool]] = {
    "geom_friction": (
        "geom friction (torsional, rolling)",
        "contacts of a scene resist sliding alone; what spins or rolls may do so longer",
        False,
    ),
    "geom_condim": (
        "geom condim",
        "contacts of a scene resist sliding alone; with 1 they are without friction in the file, "
        "with 4 and 6 they resist spinning and rolling, too",
        False,
    ),
    "geom_priority": (
        "geom priority",
        "of two surfaces the one of the higher priority gives the friction in the file, here the "
        "larger friction counts",
        False,
    ),
    "geom_solref": ("geom solref", SOFT, True),
    "geom_solimp": ("geom solimp", SOFT, True),
    "geom_solmix": ("geom solmix", SOFT, False),
    "geom_margin": ("geom margin", "contacts begin at touch, not before it", False),
    "geom_gap": ("geom gap", "contacts begin at touch, not before it", False),
    "geom_fluid": ("geom fluidshape, fluidcoef", AIR, False),
    "geom_adhesion": ("geom adhesion", "surfaces of a scene do not stick", False),
    "geom_surfacevel": ("geom surfacevel", "surfaces of a scene do not run like belts", False),
    "body_mocapid": ("body mocap", "it is a fixed body: nothing moves it", False),
    "dof_armature": ("joint armature (free)", "a free body has the inertia of its mass", False),
    "dof_frictionloss": ("joint frictionloss (free)", "nothing holds a free body back", False),
    "jnt_stiffness": ("joint stiffness (free)", "no spring holds a free body", False),
    "jnt_stiffnesspoly": ("joint stiffness (free)", "no spring holds a free body", False),
    "dof_dampingpoly": ("joint damping (of higher order)", "damping of a scene is linear", False),
}
"""By field: the quantity, why it is not carried, and whether it is told even where it is usual."""

LIMITS = (
    "joint solreflimit, solimplimit",
    "ends of a range are as hard as an engine has them",
    False,
)
FRICTION = (
    "joint solreffriction, solimpfriction",
    "friction of joints is as hard as an engine has it",
    False,
)

TOLD_ON_JOINTS: dict[str, tuple[str, str, bool]] = {
    "jnt_margin": ("joint margin", "a range ends at its end, not before it", False),
    "jnt_solref": LIMITS,
    "jnt_solimp": LIMITS,
    "dof_solref": FRICTION,
    "dof_solimp": FRICTION,
    "dof_dampingpoly": TOLD["dof_dampingpoly"],
    "eq_solref": ("equality solref", "what is held together is as stiff as an engine has it", True),
    "eq_solimp": ("equality solimp", "what is held together is as stiff as an engine has it", True),
}
"""The same of hinges and sliders, their actuators, and what holds links together."""

HELD_BY_DRIVES = frozenset(
    ("jnt_limited", "jnt_range", "jnt_stiffness", "dof_armature", "dof_frictionloss")
)
"""Fields of hinges and sliders that the drives and links of a scene carry."""

DERIVED = frozenset(
    f"{kind}_{name}"
    for kind, names in {
        "geom": "aabb bodyid castshadow conaffinity contype dataid group matid pos quat rbound "
        "rgba sameframe size type user",
        "body": "bvhadr bvhnum conaffinity contype dofadr dofnum geomadr geomnum gravcomp inertia "
        "invweight0 ipos iquat jntadr jntnum margin mass parentid pos quat rootid sameframe "
        "simple subtreemass treeid user weldid",
        "jnt": "actuatorid axis bodyid dofadr group plasticadr pos qposadr type user",
        "dof": "M0 Madr bodyid damping invweight0 jntid length parentid simplenum treeid",
        "actuator": "acc0 actadr armature biasprm biastype ctrladr ctrllimited ctrlrange ctrlspec "
        "damping forcelimited forcerange gainprm gear group historyadr length0 outadr trnid user",
        "eq": "active0 data obj1id obj2id objtype type",
    }.items()
    for name in names.split()
)
"""Fields that are carried, follow from what is, or are no physics."""

HELD = "it does not act in the scene: what it holds or moves behaves otherwise"

OBJECTS = {
    "ntendon": ("tendon", HELD),
    "nflex": ("flex", "soft bodies are left out"),
    "nplugin": ("plugin", HELD),
    "nkey": ("key", "tests may take it as a start; its velocities are not read"),
    "nsensor": ("sensor", "nothing reads it"),
    "npair": ("pair", "pairs have the friction and the softness of their surfaces"),
}
"""By the model's count of them: what they are called, and what that they are left out means."""


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
    scene = reading.scene
    reading.tell("body mass, inertia, pos, quat", CARRIED, "as compiled, in full digits")
    reading.tell("geom type, size, pos, quat", CARRIED, f"{len(reading.solid)} shapes that collide")
    reading.tell("option gravity", CARRIED, f"{values_of(np.array([scene.gravity]))} m/s^2")
    reading.tell(
        "geom friction (sliding)",
        CARRIED,
        f"{values_of(np.array(sorted(scene.frictions)))}; of two surfaces the larger counts, "
        "where the run tells no other",
    )
    if reading.seen:
        names = (reading.name("geom", geom) for geom in reading.seen)
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
            off = switched_off(option.disableflags) if name == "disableflags" else values_of(value)
            reason = f"{reason}; in the file: {off}"
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


def switched_off(flags: int) -> str:
    """What these flags of a model switch off, by the names of a file."""
    names = [
        name.removeprefix("mjDSBL_").lower()
        for name, bit in mujoco.mjtDisableBit.__members__.items()
        if bit & flags and name.startswith("mjDSBL_")
    ]
    return " ".join(names) or "none"


def values_of(values: FloatArray) -> str:
    """The different rows that there are, the first few of many."""
    rows = np.unique(np.reshape(values, (len(values), -1)), axis=0)
    return named(" ".join(f"{value:.7g}" for value in row.tolist()) for row in rows)
