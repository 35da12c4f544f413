"""What Genesis says that it built, for the parity check: from the tensors that its solver reads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pytest_simbench.description.shapes import (
    box_corners,
    cylinder_reach,
    outlines,
    reach,
    round_reach,
)
from pytest_simbench.parity import readback
from pytest_simbench.parity.readback import one_value
from pytest_simbench.scene import FloatArray, Pose, rotation_matrix
from pytest_simbench.simulator import heavy, lazy_import

from ..mujoco.bounces import bounce
from .engine import array_of, centre_of_mass, numbers, of_collider

genesis = lazy_import("genesis")

_ROUND = ("SPHERE", "CYLINDER", "CAPSULE")


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` that Genesis tells."""

    def __init__(self, simulator: Any) -> None:
        super().__init__(simulator)
        self.solver = solver = simulator.solver
        self.substeps = simulator.settings.substeps
        self.ground, self.boxes = simulator._ground, simulator._boxes
        self.robot, self.info = simulator._robot, solver.dyn_info
        self._arrays: dict[str, Any] = {}
        self._pairs = array_of(of_collider(solver.collider, "collider_info").collision_pair_idx)

    def world(self) -> dict[str, Any]:
        rigid, ground = self.solver.rigid_info, self._shapes(self.ground.links[0])
        return {
            "gravity": array_of(rigid.gravity).reshape(3),
            "timestep": array_of(rigid.substep_dt).item() * self.substeps,
            "ground/height": numbers(self.solver.get_geoms_pos(ground))[0, 2],
            "ground/friction": self._friction(ground),
            "ground/restitution": self._restitution(ground),
        }

    def body(self, prefix: str, name: str) -> dict[str, Any]:
        link = self.boxes[name].links[0]
        found = self._part(prefix, link)
        led = self._array("links", "inertial_mass")[link.idx] >= heavy(self.scene)
        found[f"{prefix}/dynamic"] = float(self._is_free(link) and not led)
        if link.n_dofs and not led:
            found |= self._inertial(prefix, link)
            found[f"{prefix}/damping"] = self._damping(link)
            found[f"{prefix}/velocity"] = self._velocity(link)
        return found

    def link(self, prefix: str, name: str) -> dict[str, Any]:
        link = self.robot.get_link(name)
        found = self._part(prefix, link)
        return found if name == self.prepared.root else found | self._inertial(prefix, link)

    def coupled(self, pairs: tuple[tuple[str, str], ...]) -> bool:
        return all(map(self._coupled, pairs))

    def closures(self) -> list[FloatArray]:
        _, _, kinds = self._equalities()
        loops = np.flatnonzero(kinds == genesis.EQUALITY_TYPE.CONNECT)
        data = self._array("equalities", "eq_data")[loops, 0]
        return [row[:6].reshape(2, 3) for row in data]

    def _array(self, group: str, name: str) -> Any:
        """A tensor of the solver's description, read once."""
        key = f"{group}.{name}"
        if key not in self._arrays:
            self._arrays[key] = array_of(getattr(getattr(self.info, group), name))
        return self._arrays[key]

    def _shapes(self, link: Any) -> list[int]:
        """Numbers of the shapes that belong to a link."""
        found: list[int] = np.flatnonzero(self._array("geoms", "link_idx") == link.idx).tolist()
        return found

    def _part(self, prefix: str, link: Any) -> dict[str, Any]:
        """Pose, shapes and surface of a body or link."""
        shapes, kinds = self._shapes(link), self._array("geoms", "type")
        boxes = [shape for shape in shapes if kinds[shape] == genesis.GEOM_TYPE.BOX]
        rounds = [shape for shape in shapes if genesis.GEOM_TYPE(kinds[shape]).name in _ROUND]
        meshes = [shape for shape in shapes if shape not in boxes and shape not in rounds]
        place = numbers(self.solver.get_links_pos([link.idx]))[0]
        turn = numbers(self.solver.get_links_quat([link.idx]))[0]
        found = {f"{prefix}/pose": np.concatenate([place, turn])}
        found |= outlines(prefix, *(map(self._reach, kind) for kind in (boxes, meshes, rounds)))
        if shapes:
            found[f"{prefix}/friction"] = self._friction(shapes)
            found[f"{prefix}/restitution"] = self._restitution(shapes)
        return found

    def _reach(self, shape: int) -> FloatArray:
        """The reach of a shape in the frame of its link."""
        kind = genesis.GEOM_TYPE(self._array("geoms", "type")[shape]).name
        if kind in _ROUND:
            place = [*self._array("geoms", "pos")[shape], *self._array("geoms", "quat")[shape]]
            radius, length = self._array("geoms", "data")[shape, :2].astype(float)
            reached = cylinder_reach if kind == "CYLINDER" else round_reach
            return reached(radius, length * (kind != "SPHERE"), Pose.from_array(place))
        if self._array("geoms", "type")[shape] == genesis.GEOM_TYPE.BOX:
            corners = box_corners(self._array("geoms", "data")[shape, :3].astype(float))
        else:
            first, last = (self._array("geoms", f"vert_{end}")[shape] for end in ("start", "end"))
            corners = self._array("verts", "init_pos")[first:last].astype(float)
        turn = rotation_matrix(self._array("geoms", "quat")[shape])
        return reach(corners @ turn.T + self._array("geoms", "pos")[shape])

    def _inertial(self, prefix: str, link: Any) -> dict[str, Any]:
        axes = rotation_matrix(self._array("links", "inertial_quat")[link.idx])
        tensor = self._array("links", "inertial_i")[link.idx].astype(float)
        entity = self._array("links", "entity_idx")[link.idx]
        return {
            f"{prefix}/mass": self._array("links", "inertial_mass")[link.idx],
            f"{prefix}/com": self._array("links", "inertial_pos")[link.idx],
            f"{prefix}/inertia": axes @ tensor @ axes.T,
            f"{prefix}/gravity": 1.0 - self._array("entities", "gravity_compensation")[entity],
        }

    def _velocity(self, link: Any) -> FloatArray:
        linear = numbers(self.solver.get_links_vel([link.idx], ref=centre_of_mass()))
        return np.ravel(np.concatenate([linear, numbers(self.solver.get_links_ang([link.idx]))]))

    def _damping(self, link: Any) -> FloatArray:
        """Of a free body: that of its degrees of freedom, per mass and inertia."""
        passive = self._array("dofs", "damping")[link.dof_start : link.dof_end]
        passive = passive + self._array("dofs", "frictionloss")[link.dof_start : link.dof_end]
        mass = self._array("links", "inertial_mass")[link.idx]
        inertia = self._array("links", "inertial_i")[link.idx].max()
        return np.array([passive[:3].max() / mass, passive[3:].max() / inertia])

    def _friction(self, shapes: Sequence[int]) -> Any:
        ratio = array_of(self.solver.dyn_state.geoms.friction_ratio)[shapes, 0]
        return one_value(self._array("geoms", "friction")[shapes] * ratio)

    def _restitution(self, shapes: Sequence[int]) -> Any:
        parameters = self._array("geoms", "sol_params")[shapes, :2].astype(float)
        return one_value([bounce(*row) for row in parameters])

    def _is_free(self, link: Any) -> bool:
        """Whether a body has six degrees of freedom and nothing holds it."""
        first, second, kinds = self._equalities()
        joined = {genesis.EQUALITY_TYPE.WELD, genesis.EQUALITY_TYPE.CONNECT}
        held = {
            end for a, b, kind in zip(first, second, kinds, strict=True) if kind in joined
            for end in (a, b)
        }  # fmt: skip
        free = self._array("links", "n_dofs")[link.idx] == 6
        return bool(free and not self._array("links", "is_fixed")[link.idx]) and (
            link.idx not in held
        )

    def _equalities(self) -> tuple[Any, Any, Any]:
        names = ("eq_obj1id", "eq_obj2id", "eq_type")
        many = self.solver.n_equalities  # behind them there is room for more
        first, second, kinds = (self._array("equalities", name)[:many, 0] for name in names)
        return first, second, kinds

    def _coupled(self, fingers: Sequence[str]) -> bool:
        joints = {self.robot.get_joint(name).idx for name in fingers}
        return any(
            {a, b} == joints and kind == genesis.EQUALITY_TYPE.JOINT
            for a, b, kind in zip(*self._equalities(), strict=True)
        )

    def can_touch(self, a: str, b: str) -> bool:
        links = a.startswith("link/") and b.startswith("link/")
        first, second = self._shapes(self._link(a)), self._shapes(self._link(b))
        found = np.maximum(self._pairs[np.ix_(first, second)], self._pairs[np.ix_(second, first)].T)
        return bool((found >= 0).any() if links else found.size and (found >= 0).all())

    def _link(self, name: str) -> Any:
        kind, _, rest = name.partition("/")
        if kind == "ground":
            return self.ground.links[0]
        return self.boxes[rest].links[0] if kind == "body" else self.robot.get_link(rest)

    def joint(self, prefix: str, name: str) -> dict[str, Any]:
        joint = self.robot.get_joint(name)
        dof = joint.dof_start
        of = {
            name: self._array("dofs", name)[dof]
            for name in ("motion_ang", "motion_vel", "limit", "force_range", "act_gain", "act_bias",
                         "damping", "armature", "frictionloss", "stiffness")
        }  # fmt: skip
        anchor = self._array("joints", "pos")[joint.idx]
        linear = of["motion_vel"] + np.cross(anchor, of["motion_ang"])
        return {
            f"{prefix}/axis": np.concatenate([of["motion_ang"], linear]),
            f"{prefix}/limits": of["limit"],
            f"{prefix}/effort_limit": one_value(of["force_range"] * [-1, 1]),
            f"{prefix}/stiffness": one_value([of["act_gain"], -of["act_bias"][1]])
            + of["stiffness"],
            f"{prefix}/damping": of["damping"] - of["act_bias"][2],
            f"{prefix}/friction": of["frictionloss"],
            f"{prefix}/armature": of["armature"],
            f"{prefix}/initial_position": numbers(self.solver.get_dofs_position([dof]))[0],
        }
