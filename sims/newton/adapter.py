"""Newton (NVIDIA, Google DeepMind, Disney Research), on the CPU.

Newton is a builder of worlds and a set of solvers over them. The one here is SolverMuJoCo with
MuJoCo's C implementation: Newton's model is converted once, and each step copies Newton's state
(single precision) into MuJoCo, steps that, and copies back.

Drives are the actuators of SolverMuJoCo (`newton.solvers.mujoco`), told as in MuJoCo's adapter.
Newton's own joint targets obey the same law but when they saturate: they are clipped at the joint,
where MuJoCo's implicit integrator does not see it and goes on damping the drive. Joint 1 of the
Panda then gains 58 % of the momentum that its effort limit allows.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.scene import Body, FloatArray, Scene, rotation_matrix
from pytest_simbench.simulator import (
    Capability,
    Deviation,
    Simulator,
    SimulatorInfo,
    heavy,
    lazy_import,
)

from ..mujoco.bounces import BOUNCES, direct
from ..mujoco.own_file import FileReadBack, loaded
from ..mujoco.pictures import DISABLED, camera, renderer
from ..mujoco.readback import Numbers, ReadBack, contact_forces, joint_wrenches
from ..mujoco.settings import FileSettings
from ..mujoco.world import MOST, ROUND, gain, leave_out, shape_label
from .own_file import NewtonFile
from .settings import CHOSEN_ON, PROFILES, NewtonSettings
from .world import build_model, make_solver, names

LED = 1 << 20
"""Collision group of prescribed bodies, which Newton gives nobody."""

newton = lazy_import("newton")
wp = lazy_import("warp")
mujoco = lazy_import("mujoco")


class Newton(Simulator):
    """Adapter of Newton."""

    info = SimulatorInfo(
        name="newton",
        title="Newton",
        distribution="newton",
        modules=("newton", "mujoco_warp", "pyglet", "trimesh"),
        install="simbench install newton",
        licence="Apache-2.0",
        engine="MuJoCo",
        language="Python (Warp), C",
        tested_version="1.8.0",
        oldest_version="1.8.0",  # older ones have no `newton.solvers.mujoco`: no actuators
        friction_rule="maximum",
        capabilities=Capability.named(
            "window offscreen save_restore exact_restore contact_count contact_forces compound "
            "joint_wrenches loops couplings apart self_collide deterministic"
        ),
        deviations=(
            Deviation("", "contacts are soft by design: cubes sink in and creep a little"),
            Deviation("", BOUNCES, only="restitution"),
            Deviation("", ROUND, only="frictions"),
            Deviation("", "the state is kept in single precision between steps"),
        ),
        costly_start=True,
        compile_timeout=900.0,
        requirements=(
            "newton==1.8.0",
            "warp-lang==1.19.0",
            "mujoco==3.17.0",
            "mujoco-warp==3.17.0",
            "numpy==2.4.6",
            "scipy==1.17.1",
            "trimesh==5.2.0",
            "pyglet==2.1.19",
            "pillow==13.0.0",
        ),
        companions={"1.8": ("newton[sim]", "numpy", "trimesh", "pyglet", "pillow")},
        caches={"WARP_CACHE_PATH": "warp"},
        install_size_mb=900,
        environment=DISABLED,
    )
    profiles = PROFILES
    chosen_on = CHOSEN_ON
    settings: NewtonSettings

    _own_file: NewtonFile | None = None
    _ctrl: Any = None
    _compiled: ClassVar[set[bool]] = set()

    def compile(self, scene: Scene) -> None:
        """Load the world once and step it: Warp then has every kernel, on disk and in memory.

        Scenes with a robot need more kernels than scenes without; a process does each kind once.
        """
        kind = scene.robot is not None
        if kind not in Newton._compiled:
            self.load(scene)
            self.step()
            self.close()
            Newton._compiled.add(kind)

    def load(self, scene: Scene) -> None:
        self.begin(scene)
        wp.config.log_level = wp.LOG_WARNING
        self._viewer: Any = None
        if isinstance(self.settings, FileSettings):
            self._load_file(scene)
        else:
            self._build(scene)
        if self.gui:
            self._open_window()

    def _load_file(self, scene: Scene) -> None:
        self._own_file = own = NewtonFile(scene, self.settings.timestep)
        self.model, self.solver = own.imported, own.solver
        self._states, self._free, self._control = own.states, own.free, own.imported.control()
        loaded(self, own)

    def _build(self, scene: Scene) -> None:
        self.model = build_model(scene, self.prepared, self.settings)
        self._number(scene)
        self.solver = make_solver(self.model, self.prepared, self.settings)
        self._set_mujoco(scene)
        self._states = [self.model.state(), self.model.state()]
        self._control = self.model.control()
        ctrl = self._control.mujoco.ctrl if scene.robot is not None else None
        self._ctrl = None if ctrl is None else ctrl.numpy()  # a view: the device is the CPU
        for state in self._states:
            newton.eval_fk(self.model, self.model.joint_q, self.model.joint_qd, state)
        self._show_mujoco_the_start()

    def _set_mujoco(self, scene: Scene) -> None:
        """Restitution and damping of bodies, which only MuJoCo's own model holds."""
        model = self.solver.mj_model
        bouncing = [(self._geoms(body), body.restitution) for body in scene.bodies]
        for geoms, restitution in [*bouncing, ([self._geom("ground")], scene.ground_restitution)]:
            if restitution:
                model.geom_solref[geoms] = direct(restitution, self.settings.timestep)
        for body in scene.free_bodies:
            if body.damping.any():
                at = model.body_dofadr[model.geom_bodyid[self._geom(body.name)]]
                model.dof_damping[at : at + 3] = body.linear_damping * body.mass
                model.dof_damping[at + 3 : at + 6] = body.angular_damping * body.inertia()

        if led := scene.prescribed_bodies:
            geoms = [geom for body in led for geom in self._geoms(body)]
            moving = model.body_dofnum[model.geom_bodyid] > 0
            model.geom_conaffinity[moving] |= LED  # they touch what they can move
            model.geom_contype[geoms], model.geom_conaffinity[geoms] = LED, 0
            heavy_bodies = dict.fromkeys(model.geom_bodyid[geoms].tolist())
            leave_out(model, [model.body_dofadr[body] for body in heavy_bodies])

    def _show_mujoco_the_start(self) -> None:
        """Newton hands its state to MuJoCo only in `step`; it may be looked at before."""
        model, data = self.solver.mj_model, self.solver.mj_data
        data.qpos[model.jnt_qposadr[self._mujoco_joints()]] = self.model.joint_q.numpy()[self._q]
        numbers = self.solver.mjc_body_to_newton.numpy()[0].tolist()
        for body in self._free:
            number, velocity = numbers.index(body), self._states[0].body_qd.numpy()[body]
            at, turn = model.body_dofadr[number], self._rotation(body)
            data.qvel[at : at + 3], data.qvel[at + 3 : at + 6] = velocity[:3], velocity[3:] @ turn
        mujoco.mj_forward(model, data)

    def _rotation(self, body: int) -> FloatArray:
        """Rotation matrix of a body; Newton's quaternions end with w."""
        return rotation_matrix(np.roll(self._states[0].body_q.numpy()[body, 3:], 1))

    def _mujoco_joints(self) -> list[int]:
        """MuJoCo's numbers of the driven joints."""
        numbers = self.solver.mjc_jnt_to_newton_jnt.numpy()[0].tolist()
        return [numbers.index(joint) for joint in self._joints]

    def _number(self, scene: Scene) -> None:
        """Where Newton's arrays hold the driven joints and the free bodies."""
        model = self.model
        labels = names(model.joint_label)
        driven = scene.robot.joint_names if scene.robot else ()
        self._joints = joints = np.array([labels.index(name) for name in driven], dtype=int)
        self._q = model.joint_q_start.numpy()[joints]
        self._v = model.joint_qd_start.numpy()[joints]
        led = [model.body_label.index(body.name) for body in scene.prescribed_bodies]
        children = model.joint_child.numpy().tolist()
        self._led = led, [children.index(body) for body in led]
        self._free = [model.body_label.index(body.name) for body in scene.free_bodies]
        if scene.robot is not None:
            self._gain = gain(stiffness := scene.robot.column("stiffness"))
            self._share, self._damping = stiffness / self._gain, scene.robot.column("damping")

    def read_back(self) -> dict[str, Any]:
        """From MuJoCo's model, which is what is stepped."""
        if self._own_file is not None:
            return FileReadBack(self, self._own_file).all()
        model, data = self.solver.mj_model, self.solver.mj_data
        return ReadBack(self, model, data, self.numbers()).all()

    def numbers(self) -> Numbers:
        prepared = self.prepared
        bodies = self.solver.mjc_body_to_newton.numpy()[0].tolist()
        labels = names(self.model.body_label)
        links = () if prepared is None else prepared.links
        joints = () if prepared is None else prepared.robot.joint_names
        return Numbers(
            self._geom("ground"),
            {box.name: self._geoms(box) for box in self.scene.bodies},
            {name: bodies.index(labels.index(name)) for name in links},
            dict(zip(joints, self._mujoco_joints(), strict=True)),
        )

    def _geoms(self, body: Body) -> list[int]:
        """MuJoCo's numbers of the shapes of a body."""
        return [self._geom(shape_label(body, k)) for k in range(len(body.parts))]

    def _geom(self, label: str) -> int:
        """MuJoCo's number of Newton's shape with this label."""
        return self._shapes().index(self.model.shape_label.index(label))

    def _shapes(self) -> list[int]:
        """Newton's number of each of MuJoCo's geoms."""
        numbers: list[int] = self.solver.mjc_geom_to_newton_shape.numpy()[0].tolist()
        return numbers

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        asked = self._share * position + (self._damping * velocity + effort) / self._gain
        self._ctrl[:] = asked.clip(-MOST, MOST)

    def push(self, wrenches: FloatArray) -> None:
        for state in self._states:  # which take turns
            state.body_f.numpy()[self._free] = wrenches

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        state, model = self._states[0], self.model
        weight = heavy(self.scene) * np.asarray(self.scene.gravity)
        for body, joint, row in zip(*self._led, before, strict=True):
            q, v = model.joint_q_start.numpy()[joint], model.joint_qd_start.numpy()[joint]
            state.joint_q.numpy()[q : q + 7] = row[[0, 1, 2, 4, 5, 6, 3]]
            state.joint_qd.numpy()[v : v + 6] = row[7:]
            state.body_f.numpy()[body, :3] = -weight

    def step(self) -> None:
        before, after = self._states
        timestep = float(self.solver.mj_model.opt.timestep)
        self.solver.step(before, after, self._control, None, timestep)
        self._states = [after, before]
        self._steps += 1

    def body_state(self) -> FloatArray:
        state = self._states[0]
        rows = np.empty((len(self._free), 13))
        if self._free:
            poses, velocities = state.body_q.numpy(), state.body_qd.numpy()
            rows[:, :3] = poses[self._free, :3]
            rows[:, 3] = poses[self._free, 6]  # Newton's quaternions end with w
            rows[:, 4:7] = poses[self._free, 3:6]
            rows[:, 7:] = velocities[self._free]
        return rows

    def joint_state(self) -> FloatArray:
        state = self._states[0]
        if not len(self._q):
            return np.empty((2, 0))
        q, v = state.joint_q.numpy()[self._q], state.joint_qd.numpy()[self._v]
        return np.array([q, v], dtype=float)

    def save(self) -> dict[str, Any]:
        """Newton's state and command, and what MuJoCo remembers beyond them (warm starts)."""
        model, data = self.solver.mj_model, self.solver.mj_data
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        memory = np.empty(mujoco.mj_stateSize(model, kind))
        mujoco.mj_getState(model, data, memory, kind)
        arrays = [getattr(self._states[0], name).numpy().copy() for name in _STATE]
        arrays.append(data.actuator_velocity.copy())
        command = self._ctrl.copy() if self._ctrl is not None else None
        return {"arrays": arrays, "command": command, "memory": memory, "steps": self._steps}

    def restore(self, state: dict[str, Any]) -> None:
        *arrays, before = state["arrays"]
        for name, values in zip(_STATE, arrays, strict=True):
            getattr(self._states[0], name).numpy()[:] = values
        if self._ctrl is not None:
            self._ctrl[:] = state["command"]
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        mujoco.mj_setState(self.solver.mj_model, self.solver.mj_data, state["memory"], kind)
        mujoco.mj_forward(self.solver.mj_model, self.solver.mj_data)
        self.solver.mj_data.actuator_velocity[:] = before
        self._steps = state["steps"]

    def contact_forces(self) -> Iterator[tuple[str, str, FloatArray]]:
        return contact_forces(self.solver.mj_model, self.solver.mj_data, self.numbers())

    def joint_wrenches(self) -> FloatArray:
        return joint_wrenches(self.solver.mj_model, self.solver.mj_data, self.numbers())

    def contact_count(self) -> int:
        """Contacts that take part in the solution; MuJoCo also lists those within the gap."""
        data = self.solver.mj_data
        return int((data.contact.efc_address >= 0).sum())

    def render(self, width: int, height: int) -> NDArray[np.uint8]:
        """A picture by MuJoCo, whose renderer needs no display."""
        model = self.solver.mj_model
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        model.geom_rgba[:, :3] = self.model.shape_color.numpy()[self._shapes()]
        model.vis.headlight.diffuse[:] = 0.9  # Newton's model has no other light
        with renderer(mujoco, model, width, height) as drawing:
            drawing.update_scene(self.solver.mj_data, camera(mujoco))
            return np.array(drawing.render())

    def _open_window(self) -> None:
        import newton.viewer

        self._viewer = newton.viewer.ViewerGL(width=960, height=720)
        self._viewer.set_model(self.model)
        self._viewer.set_camera(pos=wp.vec3(2.0, -1.3, 1.3), pitch=-25.0, yaw=140.0)
        self.refresh_window()

    def refresh_window(self) -> None:
        if self._viewer is not None:
            self._viewer.begin_frame(self.time)
            self._viewer.log_state(self._states[0])
            self._viewer.end_frame()

    def close(self) -> None:
        if self.__dict__.get("_viewer") is not None:
            self._viewer.close()
        for name in ("_viewer", "solver", "model", "_states", "_control", "_ctrl"):
            self.__dict__.pop(name, None)

    def versions(self) -> dict[str, str]:
        from importlib.metadata import version

        return {name: version(name) for name in ("newton", "warp-lang", "mujoco", "mujoco-warp")}


_STATE = ("joint_q", "joint_qd", "body_q", "body_qd")
"""Arrays of Newton's state."""
