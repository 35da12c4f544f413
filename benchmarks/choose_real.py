"""Chooses the settings of the profiles `real`: a coarse search on the even tosses of a real cube.

python benchmarks/choose_real.py SIMULATOR...                         its grid, best first
python benchmarks/choose_real.py --friction 0.16,0.18 SIMULATOR...    frictions, with `real`

Needs the data set cube_tosses (`simbench download cube_tosses`, or $SIMBENCH_DATA). Each
candidate is the profile `tuned` with a few settings changed. It is simulated from the start of each
even toss; the odd ones are never looked at. What is printed is the mean over the tosses of the
position error [% of the edge] and the rotation error [degrees].
"""

from __future__ import annotations

import argparse
import itertools
import statistics
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pytest_simbench.data import read
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.tasks import Tossing

GRIDS: Mapping[str, Mapping[str, tuple[Any, ...]]] = {
    "mujoco": {"solref": ((0.002, 1.0), (0.004, 1.0), (0.008, 1.0), (0.004, 2.0)),
               "impratio": (1.0, 10.0)},
    "pybullet": {"timestep": (1 / 240, 1 / 1000), "contact_erp": (0.08, 0.2, 0.8),
                 "solver_iterations": (50, 200)},
    "sapien": {"timestep": (0.004, 0.002, 0.001), "position_iterations": (4, 16),
               "contact_offset": (0.01, 0.002)},
    "ovphysx": {"timestep": (0.002, 0.001), "body_iterations": (4, 16),
                "max_depenetration_velocity": (3.0, 0.3)},
    "drake": {"timestep": (0.002, 0.001), "relaxation_time": (0.01, 0.03),
              "corner_radius": (0.001, 0.0)},
    "dart": {"timestep": (0.001, 0.0005, 0.002), "detector": ("ode", "bullet", "fcl"),
             "split_impulse": (False, True)},
    "newton": {"ke": (250000.0, 62500.0), "kd": (1000.0, 500.0)},
    "genesis": {"timestep": (0.002, 0.001), "constraint_timeconst": (0.004, 0.01)},
    "ode": {"timestep": (0.002, 0.001), "friction": ("slip",), "contact_erp": (0.2, 0.5),
            "contact_cfm": (1e-5, 1e-4, 1e-3)},
}  # fmt: skip
"""Settings that decide how a contact gives way, and few values of each, around those of `tuned`."""

MORE: Mapping[str, tuple[Mapping[str, Any], ...]] = {
    "drake": (
        *(
            {"timestep": 0.001, **changes}
            for changes in (
                {"point_stiffness": 3e5}, {"point_stiffness": 1e5}, {"relaxation_time": 0.003},
                {"corner_radius": 0.004}, {"timestep": 0.0005},
                {"approximation": "lagged", "hunt_crossley_dissipation": 1.0},
                {"corner_radius": 0.0, "compliance": "compliant",
                 "contact_model": "hydroelastic_with_fallback"},
            )
        ),
        *(
            {"timestep": step, "point_stiffness": stiffness, "relaxation_time": relaxation}
            for step in (0.001, 0.0005)
            for stiffness in (1e4, 3e4, 1e5, 3e5)
            for relaxation in (0.0003, 0.001, 0.003)
        ),
    ),
}  # fmt: skip
"""What was tried besides. Drake has no restitution, but soft contacts that dissipate little bounce:
the last ones."""


def candidates(simulator: str) -> Iterator[dict[str, Any]]:
    """Every combination of a grid, and what was tried besides."""
    grid = GRIDS[simulator]
    for values in itertools.product(*grid.values()):
        yield dict(zip(grid, values, strict=True))
    yield from map(dict, MORE.get(simulator, ()))


def score(case: Case, task: Tossing) -> tuple[float, float]:
    """Mean position and rotation error over the tosses; infinite where one fails."""
    experiment, executor = Experiment(case, task), LocalExecutor()
    try:
        found = []
        for number in range(1, task.repetitions + 1):
            record, _ = executor.repetition(experiment, number).run()
            if not record.ok:
                return float("inf"), float("inf")
            found.append([record.metrics[metric.name] for metric in task.metrics])
        position, rotation = (statistics.fmean(column) for column in zip(*found, strict=True))
        return position, rotation
    finally:
        executor.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("simulators", nargs="+", choices=GRIDS)
    parser.add_argument("--friction", default="")
    asked = parser.parse_args()
    tosses = Tossing(read("cube_tosses"), half="chosen_on")
    with tempfile.TemporaryDirectory() as folder:
        for simulator in asked.simulators:
            case = Case.of(
                simulator, test="choose", mode="headless", profile="tuned", folder=Path(folder)
            )
            rows = []
            if asked.friction:
                for friction in map(float, asked.friction.split(",")):
                    real = Case.of(
                        simulator, test="choose", mode="headless", profile="real",
                        folder=Path(folder),
                    )  # fmt: skip
                    task = Tossing(tosses.tosses, half="chosen_on", friction=friction)
                    rows.append((*score(real, task), {"friction": friction}))
            else:
                for changes in candidates(simulator):
                    tried = Case(**{**vars(case), "changes": changes})
                    rows.append((*score(tried, tosses), changes))
                    print(".", end="", flush=True)
            print(f"\n{simulator}: {len(rows)} candidates, {tosses.repetitions} tosses each")
            for position, rotation, told in sorted(rows, key=lambda row: row[0]):
                named = " ".join(f"{name}={value}" for name, value in told.items())
                print(f"  {position:6.2f} %  {rotation:6.2f} deg  {named}", flush=True)


if __name__ == "__main__":
    main()
