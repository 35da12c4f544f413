"""Calibrates what the source does not tell of the real arm, on the runs that are not held out.

python benchmarks/calibrate_push.py push SIMULATOR...   fingers, friction and marker of ArmPushing
python benchmarks/calibrate_push.py follow              what the arm makes of its commands

Needs the data set arm_pushes (`simbench download arm_pushes`, or $SIMBENCH_DATA). The held-out
runs are never looked at.

`push` finds one set of values for all the simulators given, with their profile `real`: the least
squares of two things of each run, how far the cube goes [mm] and how it turns [degrees]. One step
of Gauss and Newton from the values that are committed, with derivatives by differences to both
sides; the standard errors come from what is left over. Two things tell two values, so friction
stays as it is; what it changes is printed. So is the delay of the cube half way, which none of them
brings into order.

`follow` needs no simulator: it finds when the motions begin, and which joint angles put the marker
body where the cameras see it at rest; the standard deviations are over the runs.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from pytest_simbench.data import read
from pytest_simbench.data.pushes import COMMANDS, ArmRun, ArmRuns
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.robot.model import RobotModel
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.tasks import ArmFollowing, ArmPushing
from pytest_simbench.tasks.arm_following import TICK, began, started
from pytest_simbench.tasks.arm_pushing import JOINTS, arm, marker

STEPS: Mapping[str, float] = {"finger_angle": 0.05, "marker_aside": 0.002}
"""To both sides of a value, for the derivatives: as large as what one wants to know."""

FRICTION_STEP = 0.05

MILLIMETRE, DEGREE, PRIOR = 1000.0, float(np.degrees(1.0)), float(np.degrees(1.0)) / 3
"""Weights at rest: 1 mm and 1 degree of the marker body count as 3 degrees off a command."""

EARLY = 0.4
"""So long before a command is due the arm surely rests [s]: the later ones come 0.15 s early."""

COMMANDED = [0, 1, 2, 3]
"""Joints that are fitted at rest; what 5 and 6 do the cameras hardly tell."""


class Pushes:
    """The runs that are not held out on a few simulators, a worker each."""

    def __init__(self, simulators: Sequence[str], folder: Path) -> None:
        self.cases = [
            Case.of(name, test="calibrate", mode="headless", profile="real", folder=folder)
            for name in simulators
        ]
        self.executors = [LocalExecutor() for _ in self.cases]

    def off(self, task: ArmPushing) -> FloatArray:
        """What is off in each run of each simulator: distance [mm], turn [degrees] and delay half
        way [ms], (n_simulators * n_runs, 3)."""
        rows = []
        for case, executor in zip(self.cases, self.executors, strict=True):
            for number in range(1, task.repetitions + 1):
                record, error = executor.repetition(Experiment(case, task), number).run()
                if error is not None:
                    raise SystemExit(f"{case.simulator}: {error}")
                told = record.details
                far = 1000.0 * (record.metrics["displacement"] - told["real_displacement"])
                rows.append((far, told["turn"] - told["real_turn"], 1000.0 * told["delay"]))
        found = np.array(rows)
        far, turned, late = found.mean(axis=0)
        print(f"  fingers {task.finger_angle:.3f} rad, marker {1000 * task.marker_aside:.1f} mm, "
              f"friction {task.friction:.2f}: {far:+.2f} mm, {turned:+.2f} degrees, {late:+.0f} ms",
              flush=True)  # fmt: skip
        return found

    def close(self) -> None:
        for executor in self.executors:
            executor.close()


def push(runs: ArmRuns, simulators: list[str]) -> None:
    """Print the values, how well they are known, and what is left."""
    task = ArmPushing(runs, half="chosen_on")
    at = np.array([getattr(task, name) for name in STEPS])
    print(f"{', '.join(simulators)}: {task.repetitions} runs each")
    with tempfile.TemporaryDirectory() as folder:
        pushes = Pushes(simulators, Path(folder))
        try:

            def off(values: FloatArray) -> FloatArray:
                tried = replace(task, **dict(zip(STEPS, map(float, values), strict=True)))
                return pushes.off(tried)[:, :2].ravel()

            here = off(at)
            columns = []
            for k, step in enumerate(STEPS.values()):
                aside = np.eye(len(at))[k] * step
                columns.append((off(at + aside) - off(at - aside)) / (2 * step))
            pushes.off(replace(task, friction=task.friction + FRICTION_STEP))
        finally:
            pushes.close()
    slopes = np.stack(columns, axis=1)
    moved, *_ = np.linalg.lstsq(slopes, -here, rcond=None)
    left = here + slopes @ moved
    spread = float(left @ left) / (len(left) - len(at))
    errors = np.sqrt(spread * np.diag(np.linalg.inv(slopes.T @ slopes)))
    for name, old, change, error in zip(STEPS, at, moved, errors, strict=True):
        print(f"  {name}: {old:.4g} committed, {old + change:.4g} +- {error:.2g} found")
    print(f"  root of the mean square: {np.sqrt(np.mean(here**2)):.2f} committed, "
          f"{np.sqrt(np.mean(left**2)):.2f} expected where found")  # fmt: skip


def follow(runs: ArmRuns) -> None:
    """Print the times and angles of `tasks.arm_following.REACHED`."""
    for experiment, found in reached(runs).items():
        print(f"{experiment}: {len(found)} runs")
        for row, varies in zip(found.mean(axis=0), found.std(axis=0), strict=True):
            print(f"  {row[0]:6.3f} +- {varies[0]:.3f} s, joints {np.round(row[1:], 1).tolist()} "
                  f"+- {np.round(varies[1:], 1).tolist()} degrees")  # fmt: skip


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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("push", "follow"))
    parser.add_argument("simulators", nargs="*")
    asked = parser.parse_args()
    runs = read("arm_pushes")
    if asked.what == "follow":
        follow(runs)
    elif not asked.simulators:
        parser.error("push needs one simulator at least")
    else:
        push(runs, asked.simulators)


if __name__ == "__main__":
    main()
