"""The source's own simulations of the arm, by the measure of `ArmFollowing`.

python benchmarks/source_simulations.py CLONE [--write]

CLONE is a clone of the repository of the data set arm_pushes (docs/reality.md), whose folder
Data/Simulation is no part of the set. It holds 20 runs of each of seven simulators and experiments,
20 samples a second. Each is held against each held-out real run, hand against hand, from the first
command on. `--write` puts the means into docs/data/source_simulations.csv, which
docs/make_tasks.py reads. Needs the data set arm_pushes.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import numpy as np

from pytest_simbench.data import read
from pytest_simbench.data.pushes import FREE, PUSH, ArmRuns
from pytest_simbench.tasks import ArmFollowing
from pytest_simbench.tasks.arm_following import COMPARED

SIMULATORS = ("PyBullet", "VRepVortex", "VRepNewton", "Mujoco", "VRepBullet283", "VRepBullet278",
              "VRepODE")  # fmt: skip
FOLDERS = {FREE: "Experiment1/Single", PUSH: "Experiment3/CubeExp"}
TABLE = Path(__file__).resolve().parents[1] / "docs" / "data" / "source_simulations.csv"
HEADER = ("experiment", "simulator", "runs", "hand_error", "displacement")

DIVERGED = 10.0
"""A hand further away than this [m] has left the room."""


def rows(runs: ArmRuns, clone: Path) -> list[list[str]]:
    """Of each experiment and simulator: mean hand error and the cube's displacement [m], empty
    where it diverged."""
    task, found = ArmFollowing(runs), []
    for experiment, start in FOLDERS.items():
        real = [task.seen(run) for run in runs.of(experiment, "held_out")]
        for simulator in SIMULATORS:
            files = sorted((clone / "Data" / "Simulation").glob(f"{start}_{simulator}_*.csv"))
            ways = [np.loadtxt(file) for file in files]
            errors = [_error(way[:, :3], *seen) for way in ways for seen in real]
            moved = [float(way[-1, 7] - way[0, 7]) for way in ways]
            diverged = not np.mean(errors) < DIVERGED
            told = ["", ""] if diverged else [f"{np.mean(v):.6g}" for v in (errors, moved)]
            found.append([experiment, simulator, str(len(ways)), *told])
    return found


def _error(hand: np.ndarray, time: np.ndarray, real: np.ndarray) -> float:
    known = time <= COMPARED * (len(hand) - 1)
    knots = COMPARED * np.arange(len(hand))
    at = np.stack([np.interp(time[known], knots, column) for column in hand.T], axis=1)
    return float(np.linalg.norm(at - real[known], axis=1).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clone", type=Path)
    parser.add_argument("--write", action="store_true")
    asked = parser.parse_args()
    found = rows(read("arm_pushes"), asked.clone)
    for row in found:
        print("  ".join(row))
    if asked.write:
        with TABLE.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows([HEADER, *found])


if __name__ == "__main__":
    main()
