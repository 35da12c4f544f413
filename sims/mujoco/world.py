"""The scene as a model of MuJoCo."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pytest_simbench.description.links import frames, reduced
from pytest_simbench.scene import (
    Body,
    Box,
    Capsule,
    ConvexMesh,
    Coupling,
    Cylinder,
    FloatArray,
    Joint,
    Scene,
    Sphere,
)
from pytest_simbench.simulator import NotSupportedError, PreparedRobot, heavy, lazy_import

from .bounces import direct
from .settings import MuJoCoSettings

mujoco = lazy_import("mujoco")

ROBOT, WORLD, LED = 1, 2, 4
"""Collision groups: the robot's links touch everything but, unless asked, each other; prescribed
bodies touch what they can move."""

ROUND = "a round shape that spins or rolls on a rougher surface is braked about its contact, too"
"""What it means that such a shape leaves the contact to the other."""

LINK_COLOUR, GROUND_COLOUR = (0.9, 0.9, 0.9, 1.0), (0.5, 0.5, 0.5, 1.0)


def build(scene: Scene, prepared: PreparedRobot | None, settings: MuJoCoSettings) -> Any:
    """The compiled model; its names are the scene's. `prepared` is the scene's robot."""
    spec = mujoco.MjSpec()
    if prepared is not None:
        spec = mujoco.MjSpec.from_string(_urdf(prepared))
    _set_options(spec, scene, settings)
    if prepared is not None:
        _equip(spec, prepared, settings)
    for pair in scene.apart:
        first, second = ("world" if n == "ground" else n.partition("/")[2] for n in pair)
        spec.add_exclude(bodyname1=first, bodyname2=second)
    ground = spec.worldbody.add_geom(
        name="ground",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0, 0, 0.5],
        rgba=GROUND_COLOUR,
    )
    touches = WORLD | ROBOT
    _set_surface(ground, settings, scene.ground_friction, scene.ground_restitution, WORLD, touches)
    most, roughest = heavy(scene), max(scene.frictions)
    for body in scene.bodies:
        _add_body(spec, body, settings, most, roughest)
    spec.worldbody.add_light(pos=[0.5, 0, 3], dir=[0, 0, -1])
    return spec.compile()


def _equip(spec: Any, prepared: PreparedRobot, settings: MuJoCoSettings) -> None:
    """Surfaces, drives, couplings, loops, and which links of the robot collide."""
    robot = prepared.robot
    for geom in spec.geoms:
        links = ROBOT if robot.self_collide else 0
        _set_surface(geom, settings, robot.friction, 0.0, ROBOT, links)
        geom.rgba = LINK_COLOUR
    for joint in robot.joints:
        _add_drive(spec, joint)
    for body in spec.bodies:
        body.gravcomp = 1.0 - prepared.gravity.get(body.name, 1.0)
    for pair in (*robot.gripper.couplings, *robot.couplings):
        _couple(spec, pair)
    close_loops(spec, prepared)
    for moved in prepared.joints if robot.self_collide else ():
        # MuJoCo parts what one joint joins by itself, but where one link is fixed in the world.
        spec.add_exclude(bodyname1=moved.parent, bodyname2=moved.child)


def _set_options(spec: Any, scene: Scene, settings: MuJoCoSettings) -> None:
    option = spec.option
    option.timestep = settings.timestep
    option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{settings.integrator.upper()}")
    option.solver = getattr(mujoco.mjtSolver, f"mjSOL_{settings.solver.upper()}")
    option.iterations = settings.iterations
    option.cone = getattr(mujoco.mjtCone, f"mjCONE_{settings.cone.upper()}")
    option.impratio = settings.impratio
    option.noslip_iterations = settings.noslip_iterations
    option.gravity = scene.gravity
    # On a state that is not finite MuJoCo would start over from its initial state, silently.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET


def _set_surface(
    geom: Any,
    settings: MuJoCoSettings,
    friction: float,
    restitution: float,
    group: int,
    touches: int,
) -> None:
    geom.friction[0] = friction
    geom.condim = settings.condim
    bouncing = restitution and direct(restitution, settings.timestep)
    geom.solref[:2] = bouncing or settings.solref
    geom.solimp[:3] = settings.solimp
    geom.contype, geom.conaffinity = group, touches


def _add_body(
    spec: Any, part: Body, settings: MuJoCoSettings, most: float, roughest: float
) -> None:
    """`most`: mass and moments of a prescribed body [kg, kg m^2]; `roughest`: largest friction."""
    body = spec.worldbody.add_body(
        name=part.name, pos=part.pose.position, quat=part.pose.quaternion
    )
    geoms = [
        _add_shape(spec, body, shape_label(part, k), shape, settings, roughest)
        for k, shape in enumerate(part.parts)
    ]
    if part.prescribed:
        for geom in geoms:
            geom.contype, geom.conaffinity = LED, ROBOT
        _set_inertia(body, most, (most,) * 3)
        body.gravcomp = 1.0
        body.add_freejoint(name=f"{part.name}/free")
    elif not part.fixed:
        for geom in geoms:
            geom.conaffinity |= LED
        geoms[0].mass = part.mass
        if part.moments is not None or isinstance(part, ConvexMesh):
            _set_inertia(body, part.mass, part.inertia().tolist())
        body.add_freejoint(name=f"{part.name}/free")


def shape_label(body: Body, k: int) -> str:
    """Name of a body's shape with this number, here and in Newton."""
    return f"{body.name}/{k}" if k else body.name


def _add_shape(
    spec: Any, body: Any, name: str, shape: Body, settings: MuJoCoSettings, roughest: float
) -> Any:
    """The geom of one shape of a body, at its place in the body's frame."""
    kind, size = _geom(shape)
    mesh = {}
    if isinstance(shape, ConvexMesh):
        spec.add_mesh(name=f"{name}/mesh", uservert=np.ravel(shape.vertices))
        mesh = {"meshname": f"{name}/mesh"}
    geom = body.add_geom(
        name=name,
        type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"),
        size=[*size, 0.0, 0.0, 0.0][:3],
        pos=shape.pose.position,
        quat=shape.pose.quaternion,
        rgba=shape.colour,
        **mesh,
    )
    _set_surface(geom, settings, shape.friction, shape.restitution, WORLD, WORLD | ROBOT)
    if not isinstance(shape, Box | ConvexMesh):
        # contacts of a round shape neither roll nor spin with friction; all else of them is its
        # own, too, so it must be the roughest
        geom.condim, geom.priority = 3, int(shape.friction == roughest)
    return geom


def _geom(body: Body) -> tuple[str, list[float]]:
    """MuJoCo's kind of a body's shape, and its size: half edges, or radius and half length."""
    match body:
        case Box():
            return "BOX", [edge / 2 for edge in body.size]
        case Sphere():
            return "SPHERE", [body.radius]
        case Cylinder():
            return "CYLINDER", [body.radius, body.length / 2]
        case Capsule():
            return "CAPSULE", [body.radius, body.length / 2]
        case ConvexMesh():
            return "MESH", []
    raise NotSupportedError(f"mujoco has no {type(body).__name__}")


def _set_inertia(body: Any, mass: float, moments: Sequence[float]) -> None:
    """About its origin, along its axes."""
    body.mass, body.inertia, body.explicitinertial = mass, moments, True
    body.ipos, body.iquat = [0, 0, 0], [1, 0, 0, 0]


def _urdf(prepared: PreparedRobot) -> str:
    """The reduced URDF with MuJoCo's compiler element: paths kept, visuals dropped."""
    compiler = (
        '<mujoco><compiler strippath="false" discardvisual="true" fusestatic="false"/></mujoco>'
    )
    return prepared.to_urdf().replace("</robot>", f"{compiler}</robot>")


def _add_drive(spec: Any, joint: Joint) -> None:
    drive = spec.add_actuator(
        name=joint.name,
        target=joint.name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        forcelimited=True,
        forcerange=[-joint.effort_limit, joint.effort_limit],
        ctrllimited=True,
        ctrlrange=[-MOST, MOST],
    )
    drive.gainprm[0] = gain(joint.stiffness)
    drive.biasprm[1], drive.biasprm[2] = -joint.stiffness, -joint.damping
    moved = _named(spec.joints, joint.name)
    moved.armature, moved.frictionloss, moved.springref = joint.armature, joint.friction, joint.rest
    # with MuJoCo's own 20 ms what friction holds creeps by 10 mm/s under 0.8 of its largest effort
    moved.solref_friction = [2 * spec.option.timestep, 1.0]
    for field, value in (("damping", joint.passive_damping), ("stiffness", joint.spring)):
        polynomial = np.atleast_1d(getattr(moved, field))  # a number in releases before 3.5
        setattr(moved, field, [value, *polynomial[1:]] if len(polynomial) > 1 else value)


def gain(stiffness: Any) -> Any:
    """Effort for 1 of a drive's control, here and in Newton; at least 1: `MOST` is far away."""
    return np.maximum(stiffness, 1.0)


MOST = 1e10
"""Largest control (`mjMAXVAL`): where one is above, MuJoCo takes 0 for all."""


def _named(elements: Any, name: str) -> Any:
    """The joint or body of that name; before 3.3.0 `MjSpec` does not look it up."""
    return next(element for element in elements if element.name == name)


def _couple(spec: Any, pair: Coupling) -> None:
    """Move two joints together, by a constraint as stiff as the step allows."""
    spec.add_equality(
        type=mujoco.mjtEq.mjEQ_JOINT,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        name1=pair.follower,
        name2=pair.leader,
        data=[pair.offset, pair.ratio, *[0.0] * (mujoco.mjNEQDATA - 2)],
        solref=[2 * spec.option.timestep, 1.0],
    )


def close_loops(spec: Any, prepared: PreparedRobot) -> None:
    """Hold points of links together, and how they are turned, as stiffly as the step allows.

    MuJoCo's `connect` takes the point of the first link, and finds that of the second at the
    model's own zero posture, where the loop is open. So two sites are held together.
    """
    kinds = mujoco.mjtEq
    for k, closure in enumerate(reduced(prepared)):
        names = []
        links = (closure.first, closure.second)
        for link, frame in zip(links, frames(prepared, closure), strict=True):
            names.append(f"closure {k} {link}")
            _named(spec.bodies, link).add_site(
                name=names[-1], pos=frame.position, quat=frame.quaternion
            )
        spec.add_equality(
            name=f"closure {k}",
            type=kinds.mjEQ_WELD if closure.rigid else kinds.mjEQ_CONNECT,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=names[0],
            name2=names[1],
            solref=[2 * spec.option.timestep, 1.0],
        )


def closed(model: Any, active: Any) -> list[tuple[FloatArray, bool]]:
    """The points of each active closure, held by two sites or, as with Newton, by two bodies with a
    point each, and whether it is a weld."""
    kinds = (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)
    loops = np.flatnonzero(np.isin(model.eq_type, kinds) & active)
    return [(_points(model, k), model.eq_type[k] == kinds[1]) for k in loops.tolist()]


def _points(model: Any, number: int) -> FloatArray:
    """What a closure holds together, (2, 3), each in the frame of its link [m]."""
    if model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE:
        sites = [model.eq_obj1id[number], model.eq_obj2id[number]]
        return np.array(model.site_pos[sites])
    return np.array(model.eq_data[number, :6]).reshape(2, 3)


def leave_out(model: Any, first: Sequence[int]) -> None:
    """Have the solver stop where it would without these bodies: its tolerance is relative to the
    mean inertia of all degrees of freedom.

    Args:
        first: degree of freedom of each heavy body.
    """
    light = np.delete(model.dof_M0, [dof + k for dof in first for k in range(6)])
    model.stat.meaninertia = light.mean() if len(light) else 1.0
