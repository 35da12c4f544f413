"""The scene as a world of Genesis: settings, materials, boxes, robot, camera."""

from __future__ import annotations

import tempfile
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.description.links import frames, reduced
from pytest_simbench.description.shapes import write_obj
from pytest_simbench.description.urdf import body_urdf
from pytest_simbench.scene import Body, Box, Capsule, Compound, ConvexMesh, Cylinder, Scene, Sphere
from pytest_simbench.simulator import NotSupportedError, PreparedRobot, lazy_import
from pytest_simbench.simulator.base import EYE, FIELD_OF_VIEW, LOOK_AT

from .engine import array_of
from .settings import GenesisFileSettings, GenesisSettings

genesis = lazy_import("genesis")

LEAST_FRICTION = 0.01
"""A material must have at least this coefficient, and so has every contact (`func_add_contact`)."""


def new_world(scene: Scene, settings: GenesisSettings, *, window: bool) -> Any:
    """An empty world with the settings, not yet built."""
    s, options = settings, genesis.options
    return genesis.Scene(
        sim_options=options.SimOptions(dt=s.timestep, substeps=s.substeps, gravity=scene.gravity),
        rigid_options=options.RigidOptions(
            # of a robot, but for links that a joint joins; boxes are entities of their own
            enable_self_collision="self_collide" in scene.words
            or isinstance(s, GenesisFileSettings),
            # also of links that overlap where all joints are at 0, as a Panda's fifth and seventh
            enable_neutral_collision="self_collide" in scene.words,
            integrator=getattr(genesis.integrator, s.integrator),
            friction_cone=getattr(genesis.friction_cone, s.friction_cone),
            impratio=s.impratio or None,
            constraint_timeconst=s.constraint_timeconst,
            iterations=s.iterations,
            tolerance=s.tolerance or None,
            noslip_iterations=s.noslip_iterations,
            box_box_detection=s.box_box_detection,
            use_gjk_collision=s.gjk,
        ),
        vis_options=options.VisOptions(show_world_frame=False),
        viewer_options=options.ViewerOptions(
            res=(1024, 768),
            camera_pos=EYE,
            camera_lookat=LOOK_AT,
            camera_fov=degrees(FIELD_OF_VIEW),
        ),
        profiling_options=options.ProfilingOptions(show_FPS=False),
        show_viewer=window,
    )


def material(friction: float, density: float | None = None, **others: float) -> Any:
    """Of a friction coefficient, the least at least, and a density [kg/m^3] or the engine's own."""
    return genesis.materials.Rigid(rho=density, friction=max(friction, LEAST_FRICTION), **others)


def add_body(world: Any, body: Body, most: float) -> Any:
    """The entity of a body; a prescribed one weighs `most` [kg]."""
    stuff = {"gravity_compensation": 1.0} if body.prescribed else {}
    if body.prescribed:
        body = body.changed(prescribed=False, mass=most, moments=(most,) * 3)
    uneven = body.moments is not None or isinstance(body, Compound | ConvexMesh)
    density = None if body.fixed or uneven else body.mass / body.volume
    surface = genesis.surfaces.Default(color=body.colour)
    with tempfile.TemporaryDirectory() as folder:  # of a mesh, which Genesis takes from a file
        return world.add_entity(
            _described(body, Path(folder)) if uneven else _morph(body),
            material=material(body.friction, density, **stuff),
            surface=surface,
        )


def _morph(body: Body) -> Any:
    """The shape of a body. Genesis makes a capsule of MuJoCo's description alone."""
    morphs = genesis.morphs
    place = {"pos": body.pose.position, "quat": body.pose.quaternion}
    match body:
        case Box():
            return morphs.Box(size=body.size, **place, fixed=body.fixed)
        case Sphere():
            return morphs.Sphere(radius=body.radius, **place, fixed=body.fixed)
        case Cylinder():
            return morphs.Cylinder(
                radius=body.radius, height=body.length, **place, fixed=body.fixed
            )
        case Capsule():
            joint = "" if body.fixed else "<freejoint/>"
            size = f'size="{body.radius!r} {body.length / 2!r}" mass="{body.mass or 1.0!r}"'
            return morphs.MJCF(
                file=f"<mujoco><worldbody><body>{joint}<geom type='capsule' {size}/></body>"
                "</worldbody></mujoco>",
                **place,
            )
    raise NotSupportedError(f"genesis has no {type(body).__name__}")


def _described(body: Body, folder: Path) -> Any:
    """A body with moments of inertia of its own, by a URDF: other morphs know a density. Files go
    into the folder."""
    for part in body.parts:
        if isinstance(part, Capsule):
            raise NotSupportedError("genesis takes no moments of inertia of a Capsule")
    return genesis.morphs.URDF(
        file=body_urdf(body, lambda name, hull: write_obj(folder / f"{name}.obj", hull)),
        pos=body.pose.position,
        quat=body.pose.quaternion,
        fixed=body.fixed,
        default_armature=None,
        requires_jac_and_IK=False,
    )


def add_robot(world: Any, prepared: PreparedRobot) -> Any:
    """The entity of the reduced robot. Equality constraints couple its joints, and close its
    loops."""
    morph = genesis.morphs.URDF(
        file=prepared.to_urdf(),
        fixed=True,
        merge_fixed_links=False,
        decimate=False,  # else hulls of more than 500 faces are simplified, by up to 0.3 mm
        default_armature=None,
        requires_jac_and_IK=False,
    )
    robot = world.add_entity(morph, material=material(prepared.robot.friction))
    for pair in (*prepared.robot.gripper.couplings, *prepared.robot.couplings):
        _hold(robot, "JOINT", pair.follower, pair.leader, [pair.offset, pair.ratio])
    for closure in reduced(prepared):
        points = [*closure.first_point, *closure.second_point]
        if closure.rigid:  # a weld's data begin with the point of what it names second
            turn = frames(prepared, closure)[1].quaternion
            _hold(robot, "CONNECT", closure.second, closure.first, [*points, *turn, 1.0])
        else:
            _hold(robot, "CONNECT", closure.first, closure.second, points)
    return robot


def weld(solver: Any, prepared: PreparedRobot) -> None:
    """Make welds of rigid closures, once the world is built: of links that it finds welded,
    Genesis' collider leaves the pair out."""
    kinds = array_of(solver.dyn_info.equalities.eq_type, copy=False)
    loops = np.flatnonzero(kinds[: solver.n_equalities, 0] == genesis.EQUALITY_TYPE.CONNECT)
    rigid = [closure.rigid for closure in reduced(prepared)]
    kinds[loops[rigid]] = genesis.EQUALITY_TYPE.WELD


def _hold(robot: Any, kind: str, first: str, second: str, numbers: list[float]) -> None:
    """An equality constraint between two joints or links. Genesis has no public call for it: this
    is what it calls for those of a file."""
    robot._add_equality(
        name=f"hold {robot.n_equalities}",
        type=getattr(genesis.EQUALITY_TYPE, kind),
        objs_name=(first, second),
        data=np.array([*numbers, *[0.0] * (11 - len(numbers))]),
        sol_params=genesis.utils.geom.default_solver_params(),
    )


def add_camera(world: Any, width: int, height: int) -> Any:
    """A camera for pictures, ready to be used, in a world that is built."""
    # `Scene.add_camera` refuses once a scene is built; the visualiser does not.
    camera = world.visualizer.add_camera(
        res=(width, height),
        pos=EYE,
        lookat=LOOK_AT,
        up=(0.0, 0.0, 1.0),
        model="pinhole",
        fov=degrees(FIELD_OF_VIEW),
        aperture=2.0,
        focus_dist=None,
        GUI=False,
        spp=1,
        denoise=False,
        near=0.1,
        far=20.0,
        env_idx=None,
        debug=False,
    )
    camera.build()
    return camera
