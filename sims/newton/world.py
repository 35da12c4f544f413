"""The scene as a model of Newton and a solver for it."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import Any

import numpy as np

from pytest_simbench.description.links import frames, reduced
from pytest_simbench.scene import (
    Body,
    Box,
    Capsule,
    ConvexMesh,
    Cylinder,
    Joint,
    Pose,
    Scene,
    Sphere,
)
from pytest_simbench.simulator import PreparedRobot, heavy, lazy_import

from ..mujoco.world import gain, shape_label
from .settings import NewtonSettings

newton = lazy_import("newton")
wp = lazy_import("warp")
mujoco = lazy_import("mujoco")


def build_model(scene: Scene, prepared: PreparedRobot | None, settings: NewtonSettings) -> Any:
    """Newton's model of the scene, on the CPU; labels are the scene's names."""
    builder = newton.ModelBuilder(gravity=scene.gravity)
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    if prepared is not None:
        _add_robot(builder, prepared, _surface(prepared.robot.friction, settings))
    builder.add_ground_plane(cfg=_surface(scene.ground_friction, settings), label="ground")
    for body in scene.bodies:
        _add_body(builder, body, _surface(body.friction, settings), heavy(scene))
    for first, second in scene.apart:
        for pair in product(_shapes(builder, scene, first), _shapes(builder, scene, second)):
            builder.add_shape_collision_filter_pair(*pair)
    model = builder.finalize(device="cpu")
    # What MuJoCo needs of a contact beyond Newton's own parameters.
    model.mujoco.condim.fill_(settings.condim)
    for body in scene.bodies:
        for k, part in enumerate(body.parts):
            if not isinstance(part, Box | ConvexMesh):
                # as in MuJoCo's own world
                shape = model.shape_label.index(shape_label(body, k))
                model.mujoco.condim.numpy()[shape] = 3
                model.mujoco.geom_priority.numpy()[shape] = body.friction == max(scene.frictions)
    model.mujoco.geom_solimp.numpy()[:] = (*settings.solimp, 0.5, 2.0)
    return model


def make_solver(model: Any, prepared: PreparedRobot | None, settings: NewtonSettings) -> Any:
    """SolverMuJoCo with MuJoCo's C code, and what Newton has no parameters for."""
    solver = newton.solvers.SolverMuJoCo(
        model,
        use_mujoco_cpu=True,
        integrator=settings.integrator,
        cone=settings.cone,
        impratio=settings.impratio,
        enable_multiccd=settings.multiccd,
    )
    options = solver.mj_model.opt
    options.timestep = settings.timestep
    options.solver = getattr(mujoco.mjtSolver, f"mjSOL_{settings.solver.upper()}")
    options.iterations = settings.iterations
    # On a state that is not finite MuJoCo would start over from its initial state, silently.
    options.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    # Couplings, loops and the friction of joints, as stiff as the step allows.
    stiffest = 2 * settings.timestep, 1.0
    solver.mj_model.eq_solref[:] = solver.mj_model.dof_solref[:] = stiffest
    # Newton's own stops (10 kN m/rad, 10 N m s/rad) give a lever of 5 kg half of its way back.
    solver.mj_model.jnt_solref[:] = STOPS
    if prepared is not None:
        _set_points(solver.mj_model, prepared)
    return solver


def _set_points(model: Any, prepared: PreparedRobot) -> None:
    """MuJoCo finds a closure's point of the second link, and a weld's turn, at its own zero
    posture, where the loop is open. So the scene's are written."""
    kinds = (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)
    loops = np.isin(model.eq_type, kinds) & (model.eq_active0 != 0)  # free bodies have idle welds
    for number, closure in zip(np.flatnonzero(loops), reduced(prepared), strict=True):
        model.eq_data[number, 3:6] = closure.second_point
        if closure.rigid:
            model.eq_data[number, :3] = closure.first_point
            model.eq_data[number, 6:10] = frames(prepared, closure)[1].quaternion


STOPS = (0.02, 1.0)
"""Time constant [s] and damping ratio of the end of a joint's range: MuJoCo's own."""


def names(paths: list[str]) -> list[str]:
    """Names without the robot's, which Newton puts before those of its links and joints."""
    return [path.rpartition("/")[2] for path in paths]


def _surface(friction: float, settings: NewtonSettings) -> Any:
    """A shape's settings, with its mass left to the body that it belongs to."""
    return newton.ModelBuilder.ShapeConfig(
        mu=friction, ke=settings.ke, kd=settings.kd, gap=settings.gap, density=0.0
    )


def _add_robot(builder: Any, prepared: PreparedRobot, surface: Any) -> None:
    robot = prepared.robot
    builder.default_shape_cfg = surface
    builder.add_urdf(
        prepared.to_urdf(),
        parse_visuals_as_colliders=True,
        enable_self_collisions=robot.self_collide,  # but for links that a joint joins
    )
    builder.default_shape_cfg = newton.ModelBuilder.ShapeConfig()
    joints = names(builder.joint_label)
    for joint in robot.joints:
        _set_drive(builder, joints.index(joint.name), joint)
    links = names(builder.body_label)
    shares = {links.index(name): 1.0 - share for name, share in prepared.gravity.items()}
    builder.custom_attributes["mujoco:gravcomp"].values = shares
    for closure in reduced(prepared):
        first, second = links.index(closure.first), links.index(closure.second)
        if closure.rigid:  # a weld's data begin with the point of what it names second
            newton.solvers.mujoco.add_equality_weld(builder, second, first)
        else:
            newton.solvers.mujoco.add_equality_connect(
                builder, first, second, anchor=wp.vec3(*closure.first_point)
            )
    for pair in (*robot.gripper.couplings, *robot.couplings):
        newton.solvers.mujoco.add_equality_joint(
            builder,
            joints.index(pair.follower),
            joints.index(pair.leader),
            polycoef=(pair.offset, pair.ratio),
        )


def _shapes(builder: Any, scene: Scene, name: str) -> Iterable[int]:
    """Newton's numbers of the shapes of "ground", `body/NAME` or `link/NAME`."""
    kind, _, rest = name.partition("/")
    if kind == "link":
        shapes: list[int] = builder.body_shapes[names(builder.body_label).index(rest)]
        return shapes
    body = scene.body(rest) if rest else None
    labels = [shape_label(body, k) for k in range(len(body.parts))] if body else [name]
    return map(builder.shape_label.index, labels)


def _add_body(builder: Any, part: Body, surface: Any, most: float) -> None:
    pose, body = part.pose, -1
    if not part.fixed:
        inertial: dict[str, Any] = {}
        if part.prescribed:
            inertial = {"mass": most, "inertia": wp.mat33(most * np.eye(3))}
        elif part.moments is None and not isinstance(part, ConvexMesh):
            surface.density = part.mass / part.volume
        else:
            inertial = {"mass": part.mass, "inertia": wp.mat33(np.diag(part.inertia()))}
        body = builder.add_body(xform=_transform(pose), label=part.name, **inertial)
        pose = Pose()
        start = builder.joint_qd_start[builder.joint_child.index(body)]
        builder.joint_qd[start : start + 6] = map(float, part.velocity)
    for k, shape in enumerate(part.parts):
        _add_shape(builder, body, shape, pose * shape.pose, surface, shape_label(part, k))


def _add_shape(builder: Any, body: int, part: Body, pose: Pose, surface: Any, label: str) -> None:
    at = None if pose == Pose() else _transform(pose)
    given = {"xform": at, "cfg": surface, "color": part.colour[:3], "label": label}
    match part:
        case Box():
            hx, hy, hz = (edge / 2 for edge in part.size)
            builder.add_shape_box(body, hx=hx, hy=hy, hz=hz, **given)
        case Sphere():
            builder.add_shape_sphere(body, radius=part.radius, **given)
        case Cylinder():
            builder.add_shape_cylinder(
                body, radius=part.radius, half_height=part.length / 2, **given
            )
        case Capsule():
            builder.add_shape_capsule(
                body, radius=part.radius, half_height=part.length / 2, **given
            )
        case ConvexMesh():
            corners = np.array(part.vertices, dtype=np.float32)
            mesh = newton.Mesh(corners, np.ravel(part.hull.triangles), compute_inertia=False)
            builder.add_shape_convex_hull(body, mesh=mesh, **given)


def _transform(pose: Pose) -> Any:
    w, x, y, z = pose.quaternion
    return wp.transform(pose.position, wp.quat(x, y, z, w))


def _set_drive(builder: Any, number: int, joint: Joint) -> None:
    dof = builder.joint_qd_start[number]
    builder.joint_target_mode[dof] = newton.JointTargetMode.NONE
    builder.joint_armature[dof] = joint.armature
    builder.joint_damping[dof], builder.joint_friction[dof] = joint.passive_damping, joint.friction
    coordinate = builder.joint_q_start[number]
    builder.joint_stiffness[dof], builder.joint_rest_q[coordinate] = joint.spring, joint.rest
    builder.joint_q[coordinate] = joint.initial_position
    drives = newton.solvers.mujoco
    told = gain(joint.stiffness)
    drives.add_actuator_general(
        builder,
        drives.ActuatorTarget.joint(number),
        biastype="affine",
        gainprm=(told,),
        biasprm=(0.0, -joint.stiffness, -joint.damping),
        forcerange=(-joint.effort_limit, joint.effort_limit),
        ctrl=joint.stiffness / told * joint.initial_position,
    )
