"""The robot as every simulator is told to build it: description files, drives and gripper."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pytest_simbench.scene.checks import (
    STIFFEST,
    SceneError,
    Wire,
    check_name,
    check_number,
    check_numbers,
    check_pose,
)
from pytest_simbench.scene.pose import FloatArray, Pose, Vector3

WIDEST = 6.0
"""Limits of a hinge without any [rad]: less than a turn to each side, which every engine holds."""

FARTHEST = 10.0
"""Limits of a slider without any [m]."""

FASTEST = 1000.0
"""Largest speed of a joint, which a file does not limit [rad/s or m/s]."""

FREE = 1e-6
"""Stiffness [N m/rad, N/m] and largest effort [N m, N] of a drive that leaves its joint free: less
than a millionth of all that acts here. Of 0, engines that divide by a stiffness make no number, and
others no drive; one whose drives are no springs needs the small effort."""


@dataclass(frozen=True)
class Joint(Wire):
    """One driven joint and its controller: tau = clip(k (q* - q) + d (v* - v) + tau_ff, +-limit).

    What the joint does by itself comes in addition, beyond the drive's limit: tau = spring (rest -
    q) - passive_damping v, and dry friction.

    Attributes:
        name: as in the robot's URDF.
        stiffness: k [N m/rad], or [N/m] for a prismatic joint; at least `FREE`, which 0 becomes.
        damping: d [N m s/rad], or [N s/m].
        effort_limit: largest effort of the drive [N m], or [N].
        armature: rotor inertia as seen at the joint [kg m^2], or [kg].
        initial_position: [rad], or [m].
        passive_damping: of the joint itself [N m s/rad], or [N s/m].
        friction: largest effort with which the joint resists motion [N m], or [N] (Coulomb's dry
            friction): it holds against what pulls less, and brakes what moves.
        spring: stiffness of a spring in the joint [N m/rad], or [N/m].
        rest: position at which that spring is without load [rad], or [m].
        gravity: share of the scene's gravity that the link which it moves feels; 0: its weight is
            compensated. At most 1: engines may pass over more.
        file_zero: position that its file gives it where it is at 0 here [rad], or [m].
    """

    optional = ("passive_damping", "friction", "spring", "rest", "gravity", "file_zero")

    name: str
    stiffness: float
    damping: float
    effort_limit: float
    armature: float
    initial_position: float
    passive_damping: float = 0.0
    friction: float = 0.0
    spring: float = 0.0
    rest: float = 0.0
    gravity: float = 1.0
    file_zero: float = 0.0

    def __post_init__(self) -> None:
        check_name(self.name, "a joint")
        of_drive = ("stiffness", "damping", "effort_limit", "armature")
        for quantity in (*of_drive, "passive_damping", "friction", "spring"):
            what = f"the {quantity} of joint {self.name!r}"
            check_number(getattr(self, quantity), what, 0.0, STIFFEST)
        object.__setattr__(self, "stiffness", max(self.stiffness, FREE))
        check_number(self.initial_position, f"the initial position of joint {self.name!r}")
        check_number(self.rest, f"the rest position of the spring in joint {self.name!r}")
        what = f"the share of gravity of the link on joint {self.name!r}"
        check_number(self.gravity, what, most=1.0)

    @property
    def motor(self) -> bool:
        """Whether its drive pushes the commanded effort alone: tau = clip(tau_ff, +-limit)."""
        return self.stiffness <= FREE < self.effort_limit and not self.damping


@dataclass(frozen=True)
class Gripper(Wire):
    """A gripper; without joints, a hand that only touches.

    Its fingers are coupled mechanically: they always stand equally far from the middle. Without
    that, two fingers that both press with their largest force leave the object free between them.

    Attributes:
        joints: names of its finger joints, coupled and commanded together.
        opened: position of each finger, open [m]; of a jaw that turns [rad].
        closed: position commanded to grasp, beyond the object's surface [m], or [rad].
        squeeze: the force each finger then presses with [N], of a jaw that turns the torque [N m]:
            its effort limit. The commanded position lies so deep that the drive saturates, and
            every engine squeezes alike.
    """

    joints: tuple[str, ...]
    opened: float
    closed: float
    squeeze: float

    def __post_init__(self) -> None:
        for name in self.joints:
            check_name(name, "a joint of the gripper")
        for quantity in ("opened", "closed"):
            check_number(getattr(self, quantity), f"the gripper's position {quantity!r} [m]")
        check_number(self.squeeze, "the gripper's squeeze [N]", 0.0)

    @property
    def couplings(self) -> tuple[Coupling, ...]:
        """Each other joint stands where the first one does."""
        return tuple(Coupling(other, self.joints[0]) for other in self.joints[1:])


@dataclass(frozen=True)
class Closure(Wire):
    """What closes a loop of links, which no tree of joints has: a point of one link is held at a
    point of another, and both turn freely about it (a ball and its socket), or not at all.

    Attributes:
        first, second: links of the robot's URDF.
        first_point, second_point: the points, each in the frame of its link [m].
        rigid: a weld: the links keep how they are turned to each other where the joints start.

    Raises:
        SceneError: a link that is held at itself, or a number that is none.
    """

    optional = ("rigid",)

    first: str
    second: str
    first_point: Vector3 = (0.0, 0.0, 0.0)
    second_point: Vector3 = (0.0, 0.0, 0.0)
    rigid: bool = False

    def __post_init__(self) -> None:
        for name in (self.first, self.second):
            check_name(name, "a link of a closure")
        if self.first == self.second:
            raise SceneError(f"a closure holds link {self.first!r} at itself")
        for _, point in self.sides:
            check_numbers(point, 3, f"a point [m] of the closure of {self.first!r}")

    @property
    def sides(self) -> tuple[tuple[str, Vector3], tuple[str, Vector3]]:
        """Both links, each with its point."""
        return (self.first, self.first_point), (self.second, self.second_point)


@dataclass(frozen=True)
class Coupling(Wire):
    """Two joints that move together, as gears do: q_follower = ratio q_leader + offset.

    Attributes:
        follower, leader: names of the joints.
        ratio: travel of the follower for that of the leader.
        offset: position of the follower where the leader is at 0 [rad or m].

    Raises:
        SceneError: a joint that is coupled with itself, or a number that is none.
    """

    follower: str
    leader: str
    ratio: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        for name in (self.follower, self.leader):
            check_name(name, "a joint of a coupling")
        if self.follower == self.leader:
            raise SceneError(f"a coupling joins joint {self.leader!r} with itself")
        check_number(self.ratio, f"the ratio of {self.follower!r} to {self.leader!r}")
        check_number(self.offset, f"the offset of {self.follower!r} from {self.leader!r}")


@dataclass(frozen=True)
class MotionLimits:
    """How the arm may be moved: what motions are planned within. No simulator is told.

    Attributes:
        velocity: of each arm joint [rad/s].
        acceleration: [rad/s^2].
        jerk: [rad/s^3].
        levers: distance of the fingertips from each arm joint's axis [m]: a turn of joint i by dq
            moves them about levers[i] dq; 1 of one that slides. Collisions are checked by it.
        finger_speed: of each finger [m/s]; of a jaw that turns [rad/s].
    """

    velocity: tuple[float, ...]
    acceleration: tuple[float, ...]
    jerk: tuple[float, ...]
    levers: tuple[float, ...]
    finger_speed: float

    def __post_init__(self) -> None:
        arms = ("velocity", "acceleration", "jerk", "levers")
        for what in arms:
            for number in getattr(self, what):
                check_number(number, f"a limit of motion ({what})", 0.0, above=True)
        check_number(self.finger_speed, "the speed of the fingers [m/s]", 0.0, above=True)
        counts = {what: len(getattr(self, what)) for what in arms}
        if len(set(counts.values())) > 1:
            told = ", ".join(f"{what} of {count}" for what, count in counts.items())
            raise SceneError(f"limits of motion of several numbers of joints: {told}")

    def column(self, what: str) -> FloatArray:
        """One limit of all arm joints, (n_arm,): `limits.column("velocity")`."""
        return np.array(getattr(self, what), dtype=float)


@dataclass(frozen=True)
class Robot(Wire):
    """A fixed-base arm with a gripper.

    Attributes:
        name: of the robot ("panda").
        urdf: path of its URDF file.
        packages: directory of each `package://NAME/` that the URDF refers to.
        srdf: path of its SRDF file, which lists the link pairs not to be checked for collision;
            empty for none.
        joints: the driven joints in command order, arm first, then fingers, then those `beside`.
        gripper: the fingers.
        tool_frame: link whose origin is the tool centre point.
        base: pose of the root link in the world.
        friction: of every link's surface.
        limits: of the arm's motion; None for a robot that no task moves. They stay on this side:
            simulators are not told, and a robot that came over the wire has none.
        swing: arm joints before and after a throw, each (n_arm,) [rad]; None where none is known.
            It stays on this side too.
        stand: pose of the root link in the tasks on the table; None where it is `base`. It stays on
            this side too.
        closures: what closes loops of its links; only for engines with the capability `loops`.
        self_collide: whether its links collide with each other (SDF's word); two that one joint
            joins never do. Only for engines with the capability `self_collide`.
        couplings: what moves joints together, beside the gripper; only for engines with the
            capability `couplings`.
        beside: names of the last joints, where they move a thing that stands beside the arm
            (`motion.beside`): plans move around it, and no command moves it.
    """

    optional = ("closures", "self_collide", "couplings", "beside")
    unwritten = ("limits", "swing", "stand")

    name: str
    urdf: str
    packages: Mapping[str, str] = field(hash=False)
    srdf: str
    joints: tuple[Joint, ...]
    gripper: Gripper
    tool_frame: str
    base: Pose = field(default_factory=Pose)
    friction: float = 1.0
    limits: MotionLimits | None = field(default=None, compare=False)
    swing: tuple[tuple[float, ...], tuple[float, ...]] | None = field(default=None, compare=False)
    stand: Pose | None = field(default=None, compare=False)
    closures: tuple[Closure, ...] = ()
    self_collide: bool = False
    couplings: tuple[Coupling, ...] = ()
    beside: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_name(self.name, "a robot")
        check_name(self.tool_frame, f"the tool frame of {self.name!r}")
        for path in (self.urdf, self.srdf, *self.packages, *self.packages.values()):
            if not isinstance(path, str) or "\0" in path:
                raise SceneError(f"robot {self.name!r} is described by {path!r}, which is no path")
        check_pose(self.base, f"the base of {self.name!r}")
        if self.stand is not None:
            check_pose(self.stand, f"the stand of {self.name!r}")
        check_number(self.friction, f"the friction of {self.name!r}", 0.0)
        names = self.joint_names
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise SceneError(f"robot {self.name!r} has several drives for {', '.join(twice)}")
        coupled = [name for c in self.couplings for name in (c.follower, c.leader)]
        for what, joints in (("the gripper", self.gripper.joints), ("a coupling", coupled)):
            if unknown := sorted({*joints} - {*names}):
                raise SceneError(
                    f"{what} of {self.name!r} has the joints {', '.join(unknown)}, which have no "
                    f"drives; choose from {', '.join(names)}"
                )
        last = names[len(names) - len(self.beside) :]
        if self.beside != last or set(self.beside) & set(self.gripper.joints):
            raise SceneError(
                f"the joints {', '.join(self.beside)} beside robot {self.name!r} must be its last, "
                f"after the gripper's; its last are {', '.join(last)}"
            )
        if self.limits is not None and len(self.limits.velocity) != len(self.arm_joints):
            raise SceneError(
                f"robot {self.name!r} has {len(self.arm_joints)} arm joints and limits of motion "
                f"of {len(self.limits.velocity)}"
            )
        for end in self.swing or ():
            check_numbers(end, len(self.arm_joints), f"the swing [rad] of {self.name!r}")

    @property
    def joint_names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.joints)

    @property
    def arm_joints(self) -> tuple[Joint, ...]:
        others = (*self.gripper.joints, *self.beside)
        return tuple(joint for joint in self.joints if joint.name not in others)

    @property
    def finger_indices(self) -> list[int]:
        """Where the gripper's joints stand among `joints`."""
        return [self.joint_names.index(name) for name in self.gripper.joints]

    def with_joints(self, *names: str, **values: Any) -> Robot:
        """The same robot with values of some joints replaced."""
        joints = (replace(j, **values) if j.name in names else j for j in self.joints)
        return replace(self, joints=tuple(joints))

    def scaled(self, *names: str, **factors: float) -> Robot:
        """The same robot with values of some joints multiplied."""
        scaled = self
        for joint in self.joints:
            if joint.name in names:
                values = {key: factor * getattr(joint, key) for key, factor in factors.items()}
                scaled = scaled.with_joints(joint.name, **values)
        return scaled

    def as_motors(self) -> Robot:
        """The same robot, the drives of its arm pushing the commanded efforts alone."""
        names = (joint.name for joint in self.arm_joints)
        return self.with_joints(*names, stiffness=FREE, damping=0.0)

    def squeezing(self, force: float) -> Robot:
        """The same robot, each finger pressing with at most `force` [N], or [N m] of a jaw."""
        robot = self.with_joints(*self.gripper.joints, effort_limit=force)
        return replace(robot, gripper=replace(self.gripper, squeeze=force))

    def column(self, attribute: str) -> FloatArray:
        """One attribute of all joints, (n_joints,): `robot.column("effort_limit")`."""
        return np.array([getattr(joint, attribute) for joint in self.joints], dtype=float)
