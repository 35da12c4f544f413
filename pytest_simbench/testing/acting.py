"""Checks of what moves bodies from outside: forces for a time, motions that are prescribed."""

from __future__ import annotations

import numpy as np

from pytest_simbench.scene import FloatArray
from pytest_simbench.testing import scenes
from pytest_simbench.testing.checks import check
from pytest_simbench.testing.subject import Subject, require_close


def _kicked(subject: Subject, name: str, columns: slice, inertia: float) -> None:
    """The velocities in `columns` are the momentum of the body's wrench, and the others are 0."""
    scene = scenes.kicked()
    body = scene.body(name)
    (wrench,) = body.wrenches
    motion = subject.motion(scene, 0.5, 0.02)
    rows = motion.bodies[:, [b.name for b in scene.free_bodies].index(name), 7:]
    acted = np.clip(motion.time - wrench.start, 0.0, wrench.end - wrench.start)
    rate: FloatArray = np.array([*wrench.force, *wrench.torque]) / inertia
    away = np.abs(rows - acted[:, None] * rate)
    late = subject.timestep * float(np.abs(rate).max())
    whole = float(np.abs(acted[:, None] * rate).max())
    worst = float(away[:, columns].max())
    require_close(f"error of the {name}'s velocity", worst, 0.0, late + 1e-3 * whole, "")
    end = float(away[-1].max())
    require_close("the same 0.2 s after the end, all axes", end, 0.0, 1e-3 * whole, "")


@check()
def force_acts_for_its_time(subject: Subject) -> None:
    """A brick without weight, pulled by F for 0.2 s, has v = F t / m: nothing before, nothing more
    afterwards, and it does not turn. At all times late by at most one step, and 0.1 % at the end;
    a force that acts for a step too long is 1 % and more."""
    _kicked(subject, "brick", slice(0, 3), scenes.kicked().body("brick").mass)


@check()
def torque_acts_for_its_time(subject: Subject) -> None:
    """A turned cube under a torque T in the world's axes has omega = T t / I in the same way."""
    inertia = float(scenes.kicked().body("cube").inertia()[0])
    _kicked(subject, "cube", slice(3, 6), inertia)
