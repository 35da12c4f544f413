"""Stepping in the worker against a bare loop over the same engine, scene, steps and commands.

    python benchmarks/stepping.py [SIMULATOR...]

Without names: every simulator of this environment.

Each pair of runs is made in two fresh processes, in turn. `clock` is the worker's own clock of
stepping, `all` the whole request: message, log check, bookkeeping, and watching whether the world
stays the same (`unwatched`: without that). All in CPU seconds, since these machines are shared.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import psutil

from pytest_simbench.client import bootstrap
from pytest_simbench.client.environments import Environment, interpreter, missing
from pytest_simbench.client.errors import Where
from pytest_simbench.client.launch import Launch
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.world import World
from pytest_simbench.robot.model import RobotModel
from pytest_simbench.robot.timing import straight_move
from pytest_simbench.scene import Trajectory
from pytest_simbench.simulator.registry import adapter, registered
from pytest_simbench.tasks import Jitter, Stacking

SCENE = Stacking().scene(1, Jitter())
PAIRS = 7
READINGS = 5
"""Of what an engine holds, after the motion."""


def motion() -> Trajectory:
    """A slow swing of the arm above the cubes, about 6 s."""
    assert SCENE.robot is not None
    model = RobotModel(SCENE.robot)
    start = SCENE.robot.column("initial_position")[:7]
    timed = straight_move(
        start, start + np.array([0.8, -0.2, 0, 0, 0, 0, 0.5]), model.limits, speed=0.1
    )
    rows = len(timed.position)
    position = np.hstack([timed.position, np.full((rows, 2), 0.035)])
    velocity, acceleration = (
        np.hstack([part, np.zeros((rows, 2))]) for part in (timed.velocity, timed.acceleration)
    )
    gravity = np.array(SCENE.gravity)
    effort = model.inverse_dynamics(gravity, position, velocity, acceleration)
    return Trajectory(0.004, position, velocity, effort)


def bare(name: str) -> float:
    """CPU seconds of a loop with nothing in it but command and step, in a process of its own."""
    return loop(name)[-1]


def loop(name: str, **more: int) -> list[float]:
    """What `bare_loop.py` prints for a simulator."""
    info, trajectory = adapter(name).info, motion()
    order = {
        "bootstrap": bootstrap.__file__,
        "packages": {
            package: find_spec(package).origin  # type: ignore[union-attr]
            for package in ("pytest_simbench", "pytest_simbench.sims")
        },
        "adapter": registered()[name].value,
        "scene": SCENE.to_wire(),
        "tick": trajectory.tick,
        "position": trajectory.position.tolist(),
        "velocity": trajectory.velocity.tolist(),
        "effort": trajectory.effort.tolist(),
        **more,
    }
    output = subprocess.run(
        [interpreter(info) or sys.executable, str(Path(__file__).with_name("bare_loop.py"))],
        input=json.dumps(order),
        stdout=subprocess.PIPE,
        env={**os.environ, **Environment.of(info).variables()},
        text=True,
        check=True,
    ).stdout
    return [float(line) for line in output.splitlines()[-1 - 2 * len(more) :]]


def worker(name: str, *, watched: bool = True) -> tuple[float, float, float]:
    """CPU seconds of the same motion in a worker: its own clock, the whole request, and a reading.

    Watched, as every repetition is: at some steps the engine is asked again what it holds.
    """
    path, info = registered()[name].value, adapter(name).info
    launch = Launch(
        path,
        python=interpreter(info),
        environment=Environment.of(info).variables(),
        start_timeout=600.0,
        stall_timeout=600.0,
        compile_timeout=info.compile_timeout if info.costly_start else 0.0,
    )
    process = WorkerProcess(launch, Where(name, "headless"))
    process.construct()
    world = World(process, SCENE)
    if watched:
        world.watch(1)
    trajectory = motion()
    assert process.pid is not None
    itself = psutil.Process(process.pid)
    began = sum(itself.cpu_times()[:2])
    world.follow(trajectory)
    whole = sum(itself.cpu_times()[:2]) - began
    clock = world.stats()["stepping"]["cpu"]
    began = sum(itself.cpu_times()[:2])
    for _ in range(READINGS):
        world.read_again()
    reading = (sum(itself.cpu_times()[:2]) - began) / READINGS
    process.close()
    return clock, whole, reading


def main(names: list[str]) -> None:
    for name in names or [n for n in registered() if not missing(adapter(n).info)]:
        clock, whole, unwatched, readings = [], [], [], []
        for _ in range(PAIRS):
            alone = bare(name)
            mine, request, reading = worker(name)
            readings.append(1000 * reading)
            clock.append(mine / alone)
            whole.append(request / alone)
            unwatched.append(worker(name, watched=False)[1] / alone)
        for title, ratios in (("clock", clock), ("all", whole), ("all, unwatched", unwatched)):
            print(
                f"{name}: {title} {statistics.median(ratios):.3f} x the bare loop "
                f"(min {min(ratios):.3f}, max {max(ratios):.3f}, {PAIRS} pairs)"
            )
        print(f"{name}: reading what it holds {statistics.median(readings):.0f} ms of CPU")


if __name__ == "__main__":
    main(sys.argv[1:])
