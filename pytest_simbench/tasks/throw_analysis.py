"""What became of a thrown cube: when it left the hand, how, and where it was going.

How the hand let it go is told apart from how it flew. The landing is computed from the state at
the release, so a late release shows; what the simulated flight adds to that is the integrator's
part. (One that falls too fast, as semi-implicit Euler does by g dt per second, lands short, and
so hid a release that was late.)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.client.world import Motion
from pytest_simbench.robot.model import RobotModel
from pytest_simbench.robot.strain import strain
from pytest_simbench.robot.throw import Throw, landing_x
from pytest_simbench.scene import Body, FloatArray

BoolArray = NDArray[np.bool_]

FREE_FALL_TOLERANCE = 2.0
"""A released cube whose acceleration is within this of gravity flies freely [m/s^2]; engines' air
damping makes 0.1 m/s^2. The swing itself accelerates the hand by chance almost as gravity
does, so this alone does not tell a held cube from a flying one."""

OUT_OF_HAND = 0.06
"""Farther than this from the tool centre point, a cube of the study's size is certainly not held
[m]. It and `UNCLENCHED` go with the scene's scale."""

UNCLENCHED = 0.0005
"""The fingers do not press any more when all have opened by this [m]."""


@dataclass(frozen=True)
class Flight:
    """The free flight of the cube, cut out of a motion's samples.

    Attributes:
        first: index of the first sample in free flight: the release.
        last: index of the last one: before the first contact.
    """

    first: int
    last: int


def unclenched(fingers: FloatArray, least: float = UNCLENCHED) -> BoolArray:
    """At which samples the fingers do not press any more, (n,).

    Args:
        fingers: positions of the finger joints [m], (n, n_fingers); in the first sample
            they hold the cube.
        least: by which they have opened then [m].
    """
    return np.asarray((fingers - fingers[0] > least).all(axis=1))


def free_flight(
    time: FloatArray,
    velocity: FloatArray,
    gone: BoolArray,
    gravity: FloatArray,
) -> Flight | None:
    """The cube's first free flight after the hand let it go or lost it, or None.

    Args:
        time: of each sample [s], (n,), evenly spaced.
        velocity: of the cube [m/s], (n, 3).
        gone: whether it is out of the hand, (n,).
        gravity: [m/s^2], (3,).
    """
    if len(time) < 3:
        return None
    acceleration = np.diff(velocity, axis=0) / np.diff(time)[:, None]
    flying = np.linalg.norm(acceleration - gravity, axis=1) < FREE_FALL_TOLERANCE
    starts = np.flatnonzero(flying & gone[:-1])
    if not len(starts):
        return None
    first = last = int(starts[0])
    while last + 1 < len(flying) and flying[last + 1]:
        last += 1
    # flying[k] speaks of the time from sample k to k + 1
    return Flight(first, last + 1)


class Thrown:
    """A throw as it was executed, held against a perfect follower's.

    Args:
        model: of the robot.
        motion: samples of the swing and after it, at every step.
        cube: which of the bodies is thrown,
        held: and what it is.
        started: simulated time at which the swing began [s].
        perfect: swing and release of a perfect follower.
        gravity: [m/s^2], (3,).
        scale: of the scene over the study's.

    Attributes:
        motion: the same.
        free: index of the first sample at which the thrown cube was out of the hand; len(motion) if
            it was never thrown.
        lost: a sentence when it left the hand before its release, else None.
        flight: its first free flight, or None.
        strain: how hard the throw was on the arm.
    """

    def __init__(
        self,
        model: RobotModel,
        motion: Motion,
        cube: int,
        held: Body,
        started: float,
        perfect: Throw,
        gravity: FloatArray,
        scale: float = 1.0,
    ) -> None:
        self.motion = motion
        self._perfect, self._gravity = perfect, gravity
        self._time = motion.time - started
        states = motion.bodies[:, cube]
        self._position, self._velocity = states[:, :3], states[:, 7:10]
        joints = motion.joints[:, 0]
        tool = np.array([model.tool_pose(row).position for row in joints])
        apart = np.linalg.norm(self._position - tool, axis=1) > OUT_OF_HAND * scale
        fingers = joints[:, model.robot.finger_indices] * model.finger_lever
        gone = apart | unclenched(fingers, UNCLENCHED * scale)
        early = apart & (self._time < perfect.time)
        self.lost: str | None = None
        self.free = int(np.argmax(gone)) if gone.any() else len(motion)
        self.flight: Flight | None = None
        self.strain = strain(model, gravity, motion.time, motion.joints, held, self.free)
        if apart[0]:
            self.lost, self.free = "was not in the hand when the swing began", len(motion)
            return
        if early.any():
            self.lost = f"left the hand {self._time[np.argmax(early)]:.3f} s into the throw"
        self.flight = free_flight(self._time, self._velocity, gone, gravity)

    def metrics(self) -> dict[str, float | None]:
        """How the cube left the hand, where that sent it, and what the flight made of it."""
        found: dict[str, float | None] = {"lost_in_transit": float(self.lost is not None)}
        if self.strain is not None:
            found["limits"] = 100.0 * self.strain.largest
        if self.flight is None:
            return found
        first, last, perfect = self.flight.first, self.flight.last, self._perfect
        position, velocity = self._position[first], self._velocity[first]
        landing = self._landing(position, velocity)
        flown = self._landing(self._position[last], self._velocity[last])
        return found | {
            "landing_x": landing,
            "landing_error": _apart(landing, perfect.landing(self._gravity)),
            "flight_error": _apart(flown, landing),
            "release_speed": float(np.linalg.norm(velocity)),
            "release_velocity_error": float(np.linalg.norm(velocity - perfect.velocity)),
            "release_position_error": float(np.linalg.norm(position - perfect.position)),
            "release_time_error": float(self._time[first] - perfect.time),
        }

    def details(self) -> dict[str, Any]:
        """What explains them."""
        perfect = self._perfect
        found: dict[str, Any] = {}
        if self.lost is not None:
            found["lost"] = self.lost
        elif self.free == len(self.motion):
            found["kept"] = "the cube never left the hand"
        if self.strain is not None:
            found["limits"] = self.strain.to_wire()
        if self.flight is not None:
            first, last = self.flight.first, self.flight.last
            found["release"] = {
                "time": float(self._time[first]),
                "position": self._position[first],
                "velocity": self._velocity[first],
                "reference_time": perfect.time,
                "reference_position": perfect.position,
                "reference_velocity": perfect.velocity,
                "reference_landing_x": perfect.landing(self._gravity),
            }
            found["flight_landing_x"] = self._landing(self._position[last], self._velocity[last])
        return found

    def _landing(self, position: FloatArray, velocity: FloatArray) -> float | None:
        """Where a cube of that state lands, in x [m]."""
        return landing_x(position, velocity, self._gravity, self._perfect.landing_height)


def _apart(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else abs(a - b)
