"""The laws at other parameters: who chooses settings on the ones judges them on the others."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pytest_simbench.laws.base import Law

_ANGLE, _SLIDE, _SLIPS = {"friction": 0.6}, {"slope": 0.85, "friction": 0.6}, {"load": 1.25}
_BOUNCE, _FASTER = {"restitution": 0.7, "height": 0.4}, {"speed": 0.8}

OTHER: dict[str, dict[str, Any]] = {
    "free_fall": {"seconds": 0.7}, "fall_speed": {"seconds": 0.7}, "damped_fall": {"damping": 3.0},
    "oblique_gravity": {"gravity": (-2.0, 1.0, -5.0)}, "spin": {"spin": 7.0},
    "projectile": {"velocity": (1.5, 2.0, 3.0)}, "axial_force": {"force": 4.0},
    "landing_time": {"height": 0.4}, "dead_landing": {"height": 0.4}, "dead_collision": _FASTER,
    "collision_momentum": _FASTER, "bounce_height": _BOUNCE, "bounce_ratio": _BOUNCE,
    "elastic_chain": {"speed": 1.5},
    "stick_angle_x": _ANGLE, "stick_angle_y": _ANGLE, "stick_angle_diagonal": _ANGLE,
    "creep": {"friction": 0.6, "share": 0.7, "direction": 0.9}, "carried": {"acceleration": 3.0},
    "slide_x": _SLIDE, "slide_y": _SLIDE, "slide_diagonal": _SLIDE, "slide_straight": _SLIDE,
    "stopping_distance": {"speed": 1.5, "friction": 0.4}, "glide": _FASTER,
    "stopping_distance_oblique": {"speed": 1.5, "direction": 0.9}, "belt": {"acceleration": 7.0},
    "belt_speed": {"speed": 0.6}, "mesh_twin": _FASTER,
    "rolling_sphere": {"slope": 0.25}, "rolling_cylinder": {"slope": 0.25},
    "slip_to_roll": _FASTER, "spin_to_roll": {"spin": 30.0}, "ball_on_belt": {"speed": 0.6},
    "grip_holds": {"load": 0.7}, "grip_slips": _SLIPS, "grip_slips_diagonally": _SLIPS,
    "pendulum_period": {"length": 0.4, "angle": 1.5}, "step_response": {"rate": 8.0},
    "spring_damper": {"start": 0.4}, "effort_limit": {"effort": 1.5}, "tracking": _FASTER,
    "sag": {"stiffness": 60.0}, "feed_forward": {"stiffness": 60.0},
}  # fmt: skip
"""By law, the parameters that it has then. A law that is not here stays as it is."""


def held_out(law: Law) -> Law | None:
    """The law at its other parameters; None where none are declared."""
    values = OTHER.get(law.name)
    return replace(law, **values) if values else None  # type: ignore[type-var]
