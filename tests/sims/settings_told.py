"""What an engine says of its own settings, by the names of the adapter's options.

Workers load the adapters from here as `tests.sims.settings_told:NAME`, with an engine's name. Their
`read_back` tells the settings instead of the scene, so that it also works for an engine with an
interpreter of its own. For the same reason nothing but the adapter is imported.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.scene import Scene
from pytest_simbench.simulator import Simulator

Told = dict[str, Any]


def one(values: Iterable[Any]) -> Any:
    """What all values are; all of them where they differ."""
    found = np.unique(np.array(list(values)), axis=0).tolist()
    return found[0] if len(found) == 1 else found


def of_mujoco(model: Any) -> Told:
    import mujoco

    return {
        "timestep": model.opt.timestep,
        "integrator": mujoco.mjtIntegrator(model.opt.integrator).name.removeprefix("mjINT_"),
        "solver": mujoco.mjtSolver(model.opt.solver).name.removeprefix("mjSOL_"),
        "iterations": model.opt.iterations,
        "cone": mujoco.mjtCone(model.opt.cone).name.removeprefix("mjCONE_"),
        "impratio": model.opt.impratio,
        "noslip_iterations": model.opt.noslip_iterations,
        "condim": one(model.geom_condim),
        "solref": one(model.geom_solref),
        "solimp": one(model.geom_solimp[:, :3]),
    }


def told_mujoco(s: Any) -> Told:
    return of_mujoco(s.model)


def told_newton(s: Any) -> Told:
    import mujoco

    model = s.solver.mj_model
    told = of_mujoco(model)
    time, ratio = told.pop("solref")
    del told["noslip_iterations"]
    ke = (1 / (time * ratio)) ** 2
    multiccd = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_MULTICCD
    more = {"kd": 2 / time, "ke": ke, "gap": one(model.geom_gap), "multiccd": multiccd}
    return told | more


def told_pybullet(s: Any) -> Told:
    import pybullet

    told = pybullet.getPhysicsEngineParameters(physicsClientId=s.client)
    spins = [pybullet.getDynamicsInfo(s._bodies[name], -1, s.client)[7] for name in s._bodies]
    return {
        "timestep": told["fixedTimeStep"],
        "solver_iterations": told["numSolverIterations"],
        "spinning_friction": one(spins),
    }


def told_sapien(s: Any) -> Told:
    config, links, free = s._system.config, s._robot.links, s._free
    shapes = [shape for body in (s._ground, *free, *links) for shape in body.collision_shapes]
    return {
        "timestep": s._system.timestep,
        "position_iterations": one(b.solver_position_iterations for b in (*free, s._robot)),
        "velocity_iterations": one(b.solver_velocity_iterations for b in (*free, s._robot)),
        "tgs": config.enable_tgs,
        "pcm": config.enable_pcm,
        "friction_every_iteration": config.enable_friction_every_iteration,
        "enhanced_determinism": config.enable_enhanced_determinism,
        "bounce_threshold": config.bounce_threshold,
        "contact_offset": one(shape.contact_offset for shape in shapes),
        "sleep_threshold": one(b.sleep_threshold for b in (*free, s._robot)),
        "angular_damping": one(body.angular_damping for body in free),
        "link_damping": one(
            [*(x.linear_damping for x in links), *(x.angular_damping for x in links)]
        ),
        "joint_friction": one(joint.friction for joint in s._robot.active_joints),
    }


def told_drake(s: Any) -> Told:
    plant, graph = s.plant, s.scene_graph
    inspector = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(s.root)).inspector()
    shapes = {name: [inspector.GetShape(i) for i in ids] for name, ids in s.world.shapes.items()}
    surfaces = [inspector.GetProximityProperties(i) for ids in s.world.shapes.values() for i in ids]

    def surface(group: str, name: str) -> Any:
        return one(float(p.GetProperty(group, name)) for p in surfaces)

    def radius(name: str) -> Any:
        spheres = [shape.radius() for shape in shapes[name] if type(shape).__name__ == "Sphere"]
        return one(spheres) if spheres else 0.0

    names = {"kHydroelastic": "hydroelastic", "kPoint": "point"}
    model = plant.get_contact_model().name
    return {
        "timestep": plant.time_step(),
        "contact_model": names.get(model, "hydroelastic_with_fallback"),
        "approximation": plant.get_discrete_contact_approximation().name[1:].lower(),
        "near_rigid_threshold": plant.get_sap_near_rigid_threshold(),
        "compliance": graph.get_config().default_proximity_properties.compliance_type,
        "hydroelastic_modulus": surface("hydroelastic", "hydroelastic_modulus"),
        "point_stiffness": surface("material", "point_contact_stiffness"),
        "hunt_crossley_dissipation": surface("material", "hunt_crossley_dissipation"),
        "relaxation_time": surface("material", "relaxation_time"),
        "corner_radius": radius("late"),
        "pad_radius": radius("panda_leftfinger"),
        "shrink": (0.05 - shapes["late"][-1].width()) / 2,
    }


def told_dart(s: Any) -> Told:
    solver = s.world.getConstraintSolver()
    inner = solver.getBoxedLcpSolver()
    told = {
        "timestep": solver.getTimeStep(),
        "detector": solver.getCollisionDetector().getType(),
        "solver": type(inner)
        .__name__.removesuffix("FrictionSolver")
        .removesuffix("BoxedLcpSolver"),
        "sleeping": s.world.getDeactivationOptions().mEnabled,
        "split_impulse": solver.isSplitImpulseEnabled(),
    }
    if s.settings.solver == "nsgs":
        options = inner.getOptions()
        told |= {"sweeps": options.maxSweeps, "tolerance": options.tolerance}
    return told


def told_ode(s: Any) -> Told:
    import ode
    from pytest_simbench.sims.ode.library import SOFTNESS, VELOCITY, body_id, library

    joint, seen, start = s.contacts._joint, [], s.body_state()
    s.contacts._joint = lambda *given: (seen.append(given[-1]), joint(*given))[1]
    position = s.joint_state()[0]
    s.command(position + 0.01, 0 * position, 0 * position)
    s.step()
    axis = s._axes[s.scene.robot.joint_names[0]]
    asked = axis.joint.getParam(VELOCITY) / 0.01
    hard = axis.joint.getParam(SOFTNESS) == s.world.getCFM()
    soft = [contact.getMode() & ode.ContactSoftERP for contact in seen]
    away = [contact.getMode() & ode.ContactFDir1 for contact in seen]
    flying = [body.name for body in s.scene.free_bodies].index("late")
    fallen = s.body_state()[flying, 9] - start[flying, 9]
    return {
        "timestep": fallen / s.scene.gravity[2],
        "iterations": s.world.getQuickStepNumIterations(),
        "erp": s.world.getERP(),
        "cfm": s.world.getCFM(),
        "contact_erp": seen[0].getSoftERP() if all(soft) else s.world.getERP(),
        "contact_cfm": seen[0].getSoftCFM() if all(soft) else s.world.getCFM(),
        "friction": "slip" if any(away) else "pyramid",
        "drive": "velocity" if hard else "spring",
        "position_gain": asked if hard else s.settings.position_gain,
        "sleeping": one(library().dBodyGetAutoDisableFlag(body_id(body)) for body in s._free),
    }


def told_genesis(s: Any) -> Told:
    from pytest_simbench.sims.genesis.engine import array_of

    solver, kinds = s.solver, s.solver.rigid_config
    contacts = array_of(solver.dyn_info.geoms.sol_params)
    numbers = ("iterations", "tolerance", "noslip_iterations", "impratio")
    told = {name: array_of(getattr(solver.rigid_info, name)).item() for name in numbers}
    step = array_of(solver.rigid_info.substep_dt).item()
    return told | {
        "timestep": step * s.world.sim.substeps,
        "substeps": s.world.sim.substeps,
        "precision": str(8 * array_of(solver.rigid_info.qpos).itemsize),
        "integrator": kinds.integrator.name,
        "friction_cone": "elliptic" if kinds.enable_elliptic_friction else "pyramidal",
        "constraint_timeconst": one(contacts[:, 0]),
        "impedance": one(contacts[:, 2:4]),
        "box_box_detection": kinds.box_box_detection,
        "gjk": solver.collider._collider_static_config.ccd_algorithm.name != "MPR",
    }


def told_gazebo(s: Any) -> Told:
    """What the world's text says: Gazebo tells none of it. The gain is its drives'."""
    from tempfile import TemporaryDirectory

    from pytest_simbench.sims.gazebo.sdf import world_text

    with TemporaryDirectory() as folder:
        text = world_text(s.scene, s.prepared, s._physics, "told", Path(folder))

    def said(pattern: str) -> Any:
        return one(re.findall(pattern, text))

    told = {
        "timestep": float(said("<max_step_size>(.*?)<")),
        "engine": said("gz-physics-(.*?)-plugin"),
        "detector": said("<collision_detector>(.*?)<"),
        "solver": said("<solver_type>(.*?)<"),
        "position_gain": one(s._drives._gain * s.settings.timestep),
    }
    if "<torsional>" in text:
        told["torsional_friction"] = float(said(r"<torsional>\s*<coefficient>(.*?)<"))
    return told


def read(token: str) -> Any:
    """A value of a USD stage."""
    words: dict[str, Any] = {"true": True, "false": False}
    return words[token] if token in words else token[1:-1] if token[0] == '"' else float(token)


def told_coppeliasim(s: Any) -> Told:
    """The gain is its drives'."""
    from pytest_simbench.sims.coppeliasim import drives, library, world

    kind = library.get_integers(library.SCENE, "dynamicsEngine")
    modes = {library.get_int(handle, "dynCtrlMode") for handle in s._drives.handles}
    told = {
        "timestep": library.get_float(library.SCENE, "dynamicsStepSize"),
        "engine": next(name for name, (pair, _) in library.ENGINES.items() if pair == kind),
        "drive": one(name for name, mode in drives.MODES.items() if mode in modes),
        "position_gain": s._drives.settings.position_gain,
        "iterations": library.get_int(library.SCENE, "bullet.iterations"),
        "cone": world.CONES[library.get_int(library.SCENE, "mujoco.cone")],
    }
    handle = s._bodies["late"].handle
    if told["engine"] == "bullet":
        told["sticky"] = library.get_bool(handle, "bullet.stickyContact")
    if told["engine"] == "mujoco":
        told["solref"] = library.get_floats(handle, "mujoco.solref").tolist()
        told["solimp"] = library.get_floats(handle, "mujoco.solimp")[:3].tolist()
    return told


def told_ovphysx(s: Any) -> Told:
    """What the stage says, in its words. PhysX tells little; that it heeds it, the motion shows."""
    import ovphysx
    from ovphysx.types import GlobalConfigKey

    told = {}
    for name, attribute in STAGE.items():
        found = re.findall(rf"{attribute} = (.*)", s._text)
        told[name] = one(map(read, found)) if found else None
    told["sleeping"] = not told["sleeping"]
    iterations = re.findall(r"(\w+):solverPositionIterationCount = (.*)", s._text)
    for name, prefix in (("body", "physxRigidBody"), ("arm", "physxArticulation")):
        told[f"{name}_iterations"] = one(
            int(value) for found, value in iterations if found == prefix
        )
    threads = ovphysx.get_global_config(GlobalConfigKey.NUM_THREADS)
    return told | {"threads": threads}


STAGE = {
    "solver": "physxScene:solverType",
    "sleeping": "physxScene:disableSleeping",
    "friction_offset_threshold": "physxScene:frictionOffsetThreshold",
    "friction_correlation_distance": "physxScene:frictionCorrelationDistance",
    "forces_every_iteration": "physxScene:enableExternalForcesEveryIteration",
    "contact_last": "physxScene:solveArticulationContactLast",
    "velocity_iterations": "solverVelocityIterationCount",
    "linear_damping": "linearDamping",
    "angular_damping": "angularDamping",
    "max_depenetration_velocity": "maxDepenetrationVelocity",
    "contact_offset": "contactOffset",
    "rest_offset": "restOffset",
}


def tell(s: Any) -> Told:
    return globals()[f"told_{s.info.name}"](s)


def in_numbers(s: Any) -> Told:
    """The same as bytes of JSON: a worker lets nothing but numbers through."""
    text = json.dumps(tell(s), default=lambda value: value.item())
    return {"told": [float(byte) for byte in text.encode()]}


def compile_(s: Any, scene: Scene) -> None:
    """What loading takes, without a step: no other option is compiled in vain."""
    s.load(scene)
    s.close()


def __getattr__(name: str) -> type[Simulator]:
    """The adapter of an engine, for a worker."""
    if name.startswith("_"):
        raise AttributeError(name)
    module = import_module(f"pytest_simbench.sims.{name}.adapter")
    cls = next(
        kind
        for kind in vars(module).values()
        if isinstance(kind, type)
        and issubclass(kind, Simulator)
        and kind.__module__ == module.__name__
    )
    return type(
        name, (cls,), {"read_back": in_numbers, "compile": compile_, "__module__": __name__}
    )
