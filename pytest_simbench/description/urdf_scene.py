"""A URDF as a scene: what moves on joints in it, as one tree without drives, fixed in the world."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from pytest_simbench.description.carried import APPROXIMATED, CARRIED, NOT_CARRIED, Carried, named
from pytest_simbench.description.links import link_poses
from pytest_simbench.description.mesh_check import FARTHEST, PACKAGE, written_stl
from pytest_simbench.description.robot_files import content, keep, keep_mesh
from pytest_simbench.description.shapes import capsule_hull, cylinder_hull, placed, shape_points
from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.description.urdf_check import MOVING, Description, read_xml
from pytest_simbench.ground.errors import DescriptionError
from pytest_simbench.scene import Coupling, Gripper, Joint, Polytope, Pose, Robot, Scene, SceneError
from pytest_simbench.scene.robot import FASTEST, FREE, WIDEST

ABOVE = 4
"""So many folders, its own the first, are looked through for the packages that a URDF names."""

READ = {
    "robot": ("link", "joint"),
    "link": ("inertial", "collision"),
    "inertial": ("origin", "mass", "inertia"),
    "collision": ("origin", "geometry"),
    "geometry": ("box", "sphere", "cylinder", "mesh"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
}
"""What is read of a URDF; of everything else it is told that it is not carried."""

REASONS = {
    "visual": "pictures show the shapes that collide",
    "material": "pictures have colours of their own",
    "transmission": "nothing drives a joint of a URDF here",
    "safety_controller": "nothing drives a joint of a URDF here",
    "calibration": "it is for real joints",
}


def read_urdf_scene(path: Path) -> tuple[Scene, tuple[Carried, ...]]:
    """The scene of a URDF, and what became of each of its quantities.

    Raises:
        DescriptionError: it cannot be read or used; one sentence with the file.
    """
    try:
        return _World(path).read()
    except SceneError as error:
        raise DescriptionError(f"{path}: {error}") from None


class _World(Description):
    """A URDF whose joints may turn without end, and whose shapes may be round."""

    shapes = "box, sphere, cylinder or mesh"

    def __init__(self, path: Path) -> None:
        self.account: list[Carried] = []
        self._endless: list[str] = []
        self._round: dict[str, float] = {}
        self._hulls: list[str] = []
        self._dynamics: dict[str, tuple[float, float]] = {}
        super().__init__(str(path), packages_of(path))

    def _check_geometry(self, link: ET.Element, geometry: ET.Element) -> None:
        if len(geometry) == 1 and (shape := geometry[0]).tag in ("sphere", "cylinder"):
            long = shape.tag == "cylinder"
            radius, length = (
                self.number(link, shape, key) for key in ("radius", "length" if long else "radius")
            )
            if min(radius, length) <= 0 or max(radius, length / 2) > FARTHEST:
                told = f"has a {shape.tag} whose size is not above 0, or not up to {FARTHEST:g} m"
                self.refuse(link, told, shape)
            kept, gap = _round(radius, length / 2 if long else 0.0)
            geometry.remove(shape)
            ET.SubElement(geometry, "mesh", filename=kept)
            self.meshes[kept] = kept
            name = link.attrib["name"]
            self._round[name] = max(gap, self._round.get(name, 0.0))
            return
        super()._check_geometry(link, geometry)
        self._hulls += [link.attrib["name"] for _ in geometry.findall("mesh")]

    def _check_joint(self, joint: ET.Element) -> None:
        name, limit = joint.attrib["name"], joint.find("limit")
        if joint.get("type") == "continuous":
            self._endless.append(name)
            joint.set("type", "revolute")
            limit = ET.SubElement(joint, "limit") if limit is None else limit
            limit.attrib.update(lower=repr(-WIDEST), upper=repr(WIDEST))
        if limit is not None:
            limit.attrib.setdefault("velocity", "0")
        super()._check_joint(joint)
        if joint.get("type") not in MOVING:
            return
        self._only(joint, joint, "limit").set("velocity", repr(FASTEST))
        self._dynamics[name] = 0.0, 0.0
        for dynamics in self._at_most_one(joint, joint, "dynamics"):
            damping = self.number(joint, dynamics, "damping", "0")
            friction = self.number(joint, dynamics, "friction", "0")
            if min(damping, friction) < 0:
                self.refuse(joint, "has a damping or friction below 0", dynamics)
            self._dynamics[name] = damping, friction

    def read(self) -> tuple[Scene, tuple[Carried, ...]]:
        path, moving = Path(self.path), list(self._dynamics)
        if not moving:
            raise DescriptionError(f"{path} has no joint that moves, so nothing in it does")
        kept = content(self, "tree")
        starts, couplings = self._starts()
        robot = Robot(
            name="tree",
            urdf=str(keep(kept["urdf"], kept["meshes"])),
            packages={},
            srdf="",
            joints=tuple(
                Joint(name, FREE, 0.0, FREE, 0.0, starts[name], *self._dynamics[name])
                for name in moving
            ),
            gripper=Gripper((), 0.0, 0.0, 0.0),
            tool_frame=self.root,
            couplings=couplings,
        )
        try:
            lift = max(0.0, -_lowest(robot))
        except DescriptionError as error:  # of the file that is kept
            raise DescriptionError(str(error).replace(robot.urdf, self.path)) from None
        robot = replace(robot, base=Pose.at(0.0, 0.0, lift))
        self._tell_all(moving, lift)
        name = path.stem.strip(" .") or "scene"
        scene = Scene(name, (), robot, file=self.path, file_lift=lift)
        return scene, tuple(self.account)

    def _starts(self) -> tuple[dict[str, float], tuple[Coupling, ...]]:
        """Where the joints start, and which follow others."""
        limits: dict[str, tuple[float, float]] = {}
        mimics: dict[str, Coupling] = {}
        for joint in self.joints:
            name, limit, mimic = joint.attrib["name"], joint.find("limit"), joint.find("mimic")
            if name in self._dynamics and limit is not None:
                limits[name] = float(limit.attrib["lower"]), float(limit.attrib["upper"])
                if mimic is not None:
                    ratio, offset = mimic.get("multiplier", "1"), mimic.get("offset", "0")
                    mimics[name] = Coupling(
                        name, mimic.attrib["joint"], float(ratio), float(offset)
                    )
        starts: dict[str, float] = {}
        open_: list[str] = []

        def start(name: str) -> float:
            if name not in starts:
                told = mimics.get(name)
                at = 0.0 if told is None else told.ratio * start(told.leader) + told.offset
                starts[name] = min(max(at, limits[name][0]), limits[name][1])
                if starts[name] != at:
                    open_.append(name)
            return starts[name]

        for name in limits:
            start(name)
        why = "joints start at 0, here at the nearest end of their range"
        self._tell("joint limit (start)", APPROXIMATED, why, set(open_) - set(mimics))
        why = "where its leader starts, it would be out of its range"
        self._tell("mimic", NOT_CARRIED, why, set(open_) & set(mimics))
        kept = {name: told for name, told in mimics.items() if name not in open_}
        self._tell("mimic", CARRIED, "as coupled joints", kept)
        return starts, tuple(kept.values())

    def _tell(self, quantity: str, state: str, reason: str, where: Iterable[str]) -> None:
        if names := sorted(where):
            self.account.append(Carried(quantity, state, reason, named(names)))

    def _tell_all(self, moving: list[str], lift: float) -> None:
        tell, whole = self._tell, [self.root]
        told = "link inertial, collision; joint origin, axis, limit lower, upper, dynamics"
        tell(told, CARRIED, f"{len(moving)} hinges and sliders, without drives", moving)
        why = f"they stop at {WIDEST:g} rad to each side"
        tell("joint type (continuous)", APPROXIMATED, why, self._endless)
        gap = 1000 * max(self._round.values(), default=0.0)
        why = f"round shapes are hulls of corners, up to {gap:.2g} mm smaller"
        tell("geometry sphere, cylinder", APPROXIMATED, why, self._round)
        why = "engines collide with its convex hull"
        tell("geometry mesh", APPROXIMATED, why, dict.fromkeys(self._hulls))
        why = "a URDF has neither; a level ground at z = 0 is there in addition, frictions are 1"
        tell("ground, friction", APPROXIMATED, why, whole)
        if lift:
            tell("height", APPROXIMATED, f"all is moved up by {lift:g} m, onto the ground", whole)
        tell("limit effort, velocity", NOT_CARRIED, "they are of drives", moving)
        why = "links collide with bodies and the ground, not with each other"
        tell("contacts between links", NOT_CARRIED, why, whole)
        unread: dict[str, list[str]] = {}
        for where, element in _unread(self.xml):
            unread.setdefault(element.tag, []).append(element.get("name") or where)
        for tag, names in unread.items():
            tell(tag, NOT_CARRIED, REASONS.get(tag, "nothing here reads it"), dict.fromkeys(names))


@cache
def _round(radius: float, half: float) -> tuple[str, float]:
    """A mesh of a cylinder of that half length, or with none of a sphere [m], and its `gap`."""
    points, gap = cylinder_hull(radius, half) if half else capsule_hull(radius)
    hull = Polytope(points)
    return str(keep_mesh(written_stl(hull.points[np.array(hull.triangles)]))), gap


def packages_of(path: Path) -> Mapping[str, str]:
    """Folders of the packages that a URDF names: folders of that name above it, or beside one of
    those. What is not found is left out."""
    found: dict[str, str] = {}
    for element in read_xml(str(path), "the scene").iter("mesh"):
        text = element.get("filename", "")
        name = text.removeprefix(PACKAGE).partition("/")[0]
        if text.startswith(PACKAGE) and name not in ("", ".", ".."):
            for folder in path.absolute().parents[:ABOVE]:
                if folder.name == name:
                    found.setdefault(name, str(folder))
                elif (folder / name).is_dir():
                    found.setdefault(name, str(folder / name))
    return found


def _unread(root: ET.Element) -> Iterator[tuple[str, ET.Element]]:
    """What is not read, each with the name of what it is in."""
    waiting = [(root.get("name", ""), root)]
    for where, element in waiting:
        for child in element:
            name = child.get("name") or where
            if child.tag not in READ.get(element.tag, ()):
                yield name, child
            else:
                waiting.append((name, child))


def _lowest(robot: Robot) -> float:
    """Height of the lowest point of any link at the start [m]."""
    prepared = PreparedRobot(robot)
    poses = link_poses(prepared)
    return min(
        (
            float(placed(shape_points(shape), poses[name])[:, 2].min())
            for name, link in prepared.links.items()
            for shape in link.shapes
        ),
        default=0.0,
    )
