"""What the real arm made of its commands, found in the runs that are not held out.

When its motions began, and which joint angles put the marker body where the cameras see it at rest.
`tasks.arm_following.REACHED` has the means over the runs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from pytest_simbench.data.pushes import COMMANDS, ArmRun, ArmRuns
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.tasks import ArmFollowing
from pytest_simbench.tasks.arm_following import TICK, began, started
from pytest_simbench.tasks.arm_pushing import JOINTS, arm, marker

MILLIMETRE, DEGREE, PRIOR = 1000.0, float(np.degrees(1.0)), float(np.degrees(1.0)) / 3
"""Weights at rest: 1 mm and 1 degree of the marker body count as 3 degrees off a command."""

EARLY = 0.4
"""So long before a command is due the arm surely rests [s]: the later ones come 0.15 s early."""

COMMANDED = [0, 1, 2, 3]
"""Joints that are fitted at rest; what 5 and 6 do the cameras hardly tell."""


def reached(runs: ArmRuns) -> dict[str, FloatArray]:
    """By experiment, of each run and each rest of the arm: when the motion to it began after the
    first one [s], and the joints in it [degrees], (n_runs, n_rests, 7)."""
    task = ArmFollowing(runs, half="chosen_on")
    robot = arm(runs.urdf, task.finger_angle, (0.0,) * len(JOINTS))
    model, place = RobotModel(robot), Pose.at(task.marker_aside, 0.0, 0.0) * marker(runs, robot)
    return {
        experiment: np.array(
            [_rests(run, model, place) for run in runs.of(experiment, "chosen_on")]
        )
        for experiment in COMMANDS
    }


def _rests(run: ArmRun, model: RobotModel, place: Pose) -> list[FloatArray]:
    """Of each rest, the first one before all commands: when the motion to it began after the first
    one [s], and the joints in it [degrees]."""
    commands, first = COMMANDS[run.experiment], started(run, model.robot)
    due = [0.0, *(c.time for c in commands), float(run.time[-1] - run.time[0]) - first + EARLY]
    targets = [(0.0,) * len(JOINTS), *(c.angles for c in commands)]
    rests = []
    for k, target in enumerate(targets):
        quiet = first + due[k + 1] - EARLY if k else 0.6  # until when the hand rests, surely
        last = round(quiet / TICK)
        seen = np.median(run.hand[last - 50 : last], axis=0)
        time = due[k]
        if k > 1:
            before = first + due[k] - EARLY
            time = began(run, model, targets[k - 1], commands[k - 1], before) - first
        rests.append(np.array([time, *np.degrees(_joints(model, seen, place, target))]))
    return rests


def _joints(
    model: RobotModel, seen: FloatArray, place: Pose, target: Sequence[float]
) -> FloatArray:
    """That put the marker body where it is seen, near a command [rad], (6,)."""
    inverse, commanded = Pose.from_array(seen).inverse(), np.radians(target)

    def off(moved: FloatArray) -> FloatArray:
        joints = commanded.copy()
        joints[COMMANDED] += moved
        left = inverse * (model.tool_pose(joints) * place)
        turn = 2.0 * np.sign(left.quaternion[0]) * np.array(left.quaternion[1:])
        return np.concatenate([MILLIMETRE * np.array(left.position), DEGREE * turn, PRIOR * moved])

    joints = commanded.copy()
    joints[COMMANDED] += least_squares(off, np.zeros(len(COMMANDED)), method="lm").x
    return joints
