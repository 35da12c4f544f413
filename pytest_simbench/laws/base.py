"""What a law is: a case whose right answer is known in closed form, and how far off an engine may
be.

The tolerance of a law never looks at what an engine does. It is what an integrator of the first
order may do at the step that was used, and the single rule is: *late by one step*. A quantity may
be off by as much as it changes within a step; one that is integrated from a rate, by what the rate
is off, over the time that it is off (Hairer, Norsett, Wanner, Solving Ordinary Differential
Equations I, II.3: the global error of a method of order 1 is the step times what the solution's
second derivative sums up to). An equilibrium is kept exactly by every consistent method; what is
allowed is what gravity moves a body by within one step, g dt^2 (`stillness`). To all of it rounding
is added, as single precision may collect it (`rounding`). How each law applies that stands in its
docstring."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from scipy.integrate import solve_ivp

from pytest_simbench.client.motion import Motion
from pytest_simbench.client.world import World
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.phenomena import PHENOMENON
from pytest_simbench.records.readings import Reading as Reading
from pytest_simbench.records.readings import rounding as rounding
from pytest_simbench.scene import FloatArray, Scene, Trajectory
from pytest_simbench.simulator import Capability
from pytest_simbench.tasks.base import Count, Jitter, Outcome, Task

GRAVITY = 9.80665
"""[m/s^2] (ISO 80000-3)."""

LONG = 1200.0
"""Time-out of a law over a minute or more of simulated time [s]: an engine that takes 1 s for each
takes 4 at a step four times smaller, on a machine that does more than this."""


def stillness(dt: float, scale: float, contacts: int = 1) -> float:
    """By what a body in equilibrium may be off its place [m]: what gravity moves it by in one step,
    for each contact that it rests on, and the rounding of one step. Of more steps it does not add
    up: an equilibrium is restored.

    Args:
        dt: the time step [s].
        scale: of its coordinates [m].
        contacts: that it rests on.
    """
    return contacts * GRAVITY * dt**2 + rounding(scale, 1)


class Law(Task):
    """One law. Subclasses are frozen dataclasses; formula, source and tolerance in the docstring,
    and what is the same of every instance in the head: `class FallSpeed(FreeFall, unit="m/s")`.
    What a head does not say is that of the class above. The law's name is the class's, here
    `fall_speed`, unless the class has a `name`. A class whose name is "" or begins with `_` is no
    law: others share what it has.

    A law draws nothing: seed and jitter do not matter.

    Attributes:
        phenomenon: one of `records.phenomena.PHENOMENA`.
        quantity: what is measured, for instance "height fallen".
        unit: of it.
        needs: what a simulator must be able to do; others are skipped, with the reason.
        seconds: how long it is watched, where it is watched once and for a fixed time [s].
    """

    study_timeout: ClassVar[float] = 300.0
    references: ClassVar[Mapping[str, float]] = {"error": 0.0, "ratio": 0.0}
    draws: ClassVar[bool] = False
    shares_worker: ClassVar[bool] = True

    phenomenon: ClassVar[str]
    quantity: ClassVar[str]
    unit: ClassVar[str]
    needs: ClassVar[tuple[Capability, ...]] = ()
    seconds: float

    known: ClassVar[list[type[Law]]] = []
    """Every law: it registers when it is defined."""

    def __init_subclass__(cls, **head: Any) -> None:
        own = re.sub("(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower()
        for attribute, value in {"name": vars(cls).get("name", own), **head}.items():
            setattr(cls, attribute, value)
        if cls.name and not cls.name.startswith("_"):
            Law.known.append(cls)

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (
            Metric("error", "error", self.unit, "lower", least=0.0, resolution=0.0,
                   doc=f"of the {self.quantity}, from what the law says"),
            Metric("ratio", "error/tolerance", "", "lower", least=0.0,
                   doc="above 1 the error is more than the time step explains"),
        )  # fmt: skip

    @abstractmethod
    def build(self) -> Scene:
        """The scene."""

    def commands(self) -> Trajectory | None:
        """Set points of the drives; None: nothing is told, and `seconds` pass."""
        return None

    def measure(self, world: World) -> Reading:
        """Let time pass in a freshly loaded world, and read. By default it is watched once."""
        rows = self.commands()
        return self.read(watch(world, self.seconds) if rows is None else follow(world, rows))

    def read(self, seen: Watched) -> Reading:
        """Read the motion that was watched, of a law that does not `measure` itself."""
        raise NotImplementedError

    def parameters(self) -> dict[str, Any]:
        """With the phenomenon, so that a repetition that failed says of which one it was."""
        return {**super().parameters(), PHENOMENON: self.phenomenon}

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        return self.build()

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        world.mark("start")
        with world.phase("measure"):
            found = self.measure(world)
        world.mark("end")
        return Outcome({"error": found.error, "ratio": found.ratio}, reading=found)


@dataclass(frozen=True)
class Watched:
    """A motion sampled at every step since the world was loaded.

    Attributes:
        dt: the time step [s].
        t: of each sample [s], from dt on, (n,).
        joints: positions and velocities, (n, 2, n_joints).
        bodies: rows as `World.bodies`, (n, n_free, 13).
        start: the rows before the first step, (n_free, 13).
    """

    dt: float
    t: FloatArray
    joints: FloatArray
    bodies: FloatArray
    start: FloatArray

    @classmethod
    def of(cls, start: FloatArray, motion: Motion) -> Watched:
        """A motion of every step, of one at least, and the bodies' states before it."""
        first = float(motion.time[0])
        dt = float(motion.time[1]) - first if len(motion) > 1 else first
        return cls(dt, motion.time, motion.joints, motion.bodies, start)

    @property
    def steps(self) -> int:
        return len(self.t)

    @property
    def end(self) -> float:
        """The time of the last sample [s]."""
        return float(self.t[-1])

    def reading(self, value: float, exact: float, late: float, scale: float) -> Reading:
        """A reading that may be late by one step.

        Args:
            late: what the value is off for each second that it is late, or its rate.
            scale: of what all steps round.
        """
        allowed = late * self.dt + rounding(scale, self.steps)
        return Reading(float(value), float(exact), float(allowed))

    def at(self, time: float, values: FloatArray) -> Any:
        """One of the columns at a time [s], linear between samples."""
        flat = values.reshape(len(self.t), -1)
        found = np.array([np.interp(time, self.t, column) for column in flat.T])
        return found[0] if values.ndim == 1 else found.reshape(values.shape[1:])

    def crossings(self, values: FloatArray, level: float = 0.0) -> FloatArray:
        """The times at which (n,) values cross a level upwards, linear between samples [s]."""
        below = values - level
        k = np.flatnonzero((below[:-1] < 0) & (below[1:] >= 0))
        share = -below[k] / (below[k + 1] - below[k])
        return np.asarray(self.t[k] + share * (self.t[k + 1] - self.t[k]))


def watch(world: World, duration: float) -> Watched:
    """Let `duration` [s] pass in a world that was just loaded, and see every step of it."""
    return Watched.of(world.bodies.copy(), world.wait(duration, log_period=0.0))


def follow(world: World, rows: Trajectory) -> Watched:
    """The same while the drives follow set points."""
    return Watched.of(world.bodies.copy(), world.follow(rows, log_period=0.0))


def held(position: float, seconds: float, velocity: float = 0.0, effort: float = 0.0) -> Trajectory:
    """One joint told to be at `position` [rad or m] at the end, moving there at `velocity`."""
    ends = np.array([[position - velocity * seconds], [position]])
    return Trajectory(seconds, ends, np.full((2, 1), velocity), np.full((2, 1), effort))


def solved(
    change: Callable[[float, FloatArray], Sequence[float] | FloatArray],
    start: Sequence[float] | FloatArray,
    seconds: float,
    samples: int = 2,
    within: float = 1e-10,
) -> FloatArray:
    """The states from `start` on of what changes at the rate `change(t, state)`, at even times up
    to `seconds`, (samples, n); by DOP853 (Hairer, Norsett, Wanner, II.5) with a relative tolerance.
    """
    times = np.linspace(0.0, seconds, samples)
    found = solve_ivp(
        change, (0.0, seconds), start, "DOP853", times, rtol=within, atol=within / 100
    )
    return np.asarray(found.y.T)


_ANGLE, _SLIDE, _SLIPS = {"friction": 0.6}, {"slope": 0.85, "friction": 0.6}, {"load": 1.25}
_BOUNCE, _FASTER = {"restitution": 0.7, "height": 0.4}, {"speed": 0.8}

OTHER: dict[str, dict[str, Any]] = {
    "free_fall": {"seconds": 0.7}, "fall_speed": {"seconds": 0.7}, "damped_fall": {"damping": 3.0},
    "oblique_gravity": {"gravity": (-2.0, 1.0, -5.0)}, "spin": {"spin": 7.0},
    "projectile": {"velocity": (1.5, 2.0, 3.0)}, "axial_force": {"force": 4.0},
    "landing_time": {"height": 0.4}, "dead_landing": {"height": 0.4}, "dead_collision": _FASTER,
    "collision_momentum": _FASTER, "bounce_height": _BOUNCE, "bounce_ratio": _BOUNCE,
    "elastic_chain": {"speed": 1.5},
    "stick_angle_x": _ANGLE, "stick_angle_y": _ANGLE, "stick_angle_diagonal": _ANGLE,
    "creep": {"friction": 0.6, "share": 0.7, "direction": 0.9}, "carried": {"acceleration": 3.0},
    "slide_x": _SLIDE, "slide_y": _SLIDE, "slide_diagonal": _SLIDE, "slide_straight": _SLIDE,
    "stopping_distance": {"speed": 1.5, "friction": 0.4}, "glide": _FASTER,
    "stopping_distance_oblique": {"speed": 1.5, "direction": 0.9}, "belt": {"acceleration": 7.0},
    "belt_speed": {"speed": 0.6}, "mesh_twin": _FASTER,
    "rolling_sphere": {"slope": 0.25}, "rolling_cylinder": {"slope": 0.25},
    "slip_to_roll": _FASTER, "spin_to_roll": {"spin": 30.0}, "ball_on_belt": {"speed": 0.6},
    "grip_holds": {"load": 0.7}, "grip_slips": _SLIPS, "grip_slips_diagonally": _SLIPS,
    "pendulum_period": {"length": 0.4, "angle": 1.5}, "step_response": {"rate": 8.0},
    "spring_damper": {"start": 0.4}, "effort_limit": {"effort": 1.5}, "tracking": _FASTER,
    "sag": {"stiffness": 60.0}, "feed_forward": {"stiffness": 60.0},
    "wedging": {"friction": 0.4}, "jamming": {"depth": 0.08},
}  # fmt: skip
"""Other parameters by law, none where it stays as it is: who chooses settings on laws judges them
on the same laws at others."""


def held_out(law: Law) -> Law | None:
    """The law at its other parameters; None where none are declared."""
    values = OTHER.get(law.name)
    return replace(law, **values) if values else None  # type: ignore[type-var]
