"""MuJoCo (Google DeepMind), through its Python bindings.

Drives are MuJoCo's own actuators, one a joint, with an affine bias: force = gain ctrl - k q - d v,
so velocity and effort feed-forward ride on the control: ctrl = (k q* + d v* + tau_ff) / gain. The
actuator's force range is the effort limit, so it bounds the whole sum.

What was learnt stands in docs/engines/mujoco.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.description.carried import Carried
from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.scene.overlap import rotated, rotations
from pytest_simbench.simulator import Capability, Deviation, Simulator, SimulatorInfo, lazy_import

from .bounces import BOUNCES
from .own_file import FileReadBack, OwnFile, loaded
from .pictures import DISABLED, camera, renderer
from .readback import Numbers, ReadBack, contact_forces, joint_wrenches
from .reading import Reading
from .settings import CHOSEN_ON, PROFILES, FileSettings, MuJoCoSettings
from .world import ROUND, build, gain, leave_out, shape_label

mujoco = lazy_import("mujoco")


class MuJoCo(Simulator):
    """Adapter of MuJoCo."""

    info = SimulatorInfo(
        name="mujoco",
        title="MuJoCo",
        distribution="mujoco",
        modules=("mujoco",),
        install="pip install 'pytest-simbench[mujoco]'",
        licence="Apache-2.0",
        engine="MuJoCo",
        language="C, C++",
        tested_version="4.0.0",
        friction_rule="maximum",
        reads=(".xml", ".mjcf"),
        oldest_version="3.2.4",  # before it `MjSpec` tells Python no lists of geoms and joints
        capabilities=Capability.named(
            "window offscreen save_restore exact_restore contact_count contact_forces compound "
            "loops couplings apart self_collide joint_wrenches deterministic"
        ),
        deviations=(
            Deviation("", "contacts are soft by design: cubes sink in and creep a little"),
            Deviation("", BOUNCES, only="restitution"),
            Deviation("", ROUND, only="frictions"),
        ),
        install_size_mb=60,
        environment=DISABLED,
    )
    profiles = PROFILES
    chosen_on = CHOSEN_ON
    settings: MuJoCoSettings

    _own_file: OwnFile | None = None

    def load(self, scene: Scene) -> None:
        self.begin(scene)
        self._viewer: Any = None
        self._renderer: Any = None
        if isinstance(self.settings, FileSettings):
            self._load_file(scene)
        else:
            self._build(scene)
        self.model.vis.global_.offwidth, self.model.vis.global_.offheight = 1920, 1080
        if self.gui:
            self._open_window()

    def _load_file(self, scene: Scene) -> None:
        self._own_file = own = OwnFile(scene, self.settings.timestep)
        self.model, self.data = own.model, own.data
        self._body_ids = own.roots
        loaded(self, own)

    def _build(self, scene: Scene) -> None:
        self.model = model = build(scene, self.prepared, self.settings)
        self.data = data = mujoco.MjData(model)

        joints = [model.joint(name) for name in (scene.robot.joint_names if scene.robot else ())]
        self._q = np.array([joint.qposadr[0] for joint in joints], dtype=int)
        self._v = np.array([joint.dofadr[0] for joint in joints], dtype=int)
        if scene.robot is not None:
            self._gain = gain(stiffness := scene.robot.column("stiffness"))
            self._share, self._damping = stiffness / self._gain, scene.robot.column("damping")
            initial = scene.robot.column("initial_position")
            data.qpos[self._q] = initial
            self.command(initial, 0 * initial, 0 * initial)
        free = [model.joint(f"{body.name}/free") for body in scene.free_bodies]
        self._body_q = np.array([j.qposadr[0] + np.arange(7) for j in free], int).reshape(-1, 7)
        self._body_v = np.array([j.dofadr[0] + np.arange(3) for j in free], int).reshape(-1, 3)
        dofs = model.nq + self._body_v
        self._body_rows = np.hstack([self._body_q, dofs, dofs + 3])
        self._body_ids = np.array([model.body(b.name).id for b in scene.free_bodies], dtype=int)
        for at, body in zip(self._body_v, scene.free_bodies, strict=True):
            data.qvel[at] = body.linear_velocity
            data.qvel[at + 3] = body.pose.rotation().T @ body.angular_velocity  # in its own frame
            if body.damping.any():
                model.dof_damping[at] = body.linear_damping * body.mass
                model.dof_damping[at + 3] = body.angular_damping * body.inertia()
        self._led = np.flatnonzero([body.prescribed for body in scene.free_bodies])
        mujoco.mj_forward(model, data)
        if len(self._led):
            leave_out(model, self._body_v[self._led, 0])

    def read_file(self, path: str) -> tuple[Scene, tuple[Carried, ...]]:
        found = Reading(path)
        return found.scene, tuple(found.account)

    def read_back(self) -> dict[str, Any]:
        if self._own_file is not None:
            return FileReadBack(self, self._own_file).all()
        return ReadBack(self, self.model, self.data, self.numbers()).all()

    def numbers(self) -> Numbers:
        model, prepared = self.model, self.prepared
        links = () if prepared is None else prepared.links
        joints = () if prepared is None else prepared.robot.joint_names
        return Numbers(
            model.geom("ground").id,
            {
                body.name: [model.geom(shape_label(body, k)).id for k in range(len(body.parts))]
                for body in self.scene.bodies
            },
            {name: model.body(name).id for name in links},
            {name: model.joint(name).id for name in joints},
        )

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        ahead = (self._damping * velocity + effort) / self._gain
        self.data.ctrl[:] = self._share * position + ahead

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
        return self._bodies(np.concatenate([self.data.qpos, self.data.qvel]).take(self._body_rows))

    def _bodies(self, rows: FloatArray) -> FloatArray:
        """Rows (n, 13) whose angular velocities are in the body's frame, as MuJoCo has them."""
        rows[:, 10:] = rotated(rows[:, 3:7], rows[:, 10:])
        return rows

    def joint_state(self) -> FloatArray:
        return np.array([self.data.qpos[self._q], self.data.qvel[self._v]])

    def sample(self) -> FloatArray:
        return np.concatenate([self.data.qpos, self.data.qvel])

    def sampled(self, samples: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
        states = np.array(samples)
        rows = states[:, self._body_rows]
        joints = states[:, np.array([self._q, self.model.nq + self._v])]
        return joints, self._bodies(rows.reshape(-1, 13)).reshape(rows.shape)

    def save(self) -> FloatArray:
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(self.model, kind))
        mujoco.mj_getState(self.model, self.data, state, kind)
        return np.concatenate([self.data.actuator_velocity, state])

    def restore(self, state: FloatArray) -> None:
        before, memory = np.split(state, [self.model.nu])
        mujoco.mj_setState(self.model, self.data, memory, mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_forward(self.model, self.data)
        self.data.actuator_velocity[:] = before  # of which `joint_wrenches` makes accelerations

    def contact_forces(self) -> Iterator[tuple[str, str, FloatArray]]:
        return contact_forces(self.model, self.data, self.numbers())

    def joint_wrenches(self) -> FloatArray:
        return joint_wrenches(self.model, self.data, self.numbers())

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
