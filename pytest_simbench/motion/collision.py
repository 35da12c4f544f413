"""The planning scene: robot, obstacles and held cube, checked for collision by Coal."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from pytest_simbench.description.links import link_poses
from pytest_simbench.description.robot_files import description_xml, robot_cache
from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.motion.hulls import outward_faces
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import Body, FloatArray, Pose, Robot, Scene
from pytest_simbench.scene.overlap import box_corners

MARGIN = 0.012
"""Distance kept from obstacles in free motions [m]; straight approaches may touch. In a scene of
the study's size; all distances here go with the scene's scale but `FLATNESS`."""

HELD_SLACK = 0.002
"""The held cube is checked smaller by this on each face [m]: it may rest where it stands."""

FLATNESS = 0.0005
"""What stands back by less belongs to the hand's front [m]."""

GROUND = "ground"


class PlanningScene:
    """Where the robot would touch what.

    Meshes of the links are checked as their convex hulls, which is what the engines collide too.
    Link pairs listed in the SRDF are not checked. The root link is fixed and not checked
    against the world.

    Attributes:
        scale: of the scene's lengths over those of the study's.
        opening: position of each finger that is assumed in every check [m, or rad].
        held: name of the cube in the hand (`attach`), or None.
    """

    def __init__(self, model: RobotModel, scene: Scene, scale: float = 1.0) -> None:
        self.model = model
        self.scale = scale
        self.opening = model.robot.gripper.opened
        self.held: str | None = None
        self._active_for: tuple[str | None, tuple[str, ...]] | None = None
        geometry = _links(model.robot).copy()
        self._links = list(range(len(geometry.geometryObjects)))
        inverse = model.base.inverse()
        self._free = {body.name: body for body in scene.free_bodies}
        self._bodies: dict[str, int] = {}
        for body in scene.bodies:
            shape = coal.Box(*body.extents)
            placement = inverse * pin.SE3(body.pose.matrix())
            obstacle = pin.GeometryObject(body.name, 0, placement, shape)
            self._bodies[body.name] = geometry.addGeometryObject(obstacle)
        half_space = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
        ground = geometry.addGeometryObject(pin.GeometryObject(GROUND, 0, inverse, half_space))
        moving = [i for i in self._links if geometry.geometryObjects[i].parentJoint > 0]
        self._find_things(geometry)
        for obstacle_index in [*self._bodies.values(), ground]:
            for link in moving:
                geometry.addCollisionPair(pin.CollisionPair(link, obstacle_index))
        self._add_held_cubes(scene, geometry, ground)
        self._geometry = geometry
        self._pairs = [(pair.first, pair.second) for pair in geometry.collisionPairs]
        self._exact, self._wide = pin.GeometryData(geometry), pin.GeometryData(geometry)
        arm = set(self._links) - {shape for shapes in self._things.values() for shape in shapes}
        for request, pair in zip(self._wide.collisionRequests, self._pairs, strict=True):
            request.security_margin = 0.0 if arm.issuperset(pair) else MARGIN * scale
        self.update({body.name: body.pose for body in scene.free_bodies})

    def _add_held_cubes(self, scene: Scene, geometry: pin.GeometryModel, ground: int) -> None:
        """Every free cube once more, riding on the hand; checked only while it is held."""
        tool = self.model.pin.frames[self.model.tool]
        hand_links = {
            i for i in self._links if geometry.geometryObjects[i].parentJoint >= tool.parentJoint
        }
        self._riding: dict[str, int] = {}
        self._tool_in_joint = tool.placement
        for body in scene.free_bodies:
            rider = pin.GeometryObject(
                f"held {body.name}",
                tool.parentJoint,
                tool.placement,
                coal.Box(*(edge - 2 * HELD_SLACK * self.scale for edge in body.extents)),
            )
            index = geometry.addGeometryObject(rider)
            self._riding[body.name] = index
            for link in self._links:
                if link not in hand_links:
                    geometry.addCollisionPair(pin.CollisionPair(link, index))
            for other, obstacle in [*self._bodies.items(), (GROUND, ground)]:
                if other != body.name:
                    geometry.addCollisionPair(pin.CollisionPair(index, obstacle))

    def _find_things(self, geometry: pin.GeometryModel) -> None:
        """Shapes of the links beside the arm, by link, each with its pose there."""
        self._things: dict[str, dict[int, pin.SE3]] = {}
        self._prepared: PreparedRobot | None = None
        if not self.model.robot.beside:
            return
        self._prepared = prepared = _prepared(self.model.robot)
        for index in self._links:
            shape = geometry.geometryObjects[index]
            frame = self.model.pin.frames[shape.parentFrame]
            link, pose = prepared.places[frame.name]
            if shape.parentJoint == 0 and link != prepared.root:
                within = pin.SE3(pose.matrix()) * frame.placement.actInv(shape.placement)
                self._things.setdefault(link, {})[index] = within

    def update(self, poses: Mapping[str, Pose], joints: FloatArray | None = None) -> None:
        """Take over the cubes' present poses in the world, and where the robot's joints are, for
        what is beside the arm."""
        inverse = self.model.base.inverse()
        if self._prepared and joints is not None:
            placed = link_poses(self._prepared, joints)
            for link, shapes in self._things.items():
                for index, within in shapes.items():
                    at = inverse * pin.SE3(placed[link].matrix()) * within
                    self._geometry.geometryObjects[index].placement = at
        for name, pose in poses.items():
            shape = self._geometry.geometryObjects[self._bodies[name]]
            shape.placement = inverse * pin.SE3(pose.matrix())

    def attach(self, name: str, in_tool: Pose) -> None:
        """From now on cube `name` moves with the hand, at `in_tool` in the tool frame."""
        self.held = name
        rider = self._geometry.geometryObjects[self._riding[name]]
        rider.placement = self._tool_in_joint * pin.SE3(in_tool.matrix())

    @property
    def held_body(self) -> Body | None:
        """What is in the hand."""
        return None if self.held is None else self._free[self.held]

    def front(self, above: float) -> tuple[float, float]:
        """The face with which the closed hand pushes along its tool frame's x [m]: how far it
        stands before the tool centre point, and how wide it is. It may touch what it pushes up to
        `above` that point [m]."""
        model = self.model
        points = self._hand(model.robot.gripper.closed, above, model.arm)
        depth = float(points[:, 0].max())
        face = points[points[:, 0] > depth - FLATNESS, 1]
        return depth, float(face.max() - face.min())

    def gap(self, opening: float, above: float) -> float:
        """How far a jaw that turns stands from the plane y = 0 of the tool frame [m], on which the
        face of the fixed jaw lies; infinite where it is all above.

        Args:
            opening: position of the jaw [rad].
            above: how far above the tool centre point what it grasps ends [m].
        """
        return float(self._hand(opening, above, self.model.arm + 1)[:, 1].min(initial=np.inf))

    def depths(self) -> tuple[float, float]:
        """How far above the tool centre point the palm of the open hand stands, and how far below
        it the tips end [m]."""
        opened, arm = self.model.robot.gripper.opened, self.model.arm
        palm = self._hand(opened, np.inf, arm, arm)[:, 2].max(initial=-np.inf)
        return -float(palm), float(self._hand(opened, np.inf, arm)[:, 2].max())

    def _hand(
        self, opening: float, above: float, first: int, last: int | None = None
    ) -> FloatArray:
        """Corners of the hand's part at most so far above the tool centre point [m], in the tool
        frame, (n, 3), of the links that joints `first` to `last` carry; the fingers at
        `opening`."""
        model = self.model
        fingers = np.full(model.pin.nq - model.arm, opening)
        q = np.concatenate([model.home, fingers])
        pin.updateGeometryPlacements(model.pin, model.data, self._geometry, self._exact, q)
        tool = pin.updateFramePlacement(model.pin, model.data, model.tool)
        corners = [
            _below(tool.actInv(self._exact.oMg[link]), shape.geometry, above)
            for link in self._links
            if first <= (shape := self._geometry.geometryObjects[link]).parentJoint
            and (last is None or shape.parentJoint <= last)
        ]
        return np.concatenate(corners)

    def _activate(self, ignored: tuple[str, ...]) -> None:
        """Switch off the pairs of ignored bodies, of the held cube's place, of cubes not held."""
        if self._active_for == (self.held, ignored):
            return
        self._active_for = self.held, ignored
        off: set[int] = set()
        for name in ignored:
            off.update(self._things.get(name) or (self._bodies[name],))
        if self.held is not None:
            off.add(self._bodies[self.held])
        off |= {index for name, index in self._riding.items() if name != self.held}
        active = [first not in off and second not in off for first, second in self._pairs]
        for data in (self._exact, self._wide):
            data.activeCollisionPairs = active

    def collision(
        self, arm: FloatArray, *, ignored: Iterable[str] = (), margin: bool = True
    ) -> tuple[str, str] | None:
        """The first two things that touch at arm joints `arm`, or None.

        Args:
            ignored: bodies that may be touched, the cube to be grasped for instance, and links
                beside the arm.
            margin: keep `MARGIN` from obstacles.
        """
        return self.first_collision(np.asarray(arm)[None], ignored=ignored, margin=margin)

    def first_collision(
        self, path: FloatArray, *, ignored: Iterable[str] = (), margin: bool = True
    ) -> tuple[str, str] | None:
        """The same for positions along a path, (n, arm)."""
        self._activate(tuple(ignored))
        model, geometry = self.model, self._geometry
        data = self._wide if margin else self._exact
        fingers = np.full(model.pin.nq - model.arm, self.opening)
        for arm in path:
            q = np.concatenate([arm, fingers])
            if pin.computeCollisions(model.pin, model.data, geometry, data, q, True):
                for index, (first, second) in enumerate(self._pairs):
                    touching = data.collisionResults[index].isCollision()
                    if touching and data.activeCollisionPairs[index]:
                        objects = geometry.geometryObjects
                        return objects[first].name, objects[second].name
                return "robot", "obstacle"
        return None


@robot_cache
def _prepared(robot: Robot) -> PreparedRobot:
    """The reduced robot."""
    return PreparedRobot(robot)


@robot_cache
def _links(robot: Robot) -> pin.GeometryModel:
    """The shapes of a robot's links and the pairs to check. Its files are sound."""
    model = RobotModel(robot).pin
    urdf = ET.tostring(description_xml(robot), encoding="unicode")
    geometry = pin.buildGeomFromUrdfString(model, urdf, pin.GeometryType.COLLISION, package_dirs=[])
    for shape in geometry.geometryObjects:
        if isinstance(shape.geometry, coal.BVHModelBase):
            shape.geometry = convex_hull(np.asarray(shape.geometry.vertices()))
    geometry.addAllCollisionPairs()
    if robot.srdf:
        pin.removeCollisionPairs(model, geometry, robot.srdf)
    return geometry


def convex_hull(points: FloatArray) -> coal.Convex:
    """The hull of points, (n, 3) [m], as a shape, with the points in its corners alone.

    Coal's own (`buildConvexRepresentation`) keeps those within as corners without neighbours. Its
    search for the farthest corner ends there: with the UR5's links it missed 119 of 368 contacts.
    """
    hull = ConvexHull(points)
    number = np.zeros(len(points), dtype=int)
    number[hull.vertices] = np.arange(len(hull.vertices))
    corners, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for corner in points[hull.vertices]:
        corners.append(corner)
    for face in number[outward_faces(hull)].tolist():
        faces.append(coal.Triangle(*face))
    return coal.Convex(corners, faces)


def _below(placement: pin.SE3, shape: coal.CollisionGeometry, above: float) -> FloatArray:
    """Corners of the part of a convex shape that lies at most so far above the tool centre point,
    in the tool frame, whose z points down; (n, 3)."""
    if isinstance(shape, coal.Box):
        corners = box_corners(2 * shape.halfSide)
    else:
        corners = np.asarray(shape.points())
    corners = corners @ placement.rotation.T + placement.translation
    low = corners[:, 2] >= -above
    # what cuts the plane between any two corners lies in the shape, and all edges are among them
    inside, outside = corners[low], corners[~low]
    a, b = np.repeat(inside, len(outside), axis=0), np.tile(outside, (len(inside), 1))
    share = ((-above - a[:, 2]) / (b[:, 2] - a[:, 2]))[:, None]
    return np.concatenate([inside, a + share * (b - a)])
