"""What the actuators of a file's joint do, as one drive of the scene.

A plain actuator on a joint pulls with gear (gain u + b0 + b1 gear q + b2 gear v), u its control. So
several of them are one spring and damper again, or a motor (`scene.Joint`). Without a command a
drive holds its joint where it starts, and a motor does nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pytest_simbench.description.carried import APPROXIMATED, CARRIED
from pytest_simbench.scene import FloatArray
from pytest_simbench.simulator import lazy_import

if TYPE_CHECKING:
    from .reading import Reading

mujoco = lazy_import("mujoco")

STRONG = 1e4
"""Largest effort of a drive without a limit [N m or N]."""


@dataclass(frozen=True)
class Drive:
    """The plain actuators of a joint together.

    Attributes:
        numbers, channels: of the actuators, and of their controls, (n,).
        gears, gains, constants: of each, (n,).
        zero: position of the joint in which the file is written [rad or m].
        stiffness: [N m/rad, N/m].
        damping: [N m s/rad, N s/m].
        limit: largest effort, `STRONG` without one [N m, N].
        rotor, resistance: what all actuators of the joint, also those that are left out, add to its
            armature [kg m^2, kg] and to its own damping [N m s/rad, N s/m].
    """

    numbers: FloatArray
    channels: FloatArray
    gears: FloatArray
    gains: FloatArray
    constants: FloatArray
    zero: float
    stiffness: float
    damping: float
    limit: float
    rotor: float
    resistance: float

    def target(self, controls: FloatArray) -> float | None:
        """Where it holds the joint, from where the file is written, with the controls of a
        keyframe, (nu,) [rad or m]; None: it holds it nowhere."""
        return self._pull(controls) / self.stiffness - self.zero if self.stiffness else None

    def speed(self, controls: FloatArray) -> float:
        """What it is told that has damping alone: how fast the controls ask it to move its joint
        [rad/s or m/s]."""
        braked = self.damping and not self.stiffness
        return self._pull(controls) / self.damping if braked else 0.0

    def effort(self, controls: FloatArray) -> float:
        """What a motor is told [N m or N]."""
        return 0.0 if self.stiffness or self.damping else self._pull(controls)

    def _pull(self, controls: FloatArray) -> float:
        """With the joint at rest at 0."""
        return float(self.gears @ (self.gains * controls[self.channels] + self.constants))

    def controls(self, target: float) -> FloatArray:
        """The controls, (n,), with which it holds the joint there, from where the file is written
        [rad or m]; all alike in joint position."""
        pull = self.stiffness * (target + self.zero) - self.gears @ self.constants
        return np.asarray(pull * self.gains * self.gears / np.sum((self.gains * self.gears) ** 2))


def drive_of(reading: Reading, joint: int) -> Drive:
    """The drive of a joint; told is what it holds, and which actuators are left out."""
    model, kinds = reading.model, mujoco
    on_joint = model.actuator_trntype == kinds.mjtTrn.mjTRN_JOINT
    own = np.flatnonzero(on_joint & (model.actuator_trnid[:, 0] == joint))
    plain = np.array([k for k in own if _plain(model, int(k))], dtype=int)
    gears, gains = model.actuator_gear[plain, 0], model.actuator_gainprm[plain, 0]
    affine = (model.actuator_biastype[plain] == kinds.mjtBias.mjBIAS_AFFINE)[:, None]
    constants, springs, dampers = np.where(affine, model.actuator_biasprm[plain, :3], 0.0).T
    stiffness, damping = 0.0 - float(springs @ gears**2), 0.0 - float(dampers @ gears**2)
    if stiffness < 0 or damping < 0 or (stiffness and not np.any(gains * gears)):
        plain = plain[:0]  # what drives a joint away from where it is, or cannot be commanded
        gears, gains, constants, stiffness, damping = plain, plain, plain, 0.0, 0.0
    limits = np.abs(model.actuator_forcerange[plain]).max(axis=1) * np.abs(gears)
    limits = np.where(model.actuator_forcelimited[plain], limits, STRONG)
    if not stiffness and not damping:  # controls of motors are efforts, and have limits too
        most = np.abs(gains) * np.abs(model.actuator_ctrlrange[plain]).max(axis=1)
        most = (most + np.abs(constants)) * np.abs(gears)
        limits = np.where(model.actuator_ctrllimited[plain], np.minimum(limits, most), limits)
    limit = float(limits.sum()) if len(plain) else STRONG
    zero = float(model.qpos0[model.jnt_qposadr[joint]])
    channels = getattr(model, "actuator_ctrladr", np.arange(model.nu))[plain]
    added = [
        float(np.sum(getattr(model, field, 0.0 * on_joint)[own] * model.actuator_gear[own, 0] ** 2))
        for field in ("actuator_armature", "actuator_damping")
    ]
    made = Drive(
        plain, channels, gears, gains, constants, zero, stiffness, damping, min(limit, STRONG),
        *added,
    )  # fmt: skip
    _tell_ranges(reading, made)
    names = [reading.name("actuator", int(k)) for k in plain]
    if stiffness:
        reason = f"it holds its joint where it starts, by at most {made.limit:g} N m or N"
        reading.tell("actuator (position)", APPROXIMATED, reason, names)
    elif damping:
        reason = f"it holds its joint at rest, by at most {made.limit:g} N m or N"
        reading.tell("actuator (velocity)", APPROXIMATED, reason, names)
    elif names:
        pull = made.effort(np.zeros(model.nu))
        reason = f"a drive that is told an effort of at most {made.limit:g} N m or N; without a "
        reason += "command it does nothing"
        reason += f" here, and pulls {pull:g} in the file" if pull else ", here and in the file"
        reading.tell("actuator (motor)", APPROXIMATED if pull else CARRIED, reason, names)
    return made


def _tell_ranges(reading: Reading, drive: Drive) -> None:
    """The ranges of forces and controls that a drive does not hold."""
    model, servo = reading.model, bool(drive.stiffness or drive.damping)
    for kind, open_ in (("force", False), ("ctrl", servo)):
        reason = "commands have no range" if open_ else "the larger limit holds to both sides"
        for k in drive.numbers.tolist():
            low, high = getattr(model, f"actuator_{kind}range")[k]
            if getattr(model, f"actuator_{kind}limited")[k] and (open_ or low != -high):
                told = f"{reason}; in the file: {low:g} to {high:g}"
                name = reading.name("actuator", k)
                reading.tell(f"actuator {kind}range", APPROXIMATED, told, [name])


def _plain(model: Any, number: int) -> bool:
    """Whether an actuator's effort is affine in control, position and velocity, and it is on."""
    group = int(model.actuator_group[number])
    off = 0 <= group <= 30 and model.opt.disableactuator >> group & 1
    biases = (mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtBias.mjBIAS_AFFINE)
    return bool(
        not off
        and model.actuator_plugin[number] < 0
        and model.actuator_dyntype[number] == mujoco.mjtDyn.mjDYN_NONE
        and model.actuator_gaintype[number] == mujoco.mjtGain.mjGAIN_FIXED
        and any(model.actuator_biastype[number] == bias for bias in biases)
    )
