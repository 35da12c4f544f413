"""A real arm pushed a cube; here its hand moves as the real one did. Where does the cube go?

A repetition is one motion-captured run (Collins, Howard, Leitner, ICRA 2019). The joints follow
the measured way of the hand, by inverse kinematics, so that nothing of the arm's control is in the
score: what is left is contact.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from pytest_simbench.client.world import World
from pytest_simbench.data import pushes
from pytest_simbench.data.measured import DataError, Half
from pytest_simbench.data.pushes import PUSH, ArmRun, ArmRuns
from pytest_simbench.description.robot_files import keep
from pytest_simbench.motion.adapting import bound_joints, lock_joints
from pytest_simbench.motion.kinematics import track
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Box, FloatArray, Gripper, Joint, Pose, Robot, Scene, Trajectory
from pytest_simbench.simulator import DescriptionError
from pytest_simbench.tasks.base import Count, Jitter, Outcome
from pytest_simbench.tasks.measured import MeasuredTask, poses_at

CUBE_SIZE, CUBE_MASS = 0.075, 0.0884
"""[m], [kg] (the source)."""

HEIGHT = 0.055
"""Of the arm's base above the table [m]: measured with all joints at 0."""

JOINTS = tuple(f"m1n6s300_joint_{k}" for k in range(1, 7))
FINGERS = tuple(f"m1n6s300_joint_finger_{k}" for k in range(1, 4))
TOOL = "m1n6s300_link_6"

BEFORE_PUSH = np.radians([0.0, -60.0, 65.0, 90.0, 0.0, 0.0])
"""What the arm was commanded before it pushed [rad]; joints 1, 5 and 6 stay at 0 (the source)."""

HELD = (0, 4, 5)

STIFFNESS, DAMPING, EFFORT, ARMATURE = 20_000.0, 2_000.0, 2_000.0, 0.1
"""Of the drives: so stiff that the hand is where it was; the effort limit is the URDF's."""

MOVED = 0.005
"""A cube that is this far from its start [m] is pushed: five times what the cameras tremble."""

BEFORE, AFTER = 1.0, 3.0
"""What is simulated around that moment [s]: from before the contact until all is at rest."""

SMOOTHED = 21
"""Samples, 0.2 s: over so many the hand's way is smoothed, by parabolas."""

TICK = 0.01
"""Between samples [s]."""

FINGER_ANGLE, FRICTION, MARKER_ASIDE = 0.2, 0.3, 0.009
"""Calibrated, see `ArmPushing`; `benchmarks/README.md` says with which script."""

BLUE = (0.20, 0.35, 0.75, 1.0)

CUBE = "cube"


class Course(NamedTuple):
    """What is simulated: joint path (n, 6) [rad], the cube's start, and its real way (n, 7)."""

    path: FloatArray
    start: Pose
    real: FloatArray


@dataclass(frozen=True)
class MicoTask(MeasuredTask[ArmRun]):
    """A task of the Kinova Mico2 and a cube, against the runs of the real ones.

    What the source does not tell was calibrated on the runs that are not held out: angle of the
    fingers, friction, and where the marker body sits across the hand (docs/reality.md).

    Attributes:
        runs: the real ones.
        half: which of them.
        finger_angle: of the three fingers [rad].
        marker_aside: of the marker body from where it seems to be with all joints at 0, along the
            x axis of link 6, which is across the push [m].
        friction: Coulomb coefficient of table, cube and hand.
    """

    data: ClassVar[str] = pushes.NAME

    runs: ArmRuns
    half: Half = "held_out"
    finger_angle: float = FINGER_ANGLE
    marker_aside: float = MARKER_ASIDE
    friction: float = FRICTION

    def parameters(self) -> dict[str, Any]:
        """And on which runs fingers, friction and marker were found."""
        return {**super().parameters(), "task.calibrated_on": calibrated(self.runs)}

    def with_cube(self, name: str, cube: Pose, start: FloatArray) -> Scene:
        """The scene of that name: the cube at a pose, the arm's joints at `start`, (6,) [rad]."""
        box = Box(CUBE, (CUBE_SIZE,) * 3, cube, CUBE_MASS, self.friction, BLUE)
        robot = replace(self.arm(start), friction=self.friction)
        return Scene(name, (box,), robot, ground_friction=self.friction)

    def arm(self, start: FloatArray) -> Robot:
        """The arm, its joints at `start`, (6,) [rad]."""
        return arm(self.runs.urdf, self.finger_angle, tuple(map(float, start)))


@dataclass(frozen=True)
class ArmPushing(MicoTask):
    """Push a cube with the measured motion of a hand."""

    name: ClassVar[str] = "arm_pushing"

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (
            Metric("displacement", "displacement", unit="m", better=None,
                   doc="of the cube along x, the direction of the push"),
            Metric("displacement_error", "displacement error", unit="m", better="lower", least=0,
                   doc="difference of that to the same real run's"),
            Metric("turn_error", "turn error", unit="deg", better="lower", least=0,
                   doc="difference of the cube's turn about the vertical to the same real run's"),
            Metric("way_error", "way error", unit="m", better="lower", least=0,
                   doc="distance of the cube from the real one's, mean over the time of the run"),
        )  # fmt: skip

    @property
    def chosen(self) -> tuple[ArmRun, ...]:
        """The runs that repetitions go through."""
        return self.runs.of(PUSH, self.half)

    @property
    def references(self) -> Mapping[str, float]:  # type: ignore[override]
        """The real ones' mean."""
        real = [run.displacement for run in self.chosen]
        return {"displacement": float(np.mean(real)), "displacement_error": 0.0,
                "turn_error": 0.0, "way_error": 0.0}  # fmt: skip

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        course = self._course(seed)
        return self.with_cube("arm pushing", course.start, course.path[0])

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        course = self._course(seed)
        with world.stopwatch.measuring("plan"):
            trajectory = self._trajectory(course.path, np.array(world.scene.gravity))
        world.mark("start")
        with world.phase("push"):
            motion = world.follow(trajectory, log_period=TICK)
        world.mark("end")
        states = np.vstack([course.start.as_array(), motion.bodies[:, 0, :7]])
        moved = each_tick(np.append(0.0, motion.time), states)
        metrics, details = compared(moved, course.real)
        off = float(np.abs(motion.joints[-1, 0] - course.path[-1]).max())
        return Outcome(metrics, {"run": self.real(seed).name, **details, "hand_error": off})

    def _course(self, seed: int) -> Course:
        robot = self.arm(np.zeros(6))
        return course(self.real(seed), robot, marker(self.runs, robot), self.marker_aside)

    def _trajectory(self, path: FloatArray, gravity: FloatArray) -> Trajectory:
        velocity = np.gradient(path, TICK, axis=0)
        acceleration = np.gradient(velocity, TICK, axis=0)
        model = RobotModel(self.arm(path[0]))
        effort = model.inverse_dynamics(gravity, path, velocity, acceleration)
        return Trajectory(TICK, path, velocity, effort)


def each_tick(time: FloatArray, states: FloatArray) -> FloatArray:
    """A body's motion from time 0 [s] on, (n,), rows of `Pose.as_array`, (n, 7), at the times of
    the recording: a step may not divide these."""
    at = np.minimum(TICK * np.arange(round(time[-1] / TICK) + 1), time[-1])
    position, turns = poses_at(at, time, states)
    return np.column_stack([position, turns.as_quat(scalar_first=True)])


def compared(moved: FloatArray, real: FloatArray) -> tuple[dict[str, float | None], dict[str, Any]]:
    """Metrics and details of a cube's motion and the real one's, rows of `Pose.as_array`, (n, 7);
    the longer motion is cut."""
    n = min(len(moved), len(real))
    moved, real = moved[:n], real[:n]
    off = np.linalg.norm(moved[:, :2] - real[:, :2], axis=1)
    turns = [_turn(rows) for rows in (moved, real)]
    way = [float(rows[-1, 0] - rows[0, 0]) for rows in (moved, real)]
    return {
        "displacement": way[0],
        "displacement_error": abs(way[0] - way[1]),
        "turn_error": abs(_within(turns[0] - turns[1])),
        "way_error": float(off.mean()),
    }, {
        "real_displacement": way[1],
        "turn": turns[0],
        "real_turn": turns[1],
        "delay": _half_way(moved, way[1]) - _half_way(real, way[1]),
    }


def calibrated(runs: ArmRuns) -> str:
    """The runs on which the committed values were calibrated, by their numbers."""
    numbers = ", ".join(str(run.number) for run in runs.of(PUSH, "chosen_on"))
    return f"{PUSH} {numbers}"


def described(urdf: Path, finger_angle: float) -> str:
    """The arm's description as engines can be given it, with its fingers held at an angle [rad].

    Raises:
        DataError: no URDF.
    """
    try:
        root = ET.parse(urdf).getroot()
        bound_joints(root)
        lock_joints(root, dict.fromkeys(FINGERS, finger_angle))
    except (OSError, ET.ParseError, DescriptionError) as error:
        raise DataError(f"{urdf} is no robot description: {error}") from None
    return ET.tostring(root, encoding="unicode")


@cache
def arm(urdf: Path, finger_angle: float, start: tuple[float, ...]) -> Robot:
    """The Mico2 with held fingers; on what it stands is not seen.

    Raises:
        DataError: no URDF.
    """
    description = keep(described(urdf, finger_angle), {})
    joints = (
        Joint(name, STIFFNESS, DAMPING, EFFORT, ARMATURE, at)
        for name, at in zip(JOINTS, start, strict=True)
    )
    packages = {"kinova_description": str(urdf.parent)}
    hand = Gripper((), 0.0, 0.0, 0.0)
    base = Pose.at(0.0, 0.0, HEIGHT)
    return Robot("mico", str(description), packages, "", tuple(joints), hand, TOOL, base)


@cache
def marker(runs: ArmRuns, robot: Robot) -> Pose:
    """Of the marker body in the frame of link 6: the mean over the runs that are not held out, from
    their beginnings, when all joints were at 0."""
    tool = RobotModel(robot).tool_pose(np.zeros(len(JOINTS))).inverse()
    rows = []
    for run in runs.of(PUSH, "chosen_on"):
        at = (tool * Pose.from_array(np.median(run.hand[:50], axis=0))).as_array()
        rows.append(at * np.array([1, 1, 1, *[math.copysign(1, at[3])] * 4]))
    mean = np.mean(rows, axis=0)
    mean[3:] /= np.linalg.norm(mean[3:])
    return Pose.from_array(mean)


@cache
def course(run: ArmRun, robot: Robot, on_link: Pose, aside: float) -> Course:
    """The part of a run in which the cube is pushed."""
    pushed = _pushed(run)
    rows = slice(pushed - round(BEFORE / TICK), pushed + round(AFTER / TICK))
    hand = savgol_filter(run.hand[rows], SMOOTHED, 2, axis=0)
    hand[:, 3:] /= np.linalg.norm(hand[:, 3:], axis=1, keepdims=True)
    back = (Pose.at(aside, 0.0, 0.0) * on_link).inverse()
    path = track(
        RobotModel(robot), [Pose.from_array(row) * back for row in hand], BEFORE_PUSH, HELD
    )
    real = run.cube[rows]
    first = np.median(real[: round(BEFORE / TICK / 2)], axis=0)
    x, y = map(float, first[:2])
    start = Pose.at(x, y, CUBE_SIZE / 2, yaw=yaw(first))
    return Course(savgol_filter(path, SMOOTHED, 2, axis=0), start, np.vstack([[first], real[1:]]))


def _pushed(run: ArmRun) -> int:
    """The row from which on the cube is not where it was; the cameras lose it for single rows."""
    start = np.median(run.cube[:1000], axis=0)
    away = np.linalg.norm(run.cube[:, :2] - start[:2], axis=1) > MOVED
    return int(np.flatnonzero(~away)[-1]) + 1


def yaw(row: FloatArray) -> float:
    """Turn about the vertical of a row that begins with position and quaternion [rad]."""
    return Pose.from_array(row[:7] / np.array([1, 1, 1, *[np.linalg.norm(row[3:7])] * 4])).yaw


def _turn(rows: FloatArray) -> float:
    """From the first row to the last [deg]."""
    return _within(math.degrees(yaw(rows[-1]) - yaw(rows[0])))


def _within(turn: float) -> float:
    """The same turn [deg] within half a turn."""
    return (turn + 180.0) % 360.0 - 180.0


def _half_way(rows: FloatArray, whole: float) -> float:
    """When the cube is half of that way along x from its start [s]; the end where it never is."""
    gone = rows[:, 0] - rows[0, 0] > whole / 2
    return TICK * float(np.argmax(gone) if gone.any() else len(rows))
