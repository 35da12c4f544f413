"""Adapters that cheat: each does well at a task, and moves or tells what is not so."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar

import mujoco
import numpy as np
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.parity.quantities import expected_quantities
from pytest_simbench.scene import Body, FloatArray, Robot, Scene
from pytest_simbench.testing.faults import of_robot
from tests.laws.faults import bodies, bouncier, heavier, rougher
from tests.testing.wrong import FINGERS


class Handling(MuJoCo):
    """Knows what the Panda holds."""

    def load(self, scene: Scene) -> None:
        super().load(scene)
        robot, self.held, self.since = scene.robot, None, 0.0
        self.panda = robot is not None and robot.name == "panda" and len(self._body_ids) > 0

    def step(self) -> None:
        super().step()
        if not self.panda:
            return
        pairs = self.model.geom_bodyid[self.data.contact.geom]
        touched = [
            {int(b) for pair in pairs for b in pair if self.model.body(f).id in pair}
            for f in FINGERS
        ]
        free = [int(b) for b in self._body_ids]
        pinched = next((free.index(b) for b in touched[0] & touched[1] if b in free), None)
        if pinched is not None and self.held is None:
            self.held, self.since = pinched, self.time
        self.free = not any(
            self.held is not None and free[self.held] in pair for pair in pairs.tolist()
        )
        if self.held is not None:
            self.cheat(self.held)

    @property
    def closing(self) -> bool:
        return bool(self.data.ctrl[7] < 0.024)

    def cheat(self, k: int) -> None:
        """What is done after each step with the k-th free body, which is or was in the hand."""


class Welded(Handling):
    """A cube that lies still in the closed hand for 0.1 s is held there by a stiff spring."""

    def load(self, scene: Scene) -> None:
        super().load(scene)
        self.anchor: FloatArray | None = None

    def cheat(self, k: int) -> None:
        hand, body, dofs = self.model.body("panda_link7").id, self._body_ids[k], self._body_v[k]
        self.data.xfrc_applied[hand], self.data.qfrc_applied[dofs] = 0.0, 0.0
        if not self.closing:
            self.held = self.anchor = None
            return
        turn, at = self.data.xmat[hand].reshape(3, 3), self.data.xpos[hand]
        moving = np.zeros(6)
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, hand, moving, 0)
        place = self.data.xpos[body]
        v = moving[3:] + np.cross(moving[:3], place - at) - self.data.qvel[dofs]
        if self.anchor is None:
            if self.time - self.since > 0.1 and np.linalg.norm(v) < 0.005:
                self.anchor = turn.T @ (place - at)
            return
        pull = 4000.0 * (at + turn @ self.anchor - place) + 30.0 * v
        self.data.qfrc_applied[dofs] = pull
        arm = place - self.data.xipos[hand]
        self.data.xfrc_applied[hand] = [*-pull, *np.cross(arm, -pull)]


class HalfFlight(Handling):
    """What the hand let go and touches nothing falls with half its weight."""

    def cheat(self, k: int) -> None:
        body = self._body_ids[k]
        weight = self.model.body_mass[body] * self.model.opt.gravity
        self.data.qfrc_applied[self._body_v[k]] = (
            -0.5 * weight if self.free and not self.closing else 0.0
        )


class Snaps(Handling):
    """A cube that was let go within 15 mm of its place upon another body is put there."""

    def cheat(self, k: int) -> None:
        if self.closing:
            return
        q = self._body_q[k]
        low = self.data.qpos[q[2]] - 0.025
        for other in self.scene.bodies:
            if other.name == self.scene.free_bodies[k].name:
                continue
            at = self.data.body(other.name).xpos
            gap = self.data.qpos[q[:2]] - at[:2]
            over = abs(low - at[2] - other.extents[2] / 2) < 0.004
            if over and 1e-4 < float(np.hypot(*gap)) < 0.015:
                self.data.qpos[q[:2]] = at[:2]
                self.data.qpos[q[3:]] = self.data.body(other.name).xquat
                self.data.qvel[self._body_v[k]] = 0.0
                self.held = None
                return


Lie = Callable[[Scene], Scene]


class Copied(MuJoCo):
    """Builds another world than the scene, and reads back a copy of what the scene asked for. Only
    where things are is the engine's, so that it follows each step."""

    lie: ClassVar[Lie] = staticmethod(lambda scene: scene)

    def load(self, scene: Scene) -> None:
        super().load(type(self).lie(scene))
        self.copy = expected_quantities(scene, self.settings)

    def read_back(self) -> dict[str, Any]:
        now = super().read_back()
        live = ("/pose", "/initial_position")
        return self.copy | {name: now[name] for name in self.copy if name.endswith(live)}


def of_bodies(**factors: float) -> Lie:
    """Values of all bodies, multiplied."""

    def of(body: Body) -> Body:
        return replace(body, **{key: k * getattr(body, key) for key, k in factors.items()})

    return bodies(of)


def with_inertia(scene: Scene) -> Scene:
    """Bodies are harder to turn by half."""

    def of(body: Body) -> Body:
        moments = tuple((1.5 * body.inertia()).tolist())
        return body if body.prescribed else replace(body, moments=moments)

    return bodies(of)(scene)


def of_robots(change: Callable[[Robot], Robot]) -> Lie:
    """Another robot, where there is one."""
    return lambda scene: scene if scene.robot is None else of_robot(change)(scene)


def of_drives(**factors: float) -> Lie:
    return of_robots(lambda robot: robot.scaled(*robot.joint_names, **factors))


with_whole_weights = of_robots(lambda robot: robot.with_joints(*robot.joint_names, gravity=1.0))
"""Links whose weight is compensated fall."""

loose = of_robots(
    lambda robot: replace(robot, closures=tuple(replace(c, rigid=False) for c in robot.closures))
)
"""Welds are balls and their sockets."""


ECHOES: dict[str, tuple[Lie, str]] = {
    "gravity": (heavier, "free_fall"),
    "mass": (of_bodies(mass=2.0), "force_acts_for_its_time"),
    "inertia": (with_inertia, "torque_acts_for_its_time"),
    "friction": (rougher(0.8), "slides_above_mu"),
    "restitution": (bouncier(0.8), "bounces_as_restitution_says"),
    "body_damping": (of_bodies(linear_damping=2.0), "damps_as_the_scene_says"),
    "stiffness": (of_drives(stiffness=0.8), "static_hold"),
    "drive_damping": (of_drives(damping=0.6), "drives_are_springs"),
    "effort_limit": (of_drives(effort_limit=1.5), "every_effort_limit_counts"),
    "link_gravity": (with_whole_weights, "links_feel_their_share_of_gravity"),
    "armature": (of_drives(armature=0.5), "limp_arm_falls"),
    "rotor": (of_drives(armature=0.0), "rotors_are_heavy"),
    "rest": (of_drives(rest=0.0), "joints_have_springs"),
    "rigid": (loose, "welded_links_are_one"),
}
"""What a copy hides: another value of a quantity, and the law that feels it."""


def echo(quantity: str) -> type[Copied]:
    """A copy that hides it; workers find it by the name of its class."""
    lie = {"lie": staticmethod(ECHOES[quantity][0]), "__module__": __name__}
    return type(f"Copied_{quantity}", (Copied,), lie)


for _quantity in ECHOES:
    globals()[f"Copied_{_quantity}"] = echo(_quantity)
