"""MuJoCo whose compiled model is changed behind its adapter's back, one row a fault: what is
changed, and the laws that must find it. `read_back` goes on telling the scene's value."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from operator import attrgetter
from typing import Any

from pytest_simbench.sims.mujoco.world import ROBOT

from tests.testing.wrong import FINGERS, DrivesNotTold, Lying

Tamper = Callable[[Any], None]
Rows = Any
"""An index of an array, or a function that tells it of an adapter."""

ALL = slice(None)
SLIDING = (ALL, 0)
"""The first of MuJoCo's three coefficients of friction."""


def put(array: str, value: Any, rows: Rows = ALL) -> Tamper:
    """An array of the model or the data, set."""

    def tamper(s: Any) -> None:
        attrgetter(array)(s)[rows(s) if callable(rows) else rows] = value

    return tamper


def times(array: str, factor: float, rows: Rows = ALL) -> Tamper:
    """The same, multiplied."""

    def tamper(s: Any) -> None:
        attrgetter(array)(s)[rows(s) if callable(rows) else rows] *= factor

    return tamper


def add(array: str, value: Any, rows: Rows = ALL) -> Tamper:
    """The same, added to."""

    def tamper(s: Any) -> None:
        attrgetter(array)(s)[rows(s) if callable(rows) else rows] += value

    return tamper


def lift(link: int | str) -> Tamper:
    """A force that holds a body's weight."""

    def tamper(s: Any) -> None:
        body = s.model.body(link).id if isinstance(link, str) else link
        s.data.xfrc_applied[body, 2] = s.model.body_mass[body] * -s.model.opt.gravity[2]

    return tamper


def geoms(*links: str) -> Callable[[Any], Any]:
    return lambda s: [s.model.body(int(b)).name in links for b in s.model.geom_bodyid]


def joint(name: str) -> Callable[[Any], Any]:
    return lambda s: s.model.joint(name).id


def dof(name: str) -> Callable[[Any], Any]:
    return lambda s: s.model.joint(name).dofadr


def ground(s: Any) -> Any:
    return s.model.geom("ground").id


def fat_link(s: Any) -> None:
    """The shapes of link 3 are 10 mm aside."""
    turn, rows = s.data.body("panda_link3").xmat.reshape(3, 3), geoms("panda_link3")(s)
    s.model.geom_pos[rows] += turn.T @ [0.0, -0.01, 0.0]
    s.model.geom_sameframe[rows] = 0


def viscous(s: Any) -> None:
    """The scene is full of a thick air."""
    s.model.opt.viscosity = 0.01


def own_spin(s: Any) -> None:
    """Bodies start with the scene's angular velocity in their own axes."""
    for body, rows in zip(s.scene.free_bodies, s._body_v, strict=True):
        s.data.qvel[rows + 3] = body.angular_velocity


def wrong_centre(s: Any) -> None:
    """The centre of mass of link 4 is 100 mm off."""
    link = s.model.body("panda_link4").id
    s.model.body_ipos[link, 1] -= 0.1
    s.model.body_sameframe[link] = 0


NO_LIMIT = (put("model.actuator_forcelimited", 0), put("model.jnt_actfrclimited", 0))
"""Of effort: the drive's, and the URDF's, which is the same."""

HEAVIER = {"body_mass": -1, "body_inertia": -1, "dof_M0": slice(-6, None)}
"""Of a body: the engine takes the last for bodies that nothing hangs on."""

SOFT = (times("model.actuator_gainprm", 0.5, (ALL, 0)),
        times("model.actuator_biasprm", 0.5, (ALL, 1)))  # fmt: skip
"""Half the stiffness."""

WORLDS: dict[str, tuple[tuple[Tamper, ...], tuple[str, ...]]] = {
    "Echo": ((), ("read_back_is_the_engines",)),
    "DoubleGravity": ((times("model.opt.gravity", 2),), ("free_fall",)),
    "OwnSpin": ((own_spin,), ("thrown_as_the_scene_says",)),
    "HalfFriction": ((times("model.geom_friction", 0.9, SLIDING),),
                     ("slides_above_mu", "slides_alike_diagonally", "meshes_rest_and_slide")),
    "Shaking": ((add("model.opt.gravity", 12.0, 0),), ("tower_stands",)),
    "Bouncy": ((put("model.geom_solref", (0.02, 0.05)),), ("nothing_bounces",)),
    "SlipperyHand": ((put("model.geom_friction", 0.01, SLIDING),),
                     ("sticks_below_mu", "grip_holds")),
    "OpenLoop": ((put("data.eq_active", 0),), ("loops_stay_closed", "joints_move_together")),
    "StuckLoop": ((put("model.dof_damping", 1e3),), ("loops_stay_closed",)),
    "PassingLinks": ((put("model.geom_conaffinity", 0, lambda s: s.model.geom_contype == ROBOT),),
                     ("links_collide_when_asked",)),
    "JoinedLinksCollide": ((put("model.exclude_signature", 0),),
                           ("links_collide_when_asked", "pairs_are_kept_apart")),
    "NoEffortLimit": (NO_LIMIT, ("effort_limit_bounds_acceleration", "weak_joint_sags")),
    "WrongMass": (tuple(times(f"model.{name}", 1.5, rows) for name, rows in HEAVIER.items()),
                  ("collision_keeps_momentum",)),
    "DeepGround": ((add("model.geom_pos", -0.003, lambda s: (ground(s), 2)),
                    put("model.geom_sameframe", 0, ground)), ("rest_on_plane", "rounds_rest")),
    "SoftDrives": (SOFT, ("static_hold", "motors_push")),
    "LateBrakes": ((times("model.actuator_biasprm", 0.1, (ALL, 2)),), ("saturated_drive_settles",)),
    "HalfDamping": ((times("model.dof_damping", 0.5),), ("joints_are_damped",)),
    "HalfDry": ((times("model.dof_frictionloss", 0.5),), ("joints_have_friction",)),
    "HighCentre": ((add("model.body_ipos", 0.05, (-1, 2)), put("model.body_sameframe", 0, -1)),
                   ("slides_flat",)),
    "SlowTurn": ((times("model.body_inertia", 1.5, -1),
                  times("model.dof_M0", 1.5, slice(-3, None))),
                 ("ball_rolls", "can_rolls", "compounds_turn_by_their_moments")),
    "Viscous": ((viscous,), ("brick_tumbles_on",)),
    "FreeFingers": ((put("data.eq_active", 0),), ("fingers_stay_coupled",)),
}  # fmt: skip
"""In every scene."""

ROBOTS: dict[str, tuple[tuple[Tamper, ...], tuple[str, ...]]] = {
    "StickyFingers": ((put("model.geom_friction", 20.0, lambda s: (geoms(*FINGERS)(s), 0)),),
                      ("squeeze_bounds_the_grip",)),
    "DoubleSqueeze": ((times("model.actuator_forcerange", 2, [7, 8]),
                       times("model.jnt_actfrcrange", 2)), ("squeeze_bounds_the_grip",)),
    "OneFloats": ((lift(-1),), ("every_body_falls",)),
    "GhostLink": ((put("model.geom_contype", 0, geoms("panda_link5")),), ("links_are_felt",)),
    "FatLink": ((fat_link,), ("links_are_felt",)),
    "WrongCentre": ((wrong_centre,), ("limp_arm_falls",)),
    "StiffJoint": ((put("model.dof_damping", 1.0, dof("panda_joint4")),), ("limp_arm_falls",)),
    "WeightlessLink": ((lift("panda_link6"),), ("limp_arm_falls",)),
    "NoLimits": ((put("model.jnt_limited", 0),), ("joints_stop_at_their_limits",)),
    "StrongWrist": ((times("model.actuator_forcerange", 2, 6),
                     times("model.jnt_actfrcrange", 2, joint("panda_joint7"))),
                    ("every_effort_limit_counts",)),
}  # fmt: skip
"""Where there is a robot."""


def tampered(name: str) -> type[Lying]:
    """The adapter of a row; workers find it by the name of its class."""

    def tamper(self: Lying) -> None:
        if name in WORLDS or self.scene.robot is not None:
            for change in (WORLDS | ROBOTS)[name][0]:
                change(self)

    return type(name, (Lying,), {"tamper": tamper, "__module__": __name__})


class SoftDrivesNotTold(tampered("SoftDrives")):
    """Which are declared not to be told."""

    info = DrivesNotTold.info


class OtherRule(Lying):
    """Takes the larger of two frictions, and says the smaller."""

    info = replace(Lying.info, friction_rule="minimum")


FAULTS: list[tuple[type[Lying], str]] = []
"""Adapter and law."""

for _name, (_, _laws) in (WORLDS | ROBOTS).items():
    globals()[_name] = tampered(_name)
    FAULTS += [(globals()[_name], law) for law in _laws]
