"""Calibrates what the source does not tell of the real arm, on the runs that are not held out.

python benchmarks/calibrate_push.py push SIMULATOR...   fingers, friction and marker of ArmPushing
python benchmarks/calibrate_push.py follow              what the arm makes of its commands

Needs the data set arm_pushes (`pytest --sim-download arm_pushes`, or $SIMBENCH_DATA). The held-out
runs are never looked at.

`push` finds one set of values for all the simulators given, with their profile `real`: the least
squares of three things of each run: how far the cube goes [mm], how it turns [degrees], and where
it is when the real one is half way [mm]. One step of Gauss and Newton from the values that are
committed, with derivatives by differences to both sides; the standard errors come from what is left
over. `follow` needs no simulator: it finds when the motions begin, and which joint angles put the
marker body where the cameras see it at rest; the standard deviations are over the runs.
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

STEPS: Mapping[str, float] = {"finger_angle": 0.05, "friction": 0.05, "marker_aside": 0.002}
"""To both sides of a value, for the derivatives: as large as what one wants to know."""

HALF_WAY_SPEED = 150.0
"""Of the real cube half way [mm/s]: what a second of delay is in millimetres."""

MILLIMETRE, DEGREE, PRIOR = 1000.0, float(np.degrees(1.0)), float(np.degrees(1.0)) / 3
"""Weights at rest: 1 mm and 1 degree of the marker body count as 3 degrees off a command."""

EARLY = 0.4
"""So long before a command is due the arm surely rests [s]: the later ones come 0.15 s early."""

COMMANDED = [0, 1, 2, 3]
"""Joints that are fitted at rest; what 5 and 6 do the cameras hardly tell."""


def residuals(task: ArmPushing, simulators: list[str]) -> FloatArray:
    """What is off in each run of each simulator, (n_simulators * n_runs, 3) [mm, degrees, mm]."""
    rows = []
    for simulator in simulators:
        with tempfile.TemporaryDirectory() as folder:
            case = Case.of(
                simulator, test="calibrate", mode="headless", profile="real", folder=Path(folder)
            )
            experiment, executor = Experiment(case, task), LocalExecutor()
            try:
                for number in range(1, task.repetitions + 1):
                    record, error = executor.repetition(experiment, number).run()
                    if error is not None:
                        raise SystemExit(f"{simulator}: {error}")
                    told = record.details
                    far = 1000.0 * (record.metrics["displacement"] - told["real_displacement"])
                    late = -HALF_WAY_SPEED * told["delay"]
                    rows.append((far, told["turn"] - told["real_turn"], late))
            finally:
                executor.close()
    return np.array(rows)


def push(runs: ArmRuns, simulators: list[str]) -> None:
    """Print the values, how well they are known, and what is left."""
    task = ArmPushing(runs, half="chosen_on")
    names = list(STEPS)
    at = np.array([getattr(task, name) for name in names])

    def off(values: FloatArray) -> FloatArray:
        tried = replace(task, **dict(zip(names, map(float, values), strict=True)))
        found = residuals(tried, simulators)
        told = ", ".join(f"{n} {v:.4g}" for n, v in zip(names, values, strict=True))
        far, turned, late = found.mean(axis=0)
        print(f"  {told}: {far:+.2f} mm, {turned:+.2f} deg, {late:+.2f} mm half way", flush=True)
        return found.ravel()

    here = off(at)
    columns = []
    for k, step in enumerate(STEPS.values()):
        aside = np.eye(len(at))[k] * step
        columns.append((off(at + aside) - off(at - aside)) / (2 * step))
    slopes = np.stack(columns, axis=1)
    moved, *_ = np.linalg.lstsq(slopes, -here, rcond=None)
    left = here + slopes @ moved
    spread = float(left @ left) / (len(left) - len(at))
    covariance = spread * np.linalg.inv(slopes.T @ slopes)
    errors = np.sqrt(np.diag(covariance))
    print(f"{', '.join(simulators)}: {len(runs.of('CubeExp', 'chosen_on'))} runs each")
    for k, name in enumerate(names):
        print(f"  {name}: {at[k]:.4g} committed, {at[k] + moved[k]:.4g} +- {errors[k]:.2g} found")
    print("  correlations:")
    for name, row in zip(names, covariance / np.outer(errors, errors), strict=True):
        print(f"    {name}: {np.round(row, 2)}")
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
