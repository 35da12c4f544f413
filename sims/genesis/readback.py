"""What Genesis says that it built, for the parity check: from the tensors that its solver reads."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pytest_simbench.description.shapes import Outline, a_box, a_cylinder, a_mesh, a_round
from pytest_simbench.parity import readback
from pytest_simbench.parity.readback import felt, one_value
from pytest_simbench.scene import Coupling, FloatArray, Pose, rotation_matrix
from pytest_simbench.simulator import heavy, lazy_import

from ..mujoco.bounces import bounce
from .engine import array_of, centre_of_mass, numbers, of_collider

genesis = lazy_import("genesis")


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` that Genesis tells; a part is a link of its."""

    def __init__(self, simulator: Any) -> None:
        self.solver = solver = simulator.solver
        self.substeps = simulator.settings.substeps
        self.robot, self.info = simulator._robot, solver.dyn_info
        links = () if self.robot is None else self.robot.links
        super().__init__(
            simulator,
            simulator._ground.links[0],
            {name: entity.links[0] for name, entity in simulator._boxes.items()},
            {link.name: link for link in links},
        )
        self._arrays: dict[str, Any] = {}
        self._pairs = array_of(of_collider(solver.collider, "collider_info").collision_pair_idx)

    def world(self) -> dict[str, Any]:
        rigid = self.solver.rigid_info
        return {
            "gravity": array_of(rigid.gravity).reshape(3),
            "timestep": array_of(rigid.substep_dt).item() * self.substeps,
            "ground/height": self.height(),
        }

    def height(self) -> float:
        """Of the ground."""
        return float(numbers(self.solver.get_geoms_pos(self._shapes(self.ground)))[0, 2])

    def body(self, part: Any, name: str) -> dict[str, Any]:
        led = self._array("links", "inertial_mass")[part.idx] >= heavy(self.scene)
        found: dict[str, Any] = {"dynamic": float(self._is_free(part) and not led)}
        if part.n_dofs and not led:
            found |= self.inertial(part)
            found |= {"damping": self._damping(part), "velocity": self._velocity(part)}
        return found

    def coupling(self, pair: Coupling) -> FloatArray:
        """Of a constraint between both joints, else not a number."""
        joints = [self.robot.get_joint(name).idx for name in (pair.follower, pair.leader)]
        for k, (*ends, kind) in enumerate(zip(*self._equalities(), strict=True)):
            if kind == genesis.EQUALITY_TYPE.JOINT and ends == joints:
                offset, ratio, *higher = self._array("equalities", "eq_data")[k, 0, :5]
                if not any(higher):
                    return np.array([ratio, offset])
        return np.full(2, np.nan)

    def closures(self) -> list[tuple[FloatArray, bool]]:
        _, _, kinds = self._equalities()
        joined = (genesis.EQUALITY_TYPE.CONNECT, genesis.EQUALITY_TYPE.WELD)
        loops = np.flatnonzero(np.isin(kinds, joined))
        data = self._array("equalities", "eq_data")[loops, 0]
        weld = kinds[loops] == genesis.EQUALITY_TYPE.WELD
        return [(row[:6].reshape(2, 3), w) for row, w in zip(data, weld, strict=True)]

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

    def pose(self, part: Any) -> FloatArray:
        place = numbers(self.solver.get_links_pos([part.idx]))[0]
        return np.concatenate([place, numbers(self.solver.get_links_quat([part.idx]))[0]])

    def shapes(self, part: Any) -> Iterator[Outline]:
        for shape in self._shapes(part):
            pose, data = (
                self.shape_pose(part, shape),
                self._array("geoms", "data")[shape].astype(float),
            )
            match genesis.GEOM_TYPE(self._array("geoms", "type")[shape]).name:
                case "BOX":
                    yield a_box(data[:3], pose)
                case "SPHERE":
                    yield a_round(data[0], 0.0, pose)
                case "CAPSULE":
                    yield a_round(data[0], data[1], pose)
                case "CYLINDER":
                    yield a_cylinder(data[0], data[1], pose)
                case _:
                    ends = (self._array("geoms", f"vert_{end}")[shape] for end in ("start", "end"))
                    corners = self._array("verts", "init_pos")[slice(*ends)].astype(float)
                    yield a_mesh(corners, pose)

    def shape_pose(self, part: Any, shape: int) -> Pose:
        """Of a shape in the frame of its part."""
        place = [*self._array("geoms", "pos")[shape], *self._array("geoms", "quat")[shape]]
        return Pose.from_array(place)

    def inertial(self, part: Any) -> dict[str, Any]:
        axes = rotation_matrix(self._array("links", "inertial_quat")[part.idx])
        tensor = self._array("links", "inertial_i")[part.idx].astype(float)
        entity = self._array("links", "entity_idx")[part.idx]
        mass = self._array("links", "inertial_mass")[part.idx]
        gravity = array_of(self.solver.rigid_info.gravity).reshape(3)
        pull = -array_of(self.solver.dyn_state.links.cfrc_applied_vel)[part.idx].reshape(3)
        held = self._array("entities", "gravity_compensation")[entity]
        return {
            "mass": mass,
            "com": self._array("links", "inertial_pos")[part.idx],
            "inertia": axes @ tensor @ axes.T,
            "gravity": 1.0 - held + felt(pull, mass, gravity),
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

    def surface(self, part: Any) -> dict[str, Any]:
        shapes = self._shapes(part)
        ratio = array_of(self.solver.dyn_state.geoms.friction_ratio)[shapes, 0]
        parameters = self._array("geoms", "sol_params")[shapes, :2].astype(float)
        return {
            "friction": one_value(self._array("geoms", "friction")[shapes] * ratio),
            "restitution": one_value([bounce(*row) for row in parameters]),
        }

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

    def collide(self, first: Any, second: Any) -> Any:
        first, second = self._shapes(first), self._shapes(second)
        either = self._pairs[np.ix_(first, second)], self._pairs[np.ix_(second, first)].T
        return np.maximum(*either) >= 0

    def joint(self, name: str) -> dict[str, Any]:
        joint = self.robot.get_joint(name)
        dof = joint.dof_start
        of = {
            name: self._array("dofs", name)[dof]
            for name in ("motion_ang", "motion_vel", "limit", "force_range", "act_gain", "act_bias",
                         "damping", "armature", "frictionloss", "stiffness")
        }  # fmt: skip
        low, high = of["force_range"] - of["act_bias"][0]
        same = np.isclose(high, -low, rtol=1e-6, atol=np.spacing(np.abs(of["force_range"]).max()))
        anchor = self._array("joints", "pos")[joint.idx]
        linear = of["motion_vel"] + np.cross(anchor, of["motion_ang"])
        spring, push = of["stiffness"], of["act_bias"][0]  # which moves the spring's rest
        return ({"rest": push / spring} if spring else {}) | {
            "axis": np.concatenate([of["motion_ang"], linear]),
            "limits": of["limit"],
            "effort_limit": high if same else np.array([low, high]),
            "stiffness": one_value([of["act_gain"], -of["act_bias"][1]]) + of["stiffness"],
            "damping": of["damping"] - of["act_bias"][2],
            "friction": of["frictionloss"],
            "armature": of["armature"],
            "initial_position": numbers(self.solver.get_dofs_position([dof]))[0],
        }
