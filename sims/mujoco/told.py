"""What MuJoCo's models hold and scenes do not, in the words of the file, and what that may change.

The reader of files looks here by the name of the field in the compiled model.
"""

from __future__ import annotations

SOLVER = ("timestep", "integrator", "cone", "impratio", "solver", "iterations", "tolerance")
"""Options that are always told."""

AIR = "there is no air and no water in a scene: drag and lift are missing"

OPTIONS = {
    "density": AIR,
    "viscosity": AIR,
    "wind": AIR,
    "magnetic": "nothing in a scene is magnetic",
    "disableflags": "only gravity that is switched off is carried",
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
