"""The whole world of a repetition, as plain data that crosses the process boundary."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations

from pytest_simbench.scene.body import Body
from pytest_simbench.scene.checks import (
    RESERVED,
    SceneError,
    Wire,
    check_choice,
    check_name,
    check_number,
    check_numbers,
)
from pytest_simbench.scene.friction import RULES
from pytest_simbench.scene.penetration import penetration
from pytest_simbench.scene.pose import Pose, Vector3
from pytest_simbench.scene.robot import Robot

STANDARD_GRAVITY: Vector3 = (0.0, 0.0, -9.80665)
"""Standard acceleration of free fall [m/s^2] (ISO 80000-3)."""

ROOM: Vector3 = (5.0, 5.0, 10.0)
"""[m]. The arm throws at 3 m/s from at most 1.4 m up: that flies 2 m and slides or rolls 1 m."""

OVERLAP_TOLERANCE = 1e-4
"""Bodies may overlap this deep at the start [m]: resting contacts are given to rounding."""


@dataclass(frozen=True)
class Start(Wire):
    """Where a scene may start.

    Attributes:
        bodies: names of free bodies.
        poses: of each, in the frame that its file gives it (`Compound.file_frame`).
        positions: of the robot's joints [rad or m]; empty: as the scene has them.
        targets: what its drives are told there; empty: the positions.
        speeds: velocities that they are told [rad/s or m/s]; empty: none.
        efforts: what they are told in addition [N m or N]; empty: none.
    """

    bodies: tuple[str, ...]
    poses: tuple[Pose, ...]
    positions: tuple[float, ...] = ()
    targets: tuple[float, ...] = ()
    speeds: tuple[float, ...] = ()
    efforts: tuple[float, ...] = ()


WORDS = {
    "box", "sphere", "cylinder", "capsule", "convex_mesh", "compound", "file", "frictions",
    "restitution", "damping", "wrench", "prescribed", "loop", "self_collide", "apart", "coupling",
    "passive_damping", "joint_friction", "spring", "motor", "link_gravity",
}  # fmt: skip
"""What a scene may have: kinds of bodies, `file` (it is read from one), several frictions; from
`coupling` on of joints (`link_gravity`: a share of it)."""


@dataclass(frozen=True)
class Scene(Wire):
    """Bodies, robot and gravity above an endless ground plane at z = 0.

    Attributes:
        name: for messages and file names.
        bodies: fixed and free.
        robot: the arm, or None for a scene of bodies alone.
        gravity: [m/s^2].
        ground_friction: Coulomb coefficient of the ground plane.
        room: how far it goes from the origin to each side in x and in y, and up [m]. A free body
            that leaves it has diverged (`plausibility`); 1e6 for a side without a wall.
        ground_restitution: Newton's coefficient of the ground plane, as `Body.restitution`.
        starts: for tasks that go through several. Right after a file was read they are its
            keyframes. A worker does not get them.
        friction_rule: what the friction of two surfaces is, one of `friction.RULES`.
        apart: pairs that do not collide, each two of "ground", `body/NAME` and `link/NAME`; links
            are those of the reduced robot. Only for engines with the capability `apart`.
        written: poses of the bodies before a task moved them: what touches there counts for their
            frictions, in each repetition alike; empty: as they stand.
        file: that it was read from, an absolute path; empty: none.
        file_timestep: time step that the file asks for [s]; 0: none.
        file_lift: height by which all stands higher here than in the file [m].

    Raises:
        SceneError: two bodies share a name or overlap, one has the name of what is in every
            scene, a free one is outside the room, or a number is none.
    """

    unwritten = ("starts",)
    optional = (
        "ground_restitution",
        "friction_rule",
        "apart",
        "written",
        "file",
        "file_timestep",
        "file_lift",
    )

    name: str
    bodies: tuple[Body, ...] = ()
    robot: Robot | None = None
    gravity: Vector3 = field(default=STANDARD_GRAVITY)
    ground_friction: float = 1.0
    room: Vector3 = field(default=ROOM)
    ground_restitution: float = 0.0
    friction_rule: str = "maximum"
    apart: tuple[tuple[str, str], ...] = ()
    starts: tuple[Start, ...] = ()
    written: tuple[Pose, ...] = ()
    file: str = ""
    file_timestep: float = 0.0
    file_lift: float = 0.0

    def __post_init__(self) -> None:
        check_name(self.name, "a scene")
        check_numbers(self.gravity, 3, f"the gravity [m/s^2] of scene {self.name!r}")
        check_number(self.ground_friction, f"the ground's friction in scene {self.name!r}", 0.0)
        check_numbers(self.room, 3, f"the room [m] of scene {self.name!r}", 0.0, above=True)
        what = f"the ground's restitution in scene {self.name!r}"
        check_number(self.ground_restitution, what, 0.0, 1.0)
        what = f"the rule of scene {self.name!r} for the friction of two surfaces"
        check_choice(self.friction_rule, what, [*RULES])
        names = [body.name for body in self.bodies]
        for name in names:
            if name.lower() in RESERVED:
                raise SceneError(
                    f"scene {self.name!r}: a body is named {name!r}, as something in every scene "
                    "is; give it another name"
                )
        for name in names:
            if names.count(name) > 1:
                raise SceneError(
                    f"scene {self.name!r}: {names.count(name)} bodies are named {name!r}"
                )
        known = {"ground", *(f"body/{name}" for name in names)}
        for name in {name for pair in self.apart for name in pair} - known:
            if not name.startswith("link/") or self.robot is None:
                raise SceneError(
                    f"scene {self.name!r}: {name!r} is kept apart and not there; name two of "
                    "'ground', 'body/NAME' and 'link/NAME'"
                )
        for body in self.free_bodies:
            at = zip(map(abs, body.pose.position[:2]), self.room[:2], strict=True)
            if any(value > wall for value, wall in at) or body.pose.position[2] > self.room[2]:
                raise SceneError(
                    f"scene {self.name!r}: {body.name!r} is outside the room {self.room} [m]; move "
                    "it, or give the scene a larger `room`"
                )
        for a, b in combinations(self.bodies, 2):
            if not (a.mass or b.mass):
                continue
            if self.apart and self.kept_apart(f"body/{a.name}", f"body/{b.name}"):
                continue
            depth = penetration(a, b)
            if depth > OVERLAP_TOLERANCE:
                raise SceneError(
                    f"scene {self.name!r}: {a.name!r} and {b.name!r} overlap by "
                    f"{1000 * depth:.1f} mm; move one of them"
                )

    @property
    def arm(self) -> Robot:
        """The robot.

        Raises:
            SceneError: it has none.
        """
        if self.robot is None:
            raise SceneError(f"scene {self.name!r} has no robot")
        return self.robot

    @cached_property
    def free_bodies(self) -> tuple[Body, ...]:
        """The bodies that can move, in scene order: the rows of every body state. They are those
        with a mass and the prescribed ones."""
        return tuple(body for body in self.bodies if not body.fixed)

    @cached_property
    def prescribed_bodies(self) -> tuple[Body, ...]:
        """The bodies that move as prescribed, in scene order."""
        return tuple(body for body in self.bodies if body.prescribed)

    @cached_property
    def fixed_bodies(self) -> tuple[Body, ...]:
        return tuple(body for body in self.bodies if body.fixed)

    @cached_property
    def words(self) -> frozenset[str]:
        """What is in it, of `WORDS`."""
        bodies = self.bodies
        joints = () if self.robot is None else self.robot.joints
        found = {
            "file": bool(self.file),
            "frictions": len(self.frictions) > 1,
            "restitution": self.ground_restitution or any(body.restitution for body in bodies),
            "damping": any(body.damping.any() for body in bodies),
            "wrench": any(body.wrenches for body in bodies),
            "prescribed": bool(self.prescribed_bodies),
            "loop": self.robot is not None and bool(self.robot.closures),
            "self_collide": self.robot is not None and self.robot.self_collide,
            "apart": bool(self.apart),
            "coupling": self.robot is not None and bool(self.robot.couplings),
            "passive_damping": any(joint.passive_damping for joint in joints),
            "joint_friction": any(joint.friction for joint in joints),
            "spring": any(joint.spring for joint in joints),
            "motor": any(joint.motor for joint in joints),
            "link_gravity": any(joint.gravity != 1 for joint in joints),
        }
        kinds = {part.kind for body in bodies for part in (body, *body.parts)}
        return frozenset(kinds | {word for word, there in found.items() if there})

    @cached_property
    def frictions(self) -> frozenset[float]:
        """Of all surfaces: the ground, the bodies, the robot."""
        robot = () if self.robot is None else (self.robot.friction,)
        return frozenset((self.ground_friction, *robot, *(body.friction for body in self.bodies)))

    def kept_apart(self, first: str, second: str) -> bool:
        """Whether two of "ground", `body/NAME` and `link/NAME` are a pair of `apart`."""
        return frozenset((first, second)) in self._apart

    @cached_property
    def _apart(self) -> frozenset[frozenset[str]]:
        return frozenset(map(frozenset, self.apart))

    def body(self, name: str) -> Body:
        """The body of that name.

        Raises:
            KeyError: no such body; the message lists those there are.
        """
        for body in self.bodies:
            if body.name == name:
                return body
        raise KeyError(
            f"no body {name!r} in scene {self.name!r}; it has {[b.name for b in self.bodies]}"
        )

    def with_frictions(self, of: Callable[[float], float]) -> Scene:
        """The same scene, the friction of each surface changed."""
        bodies = tuple(body.with_friction(of(body.friction)) for body in self.bodies)
        robot = self.robot and replace(self.robot, friction=of(self.robot.friction))
        return replace(self, bodies=bodies, robot=robot, ground_friction=of(self.ground_friction))

    def with_body(self, body: Body) -> Scene:
        """The same scene with one body replaced by its namesake."""
        self.body(body.name)
        return replace(self, bodies=tuple(body if b.name == body.name else b for b in self.bodies))

    def at_start(self, start: Start) -> Scene:
        """The same scene, which starts there."""
        moved = {}
        for name, pose in zip(start.bodies, start.poses, strict=True):
            body = self.body(name)
            moved[name] = body.moved_to(pose * getattr(body, "file_frame", Pose()).inverse())
        robot = self.robot
        if robot is not None and start.positions:
            pairs = zip(robot.joints, start.positions, strict=True)
            joints = tuple(replace(joint, initial_position=at) for joint, at in pairs)
            robot = replace(robot, joints=joints)
        bodies = tuple(moved.get(body.name, body) for body in self.bodies)
        return replace(self, bodies=bodies, robot=robot)

    def with_pose(self, name: str, pose: Pose) -> Scene:
        return self.with_body(self.body(name).moved_to(pose))
