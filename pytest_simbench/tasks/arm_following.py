"""A real arm followed its commands; here a simulated one does. How far apart are their hands?

A repetition is one motion-captured run (Collins, Howard, Leitner, ICRA 2019), of free motion or
with a push at its end. The commands are the source's: targets of joints, and a law that makes
velocities of them. The source compares seven simulators in this way, with its own settings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import ClassVar

import numpy as np
from scipy.signal import medfilt

from pytest_simbench.client.world import World
from pytest_simbench.data.pushes import COMMANDS, FREE, PUSH, ArmRun, Command
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import FloatArray, Pose, Robot, Scene, Trajectory
from pytest_simbench.tasks.arm_pushing import CUBE, CUBE_SIZE, JOINTS, MicoTask, marker, yaw
from pytest_simbench.tasks.base import Count, Jitter, Outcome

CONTROL_PERIOD, GAIN, FASTEST = 0.05, 10.0, math.radians(30.0)
"""Of the source's control law: each period [s] a joint's velocity becomes the gain [1/s] times what
is missing, at most the fastest [rad/s] (`Software/PID.py` and the simulators' scripts there)."""

TICK = 0.01
"""Between rows of the trajectory [s]."""

COMPARED = 0.05
"""Between samples that are compared [s], as dense as the source's simulations."""

AWAY, QUIET, FILTERED = 0.02, 60, 15
"""A hand this far [m] from where it was in the first samples (0.6 s, all at rest) has started; the
median of so many samples hides those that the cameras lose."""

AT_REST = 0.5
"""Before the end of a run [s]: then all is at rest."""

REACHED: Mapping[str, tuple[Command, ...]] = {
    FREE: (
        Command(0.0, (-0.7, 1.5, 1.2, 0.4, 0.0, 0.0)),
        Command(0.0, (-0.8, -100.6, 0.5, -0.3, 0.0, 0.0)),
    ),
    PUSH: (
        Command(0.0, (0.0, 1.5, 1.1, 0.0, 0.0, 0.0)),
        Command(0.0, (0.1, 28.1, 120.9, 90.8, 0.0, 0.0)),
        Command(7.9, (-0.8, -62.9, 73.3, 90.3, 0.0, 0.0)),
        Command(13.9, (-0.6, -70.2, 26.8, 90.3, 0.0, 0.0)),
    ),
}
"""What `tests/tasks/reached.py` finds on the runs that are not held out: when the arm's
motions began after the first one [s], and the angles that the joints had at rest [degrees]. The
first row is where the arm stood before. Joints 5 and 6 were not commanded."""


@dataclass(frozen=True)
class ArmFollowing(MicoTask):
    """Give the simulated arm the commands of the real one.

    The control law runs on its own reference, as if the drives followed it: the joints are sent
    where the integral of the commanded velocities is. Nothing else is known of the arm: no effort
    is fed forward. At `most` so many of the runs are followed; None: all.
    """

    name: ClassVar[str] = "arm_following"
    smallest: ClassVar[int | None] = 2  # one of free motion and one with a push
    references: ClassVar[Mapping[str, float]] = {"hand_error": 0.0, "rest_error": 0.0}
    commands: ClassVar[Mapping[str, tuple[Command, ...]]] = COMMANDS
    initial: ClassVar[Mapping[str, tuple[float, ...]]] = dict.fromkeys(COMMANDS, (0.0,) * 6)
    """Joints before the first command, by experiment [degrees]."""

    most: int | None = None

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (
            Metric("hand_error", "hand error", unit="m", better="lower", least=0,
                   doc="distance of the hand from the real one's, mean over the time from the "
                       "first command to the end of the recording"),
            Metric("rest_error", "hand error at rest", unit="m", better="lower", least=0,
                   doc=f"the same, over the last {AT_REST:g} s"),
        )  # fmt: skip

    @property
    def chosen(self) -> tuple[ArmRun, ...]:
        """The runs that repetitions go through: free motion and pushes take turns."""
        both = (self.runs.of(experiment, self.half) for experiment in (FREE, PUSH))
        return tuple(run for pair in zip(*both, strict=False) for run in pair)[: self.most]

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        run = self.real(seed)
        at = np.median(run.cube[:QUIET], axis=0)
        lying = Pose.at(float(at[0]), float(at[1]), CUBE_SIZE / 2, yaw=yaw(at))
        start = np.radians(self.initial[run.experiment])
        return self.with_cube("arm following", lying, start)

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        run = self.real(seed)
        time, real = self.seen(run)
        with world.stopwatch.measuring("plan"):
            trajectory = self.trajectory(run.experiment, float(time[-1]))
        lay = world.pose(CUBE).position
        world.mark("start")
        with world.phase("follow"):
            motion = world.follow(trajectory, log_period=TICK)
        world.mark("end")
        joints = motion.joints[:, 0]
        model = RobotModel(self.arm(trajectory.position[0]))
        at = np.stack([np.interp(time, motion.time, column) for column in joints.T], axis=1)
        off = np.linalg.norm(hands(model, at) - real, axis=1)
        behind = joints[-1] - trajectory.position[-1]
        return Outcome(
            {
                "hand_error": float(off.mean()),
                "rest_error": float(off[time > time[-1] - AT_REST].mean()),
            },
            {
                "run": run.name,
                "joint_error": float(np.abs(behind).max()),
                "displacement": world.pose(CUBE).position[0] - lay[0],
                "real_displacement": run.displacement,
            },
        )

    def trajectory(self, experiment: str, duration: float) -> Trajectory:
        """What the drives are given, for so long [s]."""
        steps = math.ceil(duration / CONTROL_PERIOD) + 1
        coarse = reference(self.initial[experiment], self.commands[experiment], steps)
        time = np.arange(0.0, duration + TICK / 2, TICK)
        knots = CONTROL_PERIOD * np.arange(steps + 1)
        path = np.stack([np.interp(time, knots, column) for column in coarse.T], axis=1)
        velocity = np.gradient(path, TICK, axis=0)
        return Trajectory(TICK, path, velocity, np.zeros_like(path))

    def seen(self, run: ArmRun) -> tuple[FloatArray, FloatArray]:
        """Times since the first command [s], (n,), and where the real hand, the origin of link 6,
        was, (n, 3) [m]."""
        model_arm = self.arm(np.zeros(len(JOINTS)))
        back = (Pose.at(self.marker_aside, 0.0, 0.0) * marker(self.runs, model_arm)).inverse()
        since = run.time - run.time[0] - started(run, model_arm)
        rows = np.flatnonzero(since >= 0)[:: round(COMPARED / TICK)]
        real = [(Pose.from_array(run.hand[row]) * back).position for row in rows]
        return since[rows], np.array(real)


@dataclass(frozen=True)
class CorrectedArmFollowing(ArmFollowing):
    """The same with what the real arm made of the commands: its joints stop up to 8 degrees off.

    When it moved and where its joints stopped was calibrated on the runs that are not held out
    (`REACHED`). What is left is how alike the runs are, and what happens between the stops.
    """

    name: ClassVar[str] = "arm_following_corrected"
    commands: ClassVar[Mapping[str, tuple[Command, ...]]] = {
        experiment: rows[1:] for experiment, rows in REACHED.items()
    }
    initial: ClassVar[Mapping[str, tuple[float, ...]]] = {
        experiment: rows[0].angles for experiment, rows in REACHED.items()
    }


def reference(start: Sequence[float], commands: Sequence[Command], steps: int) -> FloatArray:
    """Where the control law sends the joints at each control period, (steps + 1, n_joints) [rad].

    Args:
        start: joints before [degrees].
        commands: in the order of their times.
        steps: control periods.
    """
    joints = np.radians(start)
    path = [joints]
    for step in range(steps):
        given = [c for c in commands if c.time <= step * CONTROL_PERIOD + 1e-9]
        target = np.radians(given[-1].angles) if given else joints
        velocity = np.clip(GAIN * (target - joints), -FASTEST, FASTEST)
        joints = joints + CONTROL_PERIOD * velocity
        path.append(joints)
    return np.array(path)


def hands(model: RobotModel, joints: FloatArray) -> FloatArray:
    """Where link 6 is, (n, 3) [m], for joints (n, 6) [rad]."""
    return np.array([model.tool_pose(row).position for row in joints])


@cache
def started(run: ArmRun, robot: Robot) -> float:
    """When the first command came, after the recording's start [s]."""
    return began(run, RobotModel(robot), (0.0,) * len(JOINTS), COMMANDS[run.experiment][0], 0.6)


def began(
    run: ArmRun, model: RobotModel, before: Sequence[float], command: Command, quiet: float
) -> float:
    """When a command came, after the recording's start [s]: so long before the hand is 20 mm away
    from where it rested as the command needs for that.

    Args:
        run: a real one.
        model: of the arm.
        before: joints before the command [degrees].
        command: its target; the time in it does not matter.
        quiet: until when the hand surely rested, and for 0.6 s before [s].
    """
    seen = np.stack([medfilt(column, FILTERED) for column in run.hand[:, :3].T], axis=1)
    row = round(quiet / TICK)
    away = np.linalg.norm(seen - np.median(seen[row - QUIET : row], axis=0), axis=1)
    left = row + int(np.argmax(away[row:] > AWAY))
    commanded = hands(model, reference(before, (replace(command, time=0.0),), QUIET))
    gone = np.linalg.norm(commanded - commanded[0], axis=1)
    first = int(np.argmax(gone > AWAY))
    needed = CONTROL_PERIOD * float(np.interp(AWAY, gone[: first + 1], np.arange(first + 1)))
    return float(run.time[left] - run.time[0]) - needed
