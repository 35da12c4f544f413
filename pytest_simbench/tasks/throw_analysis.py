"""What became of a thrown cube: when it left the hand, how, and where it was going.

How the hand let it go is told apart from how it flew. The landing is computed from the state at
the release, so a late release shows; what the simulated flight adds to that is the integrator's
part. (One that falls too fast, as semi-implicit Euler does by g dt per second, lands short, and
so hid a release that was late.)
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray

from pytest_simbench.client.motion import Motion
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.strain import strain
from pytest_simbench.motion.throw import Throw, landing_x
from pytest_simbench.scene import FloatArray, Pose, Scene
from pytest_simbench.scene.overlap import rotations
from pytest_simbench.tasks.base import CUBE_SIZE

BoolArray = NDArray[np.bool_]

WINDOW = 0.05
"""Motion is judged over this time, and causes are sought within it [s]."""

MOTION = 0.002
"""A body moves when its centre has gone farther than this within `WINDOW` [m]: faster than
40 mm/s. Creep is slower; a cube knocked over is not. For cubes of the study's size; it and `TOUCH`
go with the edge."""

TOUCH = 0.005
"""Bodies nearer than this touch [m]; what they move between two samples is added."""

CALM = 0.5
"""The throw's motion is over when nothing has moved for this long [s]."""


@dataclass(frozen=True)
class Impact:
    """What a throw did to the cubes.

    Attributes:
        caused: indices of the cubes whose first motion the throw caused, in the order of motion.
        rest: index of the sample at which the motion that the throw caused was over.
    """

    caused: tuple[int, ...]
    rest: int


def impact(
    time: FloatArray, thrown: FloatArray, cubes: FloatArray, edge: float, free: int
) -> Impact:
    """Follow the chain of contacts from a thrown cube: which cubes it moved.

    A cube is moved by the throw when its first motion began while the flying cube touched it, or
    while a cube touched it that the throw had moved before; and when that motion carried it away. A
    pyramid that falls by itself, creeps, or is knocked by the arm is moved otherwise.

    Args:
        time: of each sample [s], (n,).
        thrown: poses of the thrown cube, (n, 7): position [m], quaternion w, x, y, z.
        cubes: poses of the others, (n, m, 7).
        edge: of every cube [m].
        free: index of the first sample at which the thrown cube was out of the hand.
    """
    chain = _Chain(time, np.concatenate([thrown[:, None], cubes], axis=1), edge)
    moving = chain.moving
    onsets = {
        i: int(np.argmax(moving[:, i + 1])) for i in range(cubes.shape[1]) if moving[:, i + 1].any()
    }
    caused: list[int] = []
    waiting = sorted(onsets, key=lambda i: onsets[i])
    while True:
        for i in waiting:
            k = onsets[i]
            flown = moving[k, 0] and chain.touched(i + 1, 0, k, since=free)
            if flown or any(onsets[j] <= k and chain.touched(i + 1, j + 1, k) for j in caused):
                caused.append(i)
                waiting.remove(i)
                break
        else:
            break
    began = min((onsets[i] for i in caused), default=len(time) - 1)
    return Impact(tuple(caused), chain.calm_after(began))


def may_touch(poses: FloatArray, cube: int, edge: float) -> BoolArray:
    """At which samples one of the cubes may touch another one or the ground before the next, (n,);
    poses are of all cubes, (n, m, 7), and each has the same edge [m]."""
    touch, centres, strides = TOUCH * edge / CUBE_SIZE, poses[:, :, :3], _strides(poses)
    between = np.linalg.norm(centres - centres[:, [cube]], axis=2) - np.sqrt(3) * edge
    reach = edge / 2 * np.abs(rotations(poses[:, cube, 3:7])[:, 2]).sum(axis=1)
    found = centres[:, cube, 2] - reach <= touch + strides[:, cube]
    for row, other in np.argwhere(between <= touch + strides + strides[:, [cube]]):
        if other != cube and not found[row]:
            apart = _distance(edge, poses[row, cube], poses[row, other])
            found[row] = apart <= touch + strides[row, cube] + strides[row, other]
    return np.asarray(found)


def _strides(poses: FloatArray) -> FloatArray:
    """How far each cube moved since the sample before [m], (n, m)."""
    centres = poses[:, :, :3]
    return np.asarray(np.linalg.norm(np.diff(centres, axis=0, prepend=centres[:1]), axis=2))


class _Chain:
    """Motion and contact of the bodies of a log, body 0 the thrown cube."""

    def __init__(self, time: FloatArray, poses: FloatArray, edge: float) -> None:
        self.time, self.poses, self.edge = time, poses, edge
        self.earlier = np.maximum(np.searchsorted(time, time - WINDOW, side="right") - 1, 0)
        centres = poses[:, :, :3]
        self._scale = edge / CUBE_SIZE
        moved = np.linalg.norm(centres - centres[self.earlier], axis=2)
        self.moving = moved > MOTION * self._scale
        self.strides = _strides(poses)

    def touched(self, a: int, b: int, k: int, since: int = 0) -> bool:
        """Whether two bodies touched within `WINDOW` before sample k."""
        rows = np.arange(max(int(self.earlier[k]), since), k + 1)
        reach = TOUCH * self._scale + self.strides[rows, a] + self.strides[rows, b]
        first, second = self.poses[rows, a], self.poses[rows, b]
        apart = np.linalg.norm(first[:, :3] - second[:, :3], axis=1) - np.sqrt(3) * self.edge
        return any(
            _distance(self.edge, first[i], second[i]) <= reach[i]
            for i in np.flatnonzero(apart <= reach)
        )

    def calm_after(self, began: int) -> int:
        """The first sample after `began` that ends `CALM` without motion, or the last."""
        still_since = self.time[began]
        for k in range(began, len(self.time)):
            if self.moving[k].any():
                still_since = self.time[k]
            elif self.time[k] - still_since >= CALM:
                return k
        return len(self.time) - 1


def _distance(edge: float, a: FloatArray, b: FloatArray) -> float:
    """Between the surfaces of two cubes at poses, (7,) each [m], negative where they overlap."""
    box, result = coal.Box(edge, edge, edge), coal.DistanceResult()
    coal.distance(box, _placed(a), box, _placed(b), coal.DistanceRequest(), result)
    return float(result.min_distance)


def _placed(row: FloatArray) -> coal.Transform3s:
    pose = Pose.from_array(row)
    return coal.Transform3s(pose.rotation(), np.array(pose.position))


FREE_FALL_TOLERANCE = 2.0
"""A released cube whose acceleration is within this of gravity flies freely [m/s^2]; engines' air
damping makes 0.1 m/s^2. It tells to the step when the hand or a body touches the cube. It never
says that a flight is over: a flight whose acceleration is wrong would look short, and right."""

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
        clear: index of the sample from which the hand touches it no more.
        last: index of the last one: before the first contact.
    """

    first: int
    clear: int
    last: int


def unclenched(fingers: FloatArray, least: float = UNCLENCHED) -> BoolArray:
    """At which samples the fingers do not press any more, (n,): all have opened by `least` [m].
    Positions are (n, n_fingers) [m]; in the first sample the fingers hold the cube."""
    return np.asarray((fingers - fingers[0] > least).all(axis=1))


def free_flight(
    time: FloatArray,
    velocity: FloatArray,
    gone: BoolArray,
    apart: BoolArray,
    near: BoolArray,
    gravity: FloatArray,
) -> Flight | None:
    """The cube's first free flight after the hand let it go or lost it, or None.

    It begins when the acceleration is gravity's, or, where it never is, when the cube is far from
    the hand. It ends where something is near enough to touch, whatever the acceleration was.

    Args:
        time: of each sample [s], (n,), evenly spaced.
        velocity: of the cube [m/s], (n, 3).
        gone: whether it is out of the hand, (n,).
        apart: whether it is so far from the hand that nothing of that touches it, (n,).
        near: whether it may touch a body or the ground before the next sample, (n,).
        gravity: [m/s^2], (3,).
    """
    if len(time) < 3:
        return None
    acceleration = np.diff(velocity, axis=0) / np.diff(time)[:, None]
    # flying[k] speaks of the time from sample k to k + 1
    flying = np.linalg.norm(acceleration - gravity, axis=1) < FREE_FALL_TOLERANCE
    first, away = _first(flying & gone[:-1], 0), _first(apart, 0)
    if away < _first(near, away) < first or first == len(flying):
        first = away
    if first >= len(flying):
        return None
    away, last = max(first, _first(apart, first)), _first(near[:-1], first)
    pushed = np.flatnonzero(~flying[first:away])
    clear = min(first + int(pushed[-1]) + 1, last) if len(pushed) else first
    while last < len(flying) and flying[last]:
        last += 1
    return Flight(first, clear, last)


def _first(holds: BoolArray, since: int) -> int:
    """The first index from `since` on at which it holds, or the length."""
    found = np.flatnonzero(holds[since:])
    return since + int(found[0]) if len(found) else len(holds)


class Thrown:
    """A throw as it was executed, held against a perfect follower's.

    Args:
        model: of the robot.
        motion: samples of the swing and after it, at every step.
        scene: with cubes alone.
        cube: name of the one that is thrown.
        started: simulated time at which the swing began [s].
        perfect: swing and release of a perfect follower.
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
        scene: Scene,
        cube: str,
        started: float,
        perfect: Throw,
        scale: float = 1.0,
    ) -> None:
        self.motion = motion
        self._perfect, self._gravity = perfect, np.asarray(scene.gravity)
        self._time = motion.time - started
        held = scene.body(cube)
        number = scene.free_bodies.index(held)
        states = motion.bodies[:, number]
        self._position, self._velocity = states[:, :3], states[:, 7:10]
        joints = motion.joints[:, 0]
        tool = np.array([model.tool_transform(row).translation for row in joints])
        apart = np.linalg.norm(self._position - tool, axis=1) > OUT_OF_HAND * scale
        fingers = joints[:, model.robot.finger_indices] * model.finger_lever
        gone = apart | unclenched(fingers, UNCLENCHED * scale)
        early = apart & (self._time < perfect.time)
        self.lost: str | None = None
        self.free = int(np.argmax(gone)) if gone.any() else len(motion)
        self.flight: Flight | None = None
        self.strain = strain(model, self._gravity, motion.time, motion.joints, held, self.free)
        if apart[0]:
            self.lost, self.free = "was not in the hand when the swing began", len(motion)
            return
        if early.any():
            self.lost = f"left the hand {self._time[np.argmax(early)]:.3f} s into the throw"
        near = may_touch(motion.bodies[:, :, :7], number, held.extents[0])
        self.flight = free_flight(self._time, self._velocity, gone, apart, near, self._gravity)

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
        clear = self.flight.clear
        begun, flown = (self._landing(self._position[k], self._velocity[k]) for k in (clear, last))
        return found | {
            "landing_x": landing,
            "landing_error": _apart(landing, perfect.landing(self._gravity)),
            "flight_error": _apart(flown, begun),
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
            found["limits"] = asdict(self.strain)
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
