"""MuJoCo (Google DeepMind), through its Python bindings.

Drives are MuJoCo's own actuators, one a joint, with an affine bias: force = k (ctrl - q) - d v, so
velocity and effort feed-forward ride on the control: ctrl = q* + (d v* + tau_ff) / k. The
actuator's force range is the effort limit, so it bounds the whole sum.

What was learnt stands in docs/engines/mujoco.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.scene import (
    Body,
    Box,
    Capsule,
    ConvexMesh,
    Cylinder,
    FloatArray,
    Scene,
    Sphere,
)
from pytest_simbench.scene.overlap import rotations
from pytest_simbench.simulator import (
    Capability,
    DataSeen,
    Deviation,
    NotSupportedError,
    PreparedRobot,
    SeedsSeen,
    Seen,
    Settings,
    Simulator,
    SimulatorInfo,
    heavy,
    lazy_import,
)
from pytest_simbench.simulator.loops import reduced

from . import releases
from .bounces import BOUNCES, direct
from .heavy import leave_out
from .loops import close_loops
from .pictures import DISABLED, camera, renderer
from .readback import Numbers, ReadBack
from .self_collision import part_joined
from .touching import contact_forces, joint_wrenches

mujoco = lazy_import("mujoco")

ROBOT, WORLD, LED = 1, 2, 4
"""Collision groups: the robot's links touch everything but, unless asked, each other; prescribed
bodies touch what they can move."""

LINK_COLOUR, GROUND_COLOUR = (0.9, 0.9, 0.9, 1.0), (0.5, 0.5, 0.5, 1.0)


@dataclass(frozen=True)
class MuJoCoSettings(Settings):
    """MuJoCo's options; defaults are the engine's own but for the integrator.

    Attributes:
        timestep: [s]; MuJoCo's default is 0.002.
        integrator: `implicitfast` is what MuJoCo's documentation recommends where actuators have
            damping; the engine's default, Euler, treats theirs explicitly.
        cone: friction cone.
        impratio: ratio of friction to normal constraint impedance.
        condim: dimension of the contact space: 3 sliding, 4 with torsional friction.
        solref: time constant [s] and damping ratio of contacts.
        solimp: contact impedance: minimum, maximum, width [m].
        noslip_iterations: of the friction post-processing.
    """

    timestep: float = 0.002
    integrator: Literal["Euler", "implicit", "implicitfast", "RK4"] = "implicitfast"
    cone: Literal["pyramidal", "elliptic"] = "pyramidal"
    impratio: float = 1.0
    condim: Literal[3, 4, 6] = 3
    solref: tuple[float, float] = (0.02, 1.0)
    solimp: tuple[float, float, float] = (0.9, 0.95, 0.001)
    noslip_iterations: int = 0


class MuJoCo(Simulator):
    """Adapter of MuJoCo."""

    info: ClassVar[SimulatorInfo] = SimulatorInfo(
        name="mujoco",
        title="MuJoCo",
        distribution="mujoco",
        modules=("mujoco",),
        install="pip install 'pytest-simbench[mujoco]'",
        licence="Apache-2.0",
        engine="MuJoCo",
        language="C, C++",
        tested_version="4.0.0",
        oldest_version=releases.OLDEST,
        capabilities=frozenset(
            {
                Capability.WINDOW,
                Capability.OFFSCREEN,
                Capability.SAVE_RESTORE,
                Capability.EXACT_RESTORE,
                Capability.CONTACT_COUNT,
                Capability.CONTACT_FORCES,
                Capability.LOOPS,
                Capability.SELF_COLLIDE,
                Capability.JOINT_WRENCHES,
                Capability.DETERMINISTIC,
            }
        ),
        deviations=(
            Deviation("", "contacts are soft by design: cubes sink in and creep a little"),
            Deviation("", BOUNCES, only="restitution"),
        ),
        install_size_mb=60,
        environment=DISABLED,
    )
    profiles: ClassVar[Mapping[str, Settings]] = {
        "default": MuJoCoSettings(),
        "tuned": MuJoCoSettings(
            timestep=0.001,
            cone="elliptic",
            condim=4,
            solref=(0.002, 1.0),
            solimp=(0.99, 0.9999, 0.001),
        ),
        "real": MuJoCoSettings(
            timestep=0.001,
            cone="elliptic",
            condim=4,
            solref=(0.004, 2.0),
            solimp=(0.99, 0.9999, 0.001),
        ),
    }
    chosen_on: ClassVar[Mapping[str, tuple[Seen, ...]]] = {
        "tuned": (SeedsSeen("throwing", 1, 1), SeedsSeen("stacking", 1, 1)),
        "real": (
            SeedsSeen("throwing", 1, 1),
            SeedsSeen("stacking", 1, 1),
            DataSeen("cube_tosses", 0, 564, 6),
        ),
    }
    settings: MuJoCoSettings

    def load(self, scene: Scene) -> None:
        spec = mujoco.MjSpec()
        self.prepared = None
        if scene.robot is not None:
            self.prepared = PreparedRobot(scene.robot)
            spec = mujoco.MjSpec.from_string(_mujoco_urdf(self.prepared))
        self._set_options(spec, scene)
        if scene.robot is not None and self.prepared is not None:
            for geom in spec.geoms:
                links = ROBOT if scene.robot.self_collide else 0
                self._set_surface(geom, scene.robot.friction, 0.0, ROBOT, links)
                geom.rgba = LINK_COLOUR
            for joint in scene.robot.joints:
                _add_drive(spec, joint)
            for pair in scene.robot.gripper.couplings:
                _couple_fingers(spec, *pair)
            close_loops(spec, reduced(self.prepared))
            if scene.robot.self_collide:
                part_joined(spec, self.prepared)
        ground = spec.worldbody.add_geom(
            name="ground",
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[0, 0, 0.5],
            rgba=GROUND_COLOUR,
        )
        self._set_surface(
            ground, scene.ground_friction, scene.ground_restitution, WORLD, WORLD | ROBOT
        )
        self._heavy = heavy(scene)
        for part in scene.bodies:
            self._add_body(spec, part)
        spec.worldbody.add_light(pos=[0.5, 0, 3], dir=[0, 0, -1])
        self.model = model = spec.compile()
        model.vis.global_.offwidth, model.vis.global_.offheight = 1920, 1080
        self.data = data = mujoco.MjData(model)
        self.scene = scene

        joints = [model.joint(name) for name in (scene.robot.joint_names if scene.robot else ())]
        self._q = np.array([joint.qposadr[0] for joint in joints], dtype=int)
        self._v = np.array([joint.dofadr[0] for joint in joints], dtype=int)
        if scene.robot is not None:
            self._stiffness = scene.robot.column("stiffness")
            self._damping = scene.robot.column("damping")
            initial = scene.robot.column("initial_position")
            data.qpos[self._q] = initial
            data.ctrl[:] = initial
        free = [model.joint(f"{body.name}/free") for body in scene.free_bodies]
        self._body_q = np.array([j.qposadr[0] + np.arange(7) for j in free], int).reshape(-1, 7)
        self._body_v = np.array([j.dofadr[0] + np.arange(3) for j in free], int).reshape(-1, 3)
        self._body_ids = np.array([model.body(b.name).id for b in scene.free_bodies], dtype=int)
        for at, body in zip(self._body_v, scene.free_bodies, strict=True):
            data.qvel[at] = body.linear_velocity
            data.qvel[at + 3] = body.pose.rotation().T @ body.angular_velocity  # in its own frame
        for at, body in zip(self._body_v, scene.free_bodies, strict=True):
            if body.damping.any():
                model.dof_damping[at] = body.linear_damping * body.mass
                model.dof_damping[at + 3] = body.angular_damping * body.inertia()
        self._led = np.flatnonzero([body.prescribed for body in scene.free_bodies])
        mujoco.mj_forward(model, data)
        if len(self._led):
            leave_out(model, self._body_v[self._led, 0])
        self._viewer: Any = None
        self._renderer: Any = None
        if self.gui:
            self._open_window()

    def _set_options(self, spec: Any, scene: Scene) -> None:
        s, option = self.settings, spec.option
        option.timestep = s.timestep
        option.integrator = getattr(mujoco.mjtIntegrator, _INTEGRATORS[s.integrator])
        option.cone = getattr(mujoco.mjtCone, f"mjCONE_{s.cone.upper()}")
        option.impratio = s.impratio
        option.noslip_iterations = s.noslip_iterations
        option.gravity = scene.gravity
        # On a state that is not finite MuJoCo would start over from its initial state, silently.
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET

    def _set_surface(
        self, geom: Any, friction: float, restitution: float, group: int, touches: int
    ) -> None:
        geom.friction[0] = friction
        geom.condim = self.settings.condim
        bouncing = restitution and direct(restitution, self.settings.timestep)
        geom.solref[:2] = bouncing or self.settings.solref
        geom.solimp[:3] = self.settings.solimp
        geom.contype, geom.conaffinity = group, touches

    def _add_body(self, spec: Any, part: Body) -> None:
        body = spec.worldbody.add_body(
            name=part.name, pos=part.pose.position, quat=part.pose.quaternion
        )
        kind, size = _geom(part)
        mesh = {}
        if isinstance(part, ConvexMesh):
            spec.add_mesh(name=f"{part.name}/mesh", uservert=np.ravel(part.vertices))
            mesh = {"meshname": f"{part.name}/mesh"}
        geom = body.add_geom(
            name=part.name,
            type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"),
            size=[*size, 0.0, 0.0, 0.0][:3],
            rgba=part.colour,
            **mesh,
        )
        self._set_surface(geom, part.friction, part.restitution, WORLD, WORLD | ROBOT)
        if not isinstance(part, Box | ConvexMesh):
            # contacts of a round shape neither roll nor spin with friction
            geom.condim, geom.priority = 3, 1
        if part.prescribed:
            geom.contype, geom.conaffinity = LED, ROBOT
            _set_inertia(body, self._heavy, (self._heavy,) * 3)
            body.gravcomp = 1.0
            body.add_freejoint(name=f"{part.name}/free")
        elif not part.fixed:
            geom.conaffinity |= LED
            geom.mass = part.mass
            if part.moments is not None or mesh:
                _set_inertia(body, part.mass, part.inertia().tolist())
            body.add_freejoint(name=f"{part.name}/free")

    def read_back(self) -> dict[str, Any]:
        return ReadBack(self.model, self.data, self.scene, self.prepared, self._numbers()).all()

    def _numbers(self) -> Numbers:
        model, prepared = self.model, self.prepared
        return Numbers(
            model.geom("ground").id,
            {box.name: model.geom(box.name).id for box in self.scene.bodies},
            {} if prepared is None else {name: model.body(name).id for name in prepared.links},
            {}
            if prepared is None
            else {name: model.joint(name).id for name in prepared.robot.joint_names},
        )

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        self.data.ctrl[:] = position + (self._damping * velocity + effort) / self._stiffness

    def push(self, wrenches: FloatArray) -> None:
        self.data.xfrc_applied[self._body_ids] = wrenches

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        self.data.qpos[self._body_q[self._led]] = before[:, :7]
        self.data.qvel[self._body_v[self._led]] = before[:, 7:10]
        spins = np.einsum("nij,ni->nj", rotations(before[:, 3:7]), before[:, 10:])
        self.data.qvel[self._body_v[self._led] + 3] = spins  # in its own frame

    def step(self) -> None:
        mujoco.mj_step(self.model, self.data)

    @property
    def time(self) -> float:
        return float(self.data.time)

    def body_state(self) -> FloatArray:
        state = np.empty((len(self._body_q), 13))
        state[:, :7] = self.data.qpos[self._body_q]
        state[:, 7:10] = self.data.qvel[self._body_v]
        local = self.data.qvel[self._body_v + 3]
        state[:, 10:] = np.einsum("nij,nj->ni", rotations(state[:, 3:7]), local)
        return state

    def joint_state(self) -> FloatArray:
        return np.stack([self.data.qpos[self._q], self.data.qvel[self._v]])

    def save(self) -> FloatArray:
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(self.model, kind))
        mujoco.mj_getState(self.model, self.data, state, kind)
        return state

    def restore(self, state: FloatArray) -> None:
        mujoco.mj_setState(self.model, self.data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_forward(self.model, self.data)

    def contact_forces(self) -> Iterator[tuple[str, str, FloatArray]]:
        return contact_forces(self.model, self.data, self._numbers())

    def joint_wrenches(self) -> FloatArray:
        return joint_wrenches(self.model, self.data, self._numbers())

    def contact_count(self) -> int:
        return int(self.data.ncon)

    def render(self, width: int, height: int) -> NDArray[np.uint8]:
        if self._renderer is None or (self._renderer.width, self._renderer.height) != (
            width,
            height,
        ):
            self._renderer = renderer(mujoco, self.model, width, height)
        self._renderer.update_scene(self.data, camera(mujoco))
        return np.array(self._renderer.render())

    def _open_window(self) -> None:
        import mujoco.viewer

        self._viewer = mujoco.viewer.launch_passive(
            self.model, self.data, show_left_ui=False, show_right_ui=False
        )
        view = camera(mujoco)
        with self._viewer.lock():
            for name in ("lookat", "distance", "azimuth", "elevation"):
                setattr(self._viewer.cam, name, getattr(view, name))

    def refresh_window(self) -> None:
        if self._viewer is not None:
            self._viewer.sync()

    def close(self) -> None:
        for name in ("_renderer", "_viewer"):
            opened = getattr(self, name, None)  # not even None, when loading failed before
            if opened is not None:
                opened.close()


_INTEGRATORS = {
    "Euler": "mjINT_EULER",
    "RK4": "mjINT_RK4",
    "implicit": "mjINT_IMPLICIT",
    "implicitfast": "mjINT_IMPLICITFAST",
}


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


def _mujoco_urdf(prepared: PreparedRobot) -> str:
    """The reduced URDF with MuJoCo's compiler element: paths kept, visuals dropped."""
    compiler = (
        '<mujoco><compiler strippath="false" discardvisual="true" fusestatic="false"/></mujoco>'
    )
    return prepared.to_urdf().replace("</robot>", f"{compiler}</robot>")


def _add_drive(spec: Any, joint: Any) -> None:
    drive = spec.add_actuator(
        name=joint.name,
        target=joint.name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        forcelimited=True,
        forcerange=[-joint.effort_limit, joint.effort_limit],
    )
    drive.gainprm[0] = joint.stiffness
    drive.biasprm[1], drive.biasprm[2] = -joint.stiffness, -joint.damping
    releases.joint(spec, joint.name).armature = joint.armature


def _couple_fingers(spec: Any, first: str, second: str) -> None:
    """Hold two fingers at equal positions, by a constraint as stiff as the step allows."""
    spec.add_equality(
        type=mujoco.mjtEq.mjEQ_JOINT,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        name1=second,
        name2=first,
        data=releases.equality_data(mujoco, [0.0, 1.0]),
        solref=[2 * spec.option.timestep, 1.0],
    )
