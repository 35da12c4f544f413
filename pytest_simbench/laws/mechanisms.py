"""Small mechanisms of rods and sliders, as robots without a hand.

They are trees: each part hangs on another one, or on the mount, which is fixed in the world. So one
mount carries several mechanisms that do not know of each other.
"""

from __future__ import annotations

from dataclasses import dataclass

from pytest_simbench.description.robot_files import keep
from pytest_simbench.scene import Closure, Coupling, Gripper, Joint, Pose, Robot, Vector3
from pytest_simbench.scene.robot import FARTHEST, FREE, WIDEST

STRONG = 1e4
"""Effort limit of a drive that is to obey its law [N m]."""

Y: Vector3 = (0.0, 1.0, 0.0)

MOUNT = "mount"
"""The part that is fixed in the world."""

INERTIA_OF_A_POINT = 1e-4
"""Principal moments of a bob [kg m^2], m r^2 = 1 kg (1 cm)^2: engines refuse a point, which has
none. The laws take it into account."""


@dataclass(frozen=True)
class Part:
    """A link and the joint it hangs on.

    Attributes:
        name: of the joint; the link is `NAME link`.
        axis: of the joint, in the frame of the part that it hangs on.
        offset: of the joint, there [m].
        centre: of mass, from the joint [m].
        mass: [kg].
        inertia: principal moments about the centre [kg m^2].
        start: of the joint [rad or m].
        slides: a prismatic joint; else a hinge.
        stiffness, damping: of its drive, see `scene.Joint`; 0: the joint is free.
        effort: of its drive, at most [N m or N].
        passive_damping, friction, spring, rest, gravity: of the joint itself, see `scene.Joint`.
        shape: edges of a box about the centre of mass that collides [m]; None: nothing does.
        on: name of the part that it hangs on, or `MOUNT`; None: on the one before it.
    """

    name: str
    axis: Vector3
    offset: Vector3 = (0.0, 0.0, 0.0)
    centre: Vector3 = (0.0, 0.0, 0.0)
    mass: float = 1.0
    inertia: Vector3 = (INERTIA_OF_A_POINT,) * 3
    start: float = 0.0
    slides: bool = False
    stiffness: float = FREE
    damping: float = 0.0
    effort: float = FREE
    passive_damping: float = 0.0
    friction: float = 0.0
    spring: float = 0.0
    rest: float = 0.0
    gravity: float = 1.0
    shape: Vector3 | None = None
    on: str | None = None

    @property
    def link(self) -> str:
        return f"{self.name} link"

    @property
    def drive(self) -> Joint:
        drive = (self.stiffness, self.damping, self.effort, 0.0, self.start)
        own = (self.passive_damping, self.friction, self.spring, self.rest, self.gravity)
        return Joint(self.name, *drive, *own)


def mechanism(
    name: str,
    *parts: Part,
    base: Pose | None = None,
    friction: float = 1.0,
    closures: tuple[Closure, ...] = (),
    couplings: tuple[Coupling, ...] = (),
    self_collide: bool = False,
    shape: Vector3 | None = None,
) -> Robot:
    """Parts that hang on each other, and the first on the mount, fixed in the world at `base`.

    Args:
        base: of the mount; None: 2 m above the origin.
        friction, closures, couplings, self_collide: see `scene.Robot`.
        shape: edges of a box about the mount's origin that collides [m]; None: nothing does.

    Raises:
        ValueError: a part hangs on one that does not come before it.
    """
    links = [
        f'<link name="{MOUNT}">{_collision(shape)}</link>' if shape else f'<link name="{MOUNT}"/>'
    ]
    joints = []
    places = {MOUNT: MOUNT}
    above = MOUNT
    for part in parts:
        if part.on is not None:
            if part.on not in places:
                raise ValueError(
                    f"part {part.name!r} hangs on {part.on!r}; choose from {', '.join(places)}"
                )
            above = places[part.on]
        x, y, z = part.inertia
        kind, far = ("prismatic", FARTHEST) if part.slides else ("revolute", WIDEST)
        links.append(
            f'<link name="{part.link}"><inertial><origin xyz="{_spaced(part.centre)}"/>'
            f'<mass value="{part.mass!r}"/><inertia ixx="{x!r}" iyy="{y!r}" izz="{z!r}" '
            f'ixy="0" ixz="0" iyz="0"/></inertial>{_collision(part.shape, part.centre)}</link>'
        )
        joints.append(
            f'<joint name="{part.name}" type="{kind}"><parent link="{above}"/>'
            f'<child link="{part.link}"/><origin xyz="{_spaced(part.offset)}"/>'
            f'<axis xyz="{_spaced(part.axis)}"/><limit lower="{-far!r}" upper="{far!r}" '
            f'effort="{part.effort!r}" velocity="1000"/></joint>'
        )
        above = places[part.name] = part.link
    text = f'<robot name="{name}">\n' + "\n".join([*links, *joints]) + "\n</robot>\n"
    return Robot(
        name=name,
        urdf=str(keep(text)),
        packages={},
        srdf="",
        joints=tuple(part.drive for part in parts),
        gripper=Gripper((), 0.0, 0.0, 0.0),
        tool_frame=above,
        base=base or Pose.at(0.0, 0.0, 2.0),
        friction=friction,
        closures=closures,
        couplings=couplings,
        self_collide=self_collide,
    )


def _collision(shape: Vector3 | None, centre: Vector3 = (0.0, 0.0, 0.0)) -> str:
    if shape is None:
        return ""
    return (
        f'<collision><origin xyz="{_spaced(centre)}"/><geometry>'
        f'<box size="{_spaced(shape)}"/></geometry></collision>'
    )


def _spaced(values: Vector3) -> str:
    return " ".join(repr(float(value)) for value in values)
