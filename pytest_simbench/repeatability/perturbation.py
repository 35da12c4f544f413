"""Small changes of a scene or its controller, with units, and Hypothesis strategies for them.

A perturbation is a whole number of small steps of one quantity, so that Hypothesis shrinks it to
the smallest that still does what it did, in units a reader knows: 7 steps of 0.1 mm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from pytest_simbench.scene import Pose, Scene, SceneError
from pytest_simbench.scene.checks import check_count

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy


@dataclass(frozen=True)
class Quantity:
    """Something that can be perturbed.

    Attributes:
        of: whether each cube has its own, or the scene or the robot has one.
        step: the smallest change considered, in SI units (or a share of the value).
        bound: the largest change by default, in the same.
        shown: factor from there to `unit`.
        unit: in which it is told.
        phrase: how it is told, after the number.
    """

    name: str
    of: Literal["cube", "scene", "robot"]
    step: float
    bound: float
    shown: float
    unit: str
    phrase: str
    signed: bool = True


QUANTITIES: Mapping[str, Quantity] = {
    quantity.name: quantity
    for quantity in (
        Quantity("x", "cube", 1e-4, 1e-3, 1e3, "mm", "in x of"),
        Quantity("y", "cube", 1e-4, 1e-3, 1e3, "mm", "in y of"),
        Quantity("yaw", "cube", math.radians(0.1), math.radians(1.0), math.degrees(1.0), "deg",
                 "of yaw of"),
        Quantity("mass", "cube", 0.01, 0.1, 100.0, "%", "in the mass of"),
        Quantity("friction", "scene", 0.01, 0.2, 100.0, "%", "in the friction of all surfaces"),
        Quantity("squeeze", "robot", 0.01, 0.2, 100.0, "%", "in the gripper's squeeze"),
        Quantity("delay", "robot", 1e-3, 0.02, 1e3, "ms", "of controller delay", signed=False),
    )
}  # fmt: skip
"""What can be perturbed, the simplest to understand first: shrinking prefers it.

Friction is that of every surface at once, since engines combine two different ones by different
rules. Squeeze is the effort limit of the fingers. Delay is explained at `client.tape.Latency`."""


@dataclass(frozen=True)
class Perturbation:
    """One quantity, changed by a whole number of its steps.

    Attributes:
        steps: how many, with sign.
        body: the cube's name, "" for what cubes do not have.
    """

    quantity: str
    steps: int
    body: str = ""

    @property
    def amount(self) -> float:
        """In SI units, or as a share of the value."""
        return self.steps * QUANTITIES[self.quantity].step

    def __str__(self) -> str:
        """In words: "0.7 mm in x of cube_12"."""
        phrase = QUANTITIES[self.quantity].phrase
        number = self.size(self.quantity, self.amount)
        return " ".join(part for part in (number, phrase, self.body) if part)

    @staticmethod
    def size(quantity: str, amount: float) -> str:
        """An amount [SI units or share] as it is told: "0.7 mm"."""
        return f"{amount * QUANTITIES[quantity].shown:.4g} {QUANTITIES[quantity].unit}"

    def applied(self, scene: Scene) -> Scene:
        """The scene with this change (a delay changes no scene).

        Raises:
            SceneError: a cube would be inside another body.
        """
        factor = 1 + self.amount
        if self.quantity == "delay":
            return scene
        if self.quantity == "friction":
            return scene.with_frictions(lambda mu: mu * factor)
        if self.quantity == "squeeze":
            squeeze = factor * scene.arm.gripper.squeeze
            return replace(scene, robot=scene.arm.squeezing(squeeze))
        body = scene.body(self.body)
        if self.quantity == "mass":
            return scene.with_body(body.changed(mass=body.mass * factor))
        if self.quantity == "yaw":
            turned = Pose.at(0, 0, 0, yaw=self.amount) * Pose(quaternion=body.pose.quaternion)
            return scene.with_pose(self.body, Pose(body.pose.position, turned.quaternion))
        return scene.with_pose(self.body, body.pose.translated(**{self.quantity: self.amount}))


def perturbed(scene: Scene, perturbations: Sequence[Perturbation]) -> Scene:
    """The scene with all of them.

    Raises:
        SceneError: a cube would be inside another body.
    """
    for perturbation in perturbations:
        scene = perturbation.applied(scene)
    return scene


def controller_delay(perturbations: Sequence[Perturbation]) -> float:
    """The controller's delay among them [s]."""
    return sum(p.amount for p in perturbations if p.quantity == "delay")


def described(perturbations: Sequence[Perturbation]) -> str:
    """All of them in words."""
    return " and ".join(map(str, perturbations)) or "nothing"


def perturbations(
    scene: Scene,
    bounds: Mapping[str, float] | None = None,
    *,
    at_most: int = 1,
) -> SearchStrategy[tuple[Perturbation, ...]]:
    """Strategy for one to `at_most` perturbations of a scene.

    Shrinks towards fewer of them, quantities that come first, cubes that come first, and smaller
    amounts.

    Args:
        scene: to be perturbed; what does not fit into it is left out.
        bounds: largest change by quantity, in SI units or as a share; default: every quantity
            that the scene has, within the bounds of `QUANTITIES`.
        at_most: how many at once, each of another quantity or cube.

    Raises:
        ValueError: an unknown quantity, a bound below its step, none of them in the scene, or 0.
    """
    from hypothesis import strategies as st

    check_count(at_most, "the number of perturbations at once")
    limits = {q.name: q.bound for q in QUANTITIES.values()} if bounds is None else bounds
    for name in (name for name in limits if name not in QUANTITIES):
        raise ValueError(f"no quantity is named {name!r}; choose from {', '.join(QUANTITIES)}")
    there = {"cube": bool(scene.free_bodies), "scene": True, "robot": scene.robot is not None}
    choices = []
    for quantity in (q for q in QUANTITIES.values() if q.name in limits):
        bound = limits[quantity.name]
        if not bound >= quantity.step:
            raise ValueError(
                f"the bound of {quantity.name}, {bound:g}, is below its smallest step, "
                f"{quantity.step:g}"
            )
        if there[quantity.of]:
            choices.append(_of_quantity(scene, quantity, bound))
        elif bounds is not None:
            raise ValueError(f"scene {scene.name!r} has no {quantity.of} to perturb")
    if not choices:
        raise ValueError(f"scene {scene.name!r} has nothing that could be perturbed")
    lists = st.lists(
        st.one_of(choices), min_size=1, max_size=at_most, unique_by=lambda p: (p.quantity, p.body)
    )
    return lists.map(tuple).filter(lambda found: fits(scene, found))


def _of_quantity(scene: Scene, quantity: Quantity, bound: float) -> SearchStrategy[Perturbation]:
    from hypothesis import strategies as st

    most = int(bound / quantity.step + 1e-9)
    least = -most if quantity.signed else 1
    steps = st.integers(least, most).filter(bool)
    names = [body.name for body in scene.free_bodies] if quantity.of == "cube" else [""]
    return st.builds(Perturbation, st.just(quantity.name), steps, st.sampled_from(names))


def fits(scene: Scene, perturbations: Sequence[Perturbation]) -> bool:
    """Whether the perturbed scene can exist."""
    try:
        perturbed(scene, perturbations)
    except SceneError:
        return False
    return True
