"""A file's equality constraints between links: what is held together, and what moves together; and
which bodies, links and ground collide, by its masks, families and exclusions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pytest_simbench.description.carried import APPROXIMATED, CARRIED, NOT_CARRIED
from pytest_simbench.scene import Closure, Coupling, FloatArray, Pose
from pytest_simbench.scene.pose import vector3
from pytest_simbench.simulator import lazy_import

from .account import HELD

if TYPE_CHECKING:
    from .articulated import Tree
    from .reading import Reading

mujoco = lazy_import("mujoco")

OPEN = 1e-6
"""What is held together may be apart by this where the file starts [m; rad]."""


class Constraints:
    """Those of a tree of links; told is what became of each.

    Args:
        starts: where its joints start, from where the file is written [rad or m].

    Attributes:
        closures, couplings: of the robot.
        carried: numbers of the constraints that they stand for.
    """

    def __init__(self, tree: Tree, starts: list[float]) -> None:
        self.tree, self.reading, self.model = tree, tree.reading, tree.model
        self.data = mujoco.MjData(self.model)
        at = self.model.jnt_qposadr[np.array([link.joint for link in tree.links], dtype=int)]
        self.data.qpos[at] += np.asarray(starts)
        self.starts = {link.joint: q for link, q in zip(tree.links, starts, strict=True)}
        mujoco.mj_kinematics(self.model, self.data)
        self.closures: list[Closure] = []
        self.couplings: list[Coupling] = []
        self.carried: set[int] = set()
        kinds = mujoco.mjtEq
        for k in range(self.model.neq):
            kind = kinds(self.model.eq_type[k])
            if not self.model.eq_active0[k]:
                reason = "it is switched off in the file, and left out here"
                self.reading.tell("equality active", NOT_CARRIED, reason, [self._name(k)])
            elif kind == kinds.mjEQ_JOINT:
                self._couple(k)
            elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
                self._hold(k, kind == kinds.mjEQ_WELD)
            else:
                self._tell(k, kind.name.removeprefix("mjEQ_").lower(), HELD)

    def _name(self, number: int) -> str:
        return self.reading.name("equality", number)

    def _tell(self, number: int, kind: str, problem: str) -> None:
        """What became of a constraint; without a problem it is carried."""
        state = NOT_CARRIED if problem else CARRIED
        if not problem:
            self.carried.add(number)
        self.reading.tell(f"equality ({kind})", state, problem, [self._name(number)])

    def _couple(self, k: int) -> None:
        model, joints = self.model, {link.joint: link.told for link in self.tree.links}
        follower, leader = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        offset, ratio, *higher = model.eq_data[k, :5].tolist()
        problem, at = "", [self.starts.get(joint, 0.0) for joint in (follower, leader)]
        gap = at[0] - ratio * at[1] - offset
        if follower not in joints or leader not in joints:
            problem = "only two hinges or sliders move together here"
        elif any(higher):
            problem = "joints move together here in proportion, and not by a polynomial"
        elif abs(gap) > OPEN:
            problem = f"where the file starts, the joints are {gap:g} rad or m from where it is"
        else:
            self.couplings.append(Coupling(joints[follower], joints[leader], ratio, offset))
        self._tell(k, "joint", problem)

    def _hold(self, k: int, weld: bool) -> None:
        ends = self._ends(k)
        kind = "weld" if weld else "connect"
        if isinstance(ends, str):
            self._tell(k, kind, ends)
            return
        first, second, anchor, gap = ends
        if weld and self.model.eq_data[k, 10] != 1:
            reason = f"a weld is as stiff as an engine has it; {self.model.eq_data[k, 10]:g}"
            self.reading.tell("equality torquescale", NOT_CARRIED, reason, [self._name(k)])
        if gap > OPEN:
            self._tell(k, kind, f"where the file starts, it is open by {gap:.3g} m or rad")
            return
        if first != second:
            point = Pose(vector3(anchor))
            frames = (self.tree.frame_of(name, self.data) for name in (first, second))
            a, b = ((frame.inverse() * point).position for frame in frames)
            self.closures.append(Closure(first, second, a, b, rigid=weld))
        self._tell(k, kind, "")

    def _free(self, bodies: list[int]) -> str:
        """What it means that a constraint of these bodies is left out."""
        names = [self.reading.name("body", body) for body in bodies]
        roots = map(self.reading.root, bodies)
        free = [n for n, root in zip(names, roots, strict=True) if not self.tree.link_of(root)]
        reason = f"it holds {names[0]} at {names[1]}, and only links are held here; what moves "
        reason += f"freely may fall or part: {' and '.join(free)}"
        led = [n for n, b in zip(names, bodies, strict=True) if self.model.body_mocapid[b] >= 0]
        return reason + (f"; {led[0]} is a mocap body, and nothing moves it" if led else "")

    def _ends(self, k: int) -> tuple[str, str, FloatArray, float] | str:
        """Both links, a point of the constraint in the file's world [m], and how far it is open
        where the file starts [m or rad]; or what it holds, where one end moves freely."""
        model, reading = self.model, self.reading
        objects = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        data, weld = model.eq_data[k], model.eq_type[k] == mujoco.mjtEq.mjEQ_WELD
        at_sites = model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_SITE
        bodies = [int(model.site_bodyid[o]) if at_sites else o for o in objects]
        names = [self.tree.link_of(reading.root(body)) for body in bodies]
        if names[0] is None or names[1] is None:
            return self._free(bodies)
        pose = reading.site_pose if at_sites else reading.pose
        frames = [pose(o, self.data) for o in objects]
        if at_sites:
            turned = frames[0].inverse() * frames[1] if weld else Pose()
            points = [np.asarray(frame.position) for frame in frames]
        elif weld:
            relative = Pose.from_array([*data[3:6], *data[6:10]])  # of the second in the first
            turned = (frames[0] * relative).inverse() * frames[1]
            points = [np.asarray((frames[0] * relative).position), np.asarray(frames[1].position)]
        else:
            turned = Pose()
            local = (data[:3], data[3:6])
            places = [f * Pose(vector3(p)) for f, p in zip(frames, local, strict=True)]
            points = [np.asarray(place.position) for place in places]
        angle = 2 * float(np.linalg.norm(turned.quaternion[1:]))
        gap = max(float(np.linalg.norm(points[1] - points[0])), angle)
        return names[0], names[1], points[0], gap


Pairs = tuple[tuple[str, str], ...]


def apart(reading: Reading) -> tuple[Pairs, bool]:
    """The pairs of a scene that do not collide, and whether any two links do."""
    groups = {f"body/{p.body.name}": p.geoms for p in reading.placed}
    groups |= {f"link/{link.name}": reading.geoms_of(link) for link in reading.links if link.whole}
    if reading.ground is not None:
        groups["ground"] = [reading.ground]
    names = [name for name, geoms in groups.items() if geoms]
    still = np.array(
        [n == "ground" or not reading.root_of(groups[n][0]) for n in names], dtype=bool
    )
    geoms = [geom for name in names for geom in groups[name]]
    member = np.repeat(np.arange(len(names)), [len(groups[name]) for name in names])
    share = np.zeros((len(geoms), len(names)))
    share[np.arange(len(geoms)), member] = 1.0
    meet = share.T @ collide(reading, geoms) @ share
    whole = np.outer(share.sum(axis=0), share.sum(axis=0))
    links = np.array([name.startswith("link/") for name in names], dtype=bool)
    both = np.outer(links, links)
    ask = np.triu(np.ones_like(both), 1) & ~np.outer(still, still)
    together = bool((meet[ask & both] > 0).any())
    never = ask & (meet == 0) & (~both | together)
    partly = ask & (meet > 0) & (meet < whole)
    joined = [{f"link/{k.name}", f"link/{k.above.name}"} for k in reading.links if k.above]
    for a, b in np.argwhere(ask & (meet > 0)):
        if {names[a], names[b]} in joined:
            partly[a, b] = False
            reason = "in the file they collide, and links that one joint joins never do here"
            told = [f"{names[a]} and {names[b]}"]
            reading.tell("contact (of joined links)", NOT_CARRIED, reason, told)
    if never.any():
        told = [f"{names[a]} and {names[b]}" for a, b in np.argwhere(never)]
        reason = f"{len(told)} pairs do not collide"
        reading.tell("geom contype, conaffinity; exclude", CARRIED, reason, told)
    if partly.any():
        told = [f"{names[a]} and {names[b]}" for a, b in np.argwhere(partly)]
        reason = "in the file some of their shapes do not collide, here all do"
        reading.tell("geom contype, conaffinity (of single shapes)", APPROXIMATED, reason, told)
    pairs = [(names[a], names[b]) for a, b in np.argwhere(never).tolist()]
    if reading.ground is None:  # the scene has one, which is not the file's
        pairs += [("ground", name) for name in names if name.startswith("link/")]
    return tuple(pairs), together


def collide(reading: Reading, geoms: list[int]) -> FloatArray:
    """1 for each two of these that MuJoCo lets collide, else 0: its rules, from its documentation
    ("Computation, Collision detection"): same body, parent and child, masks; pairs by name do."""
    model, off = reading.model, mujoco.mjtDisableBit
    if model.opt.disableflags & (off.mjDSBL_CONTACT | off.mjDSBL_CONSTRAINT):
        return np.zeros((len(geoms), len(geoms)))
    kind, affinity = model.geom_contype[geoms], model.geom_conaffinity[geoms]
    meet = (kind[:, None] & affinity) | (affinity[:, None] & kind) > 0
    body = model.geom_bodyid[geoms]
    weld = model.body_weldid[body]
    above = model.body_weldid[model.body_parentid[weld]]
    meet &= weld[:, None] != weld
    if not model.opt.disableflags & off.mjDSBL_FILTERPARENT:
        family = (weld[:, None] == above) | (above[:, None] == weld)
        meet &= ~(family & (weld[:, None] != 0) & (weld != 0))
    signature = (np.minimum(body[:, None], body) << 16) + np.maximum(body[:, None], body)
    meet &= ~np.isin(signature, model.exclude_signature)
    at = {geom: k for k, geom in enumerate(geoms)}
    for first, second in zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True):
        if first in at and second in at:
            meet[at[first], at[second]] = meet[at[second], at[first]] = True
    return meet.astype(float)
