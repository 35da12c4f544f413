"""Stepping in the worker against a bare loop over the same engine, scene, steps and commands.

    python benchmarks/stepping.py [SIMULATOR...] [--pairs 7]

Bound: 1.05 times. Without names: every simulator of this environment.

Each pair of runs is made in two fresh processes, in turn. `clock` is the worker's own clock of
stepping, `all` the whole request: message, log check, bookkeeping, and watching whether the world
stays the same (`unwatched`: without that). All in CPU seconds, since these machines are shared.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import psutil
from common import arguments, case, present, spread

from pytest_simbench.client import bootstrap
from pytest_simbench.client.environments import Environment, interpreter
from pytest_simbench.client.errors import Where
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.world import World
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.timing import straight_move
from pytest_simbench.scene import Trajectory
from pytest_simbench.simulator.registry import adapter, registered
from pytest_simbench.tasks import Jitter, Stacking

SCENE = Stacking().scene(1, Jitter())
READINGS = 5
"""Of what an engine holds, after the motion."""


def motion() -> Trajectory:
    """A slow swing of the arm above the cubes, about 6 s."""
    assert SCENE.robot is not None
    model = RobotModel(SCENE.robot)
    start = SCENE.robot.column("initial_position")[:7]
    end = start + np.array([0.8, -0.2, 0, 0, 0, 0, 0.5])
    timed = straight_move(start, end, model.limits, speed=0.1)
    rows, arm = len(timed.position), (timed.position, timed.velocity, timed.acceleration)
    position, velocity, acceleration = (
        np.hstack([part, np.full((rows, 2), value)])
        for part, value in zip(arm, (0.035, 0.0, 0.0), strict=True)
    )
    gravity = np.array(SCENE.gravity)
    effort = model.inverse_dynamics(gravity, position, velocity, acceleration)
    return Trajectory(0.004, position, velocity, effort)


def bare(name: str, trajectory: Trajectory) -> float:
    """CPU seconds of a loop with nothing in it but command and step, in a process of its own."""
    info = adapter(name).info
    order = {
        "bootstrap": bootstrap.__file__,
        "packages": {
            package: find_spec(package).origin  # type: ignore[union-attr]
            for package in ("pytest_simbench", "pytest_simbench.sims")
        },
        "adapter": registered()[name].value,
        "scene": SCENE.to_wire(),
        "tick": trajectory.tick,
        **{part: getattr(trajectory, part).tolist() for part in ("position", "velocity", "effort")},
    }
    output = subprocess.run(
        [interpreter(info) or sys.executable, str(Path(__file__).with_name("bare_loop.py"))],
        input=json.dumps(order),
        stdout=subprocess.PIPE,
        env={**os.environ, **Environment.of(info).variables()},
        text=True,
        check=True,
    ).stdout
    return float(output.splitlines()[-1])


def worker(name: str, trajectory: Trajectory, *, watched: bool) -> tuple[float, float, float]:
    """CPU seconds of the same motion in a worker: its own clock, the whole request, and a reading.

    Watched, as every repetition is: at some steps the engine is asked again what it holds.
    """
    launch = case(name, Path(os.devnull), stall_timeout=600.0).launch("stepping")
    process = WorkerProcess(launch, Where(name, "headless"))
    process.construct()
    world = World(process, SCENE)
    if watched:
        world.watch(1)
    assert process.pid is not None
    itself = psutil.Process(process.pid)

    def clock() -> float:
        return sum(itself.cpu_times()[:2])

    began = clock()
    world.follow(trajectory)
    whole, stepping = clock() - began, world.stats()["stepping"]["cpu"]
    began = clock()
    for _ in range(READINGS):
        world.read_again()
    reading = (clock() - began) / READINGS
    process.close()
    return stepping, whole, reading


def main() -> None:
    given = arguments(__doc__, {"simulators": []}, pairs=7)
    trajectory = motion()
    for name in given.simulators or present():
        ratios: dict[str, list[float]] = {"clock": [], "all": [], "all, unwatched": []}
        readings = []
        for _ in range(given.pairs):
            alone = bare(name, trajectory)
            stepping, whole, reading = worker(name, trajectory, watched=True)
            _, unwatched, _ = worker(name, trajectory, watched=False)
            for values, cpu in zip(ratios.values(), (stepping, whole, unwatched), strict=True):
                values.append(cpu / alone)
            readings.append(1000 * reading)
        for title, values in ratios.items():
            print(f"{name}: {title}, over the bare loop: {spread(values)}")
        print(f"{name}: reading what it holds, ms of CPU: {spread(readings, '.0f')}", flush=True)


if __name__ == "__main__":
    main()
