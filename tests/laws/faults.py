"""A planted fault for each law: the scene is changed and the law is not told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from pytest_simbench.scene import Body, Box, Pose, Scene
from pytest_simbench.testing.faults import Plant as Fault
from pytest_simbench.testing.faults import edited, of_robot, put


def heavier(scene: Scene) -> Scene:
    """Gravity is a tenth larger."""
    x, y, z = scene.gravity
    return replace(scene, gravity=(1.1 * x, 1.1 * y, 1.1 * z))


def turned(scene: Scene) -> Scene:
    """Gravity pulls 1 m/s^2 aside."""
    x, y, z = scene.gravity
    return replace(scene, gravity=(x, y + 1.0, z))


def rougher(factor: float) -> Fault:
    """All friction is another one; where there is none, it is 0.2."""
    return lambda scene: scene.with_frictions(lambda mu: factor * mu or 0.2)


def bodies(change: Callable[[Body], Body], which: str = "") -> Fault:
    """Free bodies whose names begin like that are changed."""

    def all_of(scene: Scene) -> Scene:
        changed = tuple(
            change(body) if body.name.startswith(which) and not body.fixed else body
            for body in scene.bodies
        )
        return replace(scene, bodies=changed)

    return all_of


def moved(x: float = 0.0, y: float = 0.0, z: float = 0.0, which: str = "") -> Fault:
    """They stand elsewhere [m]."""
    return bodies(lambda body: body.moved_to(body.pose.translated(x, y, z)), which)


def faster(factor: float) -> Fault:
    """They start with another velocity."""

    def change(body: Body) -> Body:
        v, w = (factor * body.velocity).reshape(2, 3).tolist()
        return replace(body, linear_velocity=tuple(v), angular_velocity=tuple(w))

    return bodies(change)


def bouncier(factor: float) -> Fault:
    """Ground and bodies have another restitution."""

    def change(scene: Scene) -> Scene:
        found = bodies(lambda body: replace(body, restitution=factor * body.restitution))(scene)
        return replace(found, ground_restitution=factor * scene.ground_restitution)

    return change


def sized(x: float, y: float, z: float, which: str = "") -> Fault:
    """They have another size [m]."""
    return bodies(lambda body: body.changed(size=(x, y, z)), which)


def drives(**factors: float) -> Fault:
    """The drives have other gains or limits."""
    return of_robot(lambda robot: robot.scaled(*robot.joint_names, **factors))


def step(scene: Scene) -> Scene:
    """Something flat lies on the ground, where nothing should be."""
    plate = Box("plate", (1.0, 1.0, 0.02), Pose.at(0.0, 0.0, 0.01))
    return replace(scene, bodies=(*scene.bodies, plate))


def acting(**values: Any) -> Fault:
    """Forces on bodies act otherwise."""

    def change(body: Body) -> Body:
        wrenches = tuple(replace(wrench, **values) for wrench in body.wrenches)
        return replace(body, wrenches=wrenches)

    return bodies(change)


FAULTS: dict[str, Fault] = {
    **dict.fromkeys(("free_fall", "fall_speed", "oblique_gravity", "projectile"), heavier),
    "damped_fall": bodies(lambda body: replace(body, linear_damping=2 * body.linear_damping)),
    **dict.fromkeys(("bounce_height", "bounce_ratio", "elastic_chain"), bouncier(0.8)),
    **dict.fromkeys(("oblique_bounce_slip", "oblique_bounce_stick"), rougher(0.2)),
    **dict.fromkeys(("spin", "glide"), faster(1.1)),
    "free_top": sized(0.2, 0.2, 0.4),
    **dict.fromkeys(("tumble_energy", "tumble_momentum"), sized(0.3, 0.1, 0.02)),
    **dict.fromkeys(
        ("tumble_energy_drift", "tumble_momentum_drift"),
        bodies(lambda body: replace(body, angular_damping=0.01)),
    ),
    "axial_force": acting(force=(10.0, 0.0, 0.0)),  # doubled
    "axial_torque": acting(end=9.0),  # it never ends
    "belt_speed": faster(0.9),
    "ball_on_belt": faster(0.9),
    "free_cylinder": bodies(lambda body: body.changed(radius=0.1)),
    **dict.fromkeys(("rolling_sphere", "rolling_cylinder"), rougher(0.1)),
    **dict.fromkeys(("slip_to_roll", "spin_to_roll"), faster(1.2)),
    "landing_time": moved(z=0.05),
    "dead_landing": step,
    "dead_collision": bodies(lambda body: replace(body, mass=3 * body.mass), "two"),
    "collision_momentum": rougher(1.0),
    **dict.fromkeys(("stick_angle_x", "stick_angle_y", "stick_angle_diagonal"), rougher(1.2)),
    **dict.fromkeys(("wedging", "jamming"), rougher(1.2)),
    "creep": rougher(0.7),
    "carried": rougher(0.2),
    **dict.fromkeys(("slide_x", "slide_y", "slide_diagonal", "belt"), rougher(1.2)),
    "slide_straight": turned,
    **dict.fromkeys(("stopping_distance", "stopping_distance_oblique"), rougher(1.2)),
    "pivot": heavier,
    **dict.fromkeys(
        ("rest_force", "tower_force"), bodies(lambda body: replace(body, mass=1.1 * body.mass))
    ),
    "rimless_wheel": bodies(
        lambda body: replace(body, moments=tuple((3 * body.inertia()).tolist()))
    ),
    "mesh_twin": bodies(lambda body: replace(body, linear_velocity=(1.1, 0.0, 0.0)), "mesh"),
    "rest_depth": moved(z=1e-3),
    "tower": moved(z=1e-3, which="cube 4"),
    **dict.fromkeys(("heavy_on_top", "overhang"), moved(z=1e-3, which="cube 3")),
    "tipping_edge": moved(x=5e-3),
    "tipping_slope": moved(x=0.02),
    "grip_holds": rougher(0.7),
    **dict.fromkeys(("grip_slips", "grip_slips_diagonally"), rougher(0.9)),
    **dict.fromkeys(
        (
            "pendulum_period", "compound_pendulum", "pendulum_energy", "double_pendulum",
            "swinging_slider", "spherical_pendulum", "feed_forward", "pendulum_energy_drift",
        ),
        heavier,
    ),
    **dict.fromkeys(("step_response", "spring_damper", "sag"), drives(stiffness=1.5)),
    "two_pendulums": edited(  # a chain in place of two
        "joint[@name='swing 1']/parent", put(link="swing 0 link")
    ),
    "double_pendulum_energy": lambda scene: heavier(heavier(heavier(scene))),
    "effort_limit": drives(effort_limit=1.5),
    "tracking": drives(stiffness=0.01),
    "four_bar_closure": of_robot(lambda robot: replace(robot, closures=())),
    "domino_wave": of_robot(lambda robot: replace(robot, self_collide=False)),
    **dict.fromkeys(("four_bar_swing", "pendulum_force", "pendulum_torque"), heavier),
    "push_force": rougher(1.5),
    "push_straight": moved(y=0.02),
    "push_turns": rougher(1.1),
    "push_tips": rougher(1.3),
}  # fmt: skip
