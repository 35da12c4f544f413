"""Laws: cases whose right answer is known, by which a simulator can be wrong all by itself."""

from importlib import import_module

from pytest_simbench.laws.base import Law, Reading
from pytest_simbench.records.phenomena import PHENOMENA

_MODULES = (
    "free", "spinning", "bounce", "contact", "sticking", "sliding", "rolling", "hands", "joints",
    "drives", "loops", "domino",
)  # fmt: skip

for _module in _MODULES:
    import_module(f"{__name__}.{_module}")

_ORDER = (
    "free_fall", "fall_speed", "damped_fall", "oblique_gravity", "projectile", "spin", "free_top",
    "free_cylinder", "tumble_energy", "tumble_momentum", "tumble_energy_drift",
    "tumble_momentum_drift", "axial_force", "axial_torque", "landing_time", "dead_landing",
    "dead_collision", "collision_momentum", "bounce_height", "bounce_ratio", "elastic_chain",
    "oblique_bounce_slip", "oblique_bounce_stick", "stick_angle_x", "stick_angle_y",
    "stick_angle_diagonal", "creep", "carried", "slide_x", "slide_y", "slide_diagonal",
    "slide_straight", "stopping_distance", "stopping_distance_oblique", "glide", "belt",
    "belt_speed", "mesh_twin", "pivot", "rolling_sphere", "rolling_cylinder", "slip_to_roll",
    "spin_to_roll", "ball_on_belt", "rimless_wheel", "rest_depth", "rest_force", "tower",
    "tower_force", "heavy_on_top", "overhang", "tipping_edge", "tipping_slope", "grip_holds",
    "grip_slips", "grip_slips_diagonally", "pendulum_period", "compound_pendulum", "two_pendulums",
    "pendulum_energy", "pendulum_energy_drift", "double_pendulum", "double_pendulum_energy",
    "swinging_slider", "spherical_pendulum", "step_response", "spring_damper", "effort_limit",
    "tracking", "sag", "feed_forward", "four_bar_closure", "four_bar_swing", "domino_wave",
    "pendulum_force", "pendulum_torque", "push_force", "push_straight", "push_turns", "push_tips",
)  # fmt: skip
"""Of the published tables; a law that is not among them comes last of its phenomenon."""


def _place(law: Law) -> tuple[int, int]:
    number = _ORDER.index(law.name) if law.name in _ORDER else len(_ORDER)
    return PHENOMENA.index(law.phenomenon), number


LAWS: tuple[Law, ...] = tuple(sorted((law() for law in Law.known), key=_place))
"""All of them, by phenomenon."""

__all__ = ["LAWS", "Law", "Reading"]
