"""Stepping in the worker against a bare loop over the same engine, scene, steps and commands.

    python benchmarks/stepping.py mujoco pybullet dart

Each pair of runs is made in two fresh processes, in turn. `clock` is the worker's own clock of
stepping, `all` the whole request: message, log check, bookkeeping. All in CPU seconds,
since these machines are shared.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import time

import numpy as np
import psutil

from pytest_simbench.client.errors import Where
from pytest_simbench.client.process import Launch, WorkerProcess
from pytest_simbench.client.world import World
from pytest_simbench.robot.model import RobotModel
from pytest_simbench.robot.timing import straight_move
from pytest_simbench.scene import Trajectory
from pytest_simbench.simulator.registry import adapter, registered
from pytest_simbench.tasks import Jitter, Stacking

SCENE = Stacking().scene(1, Jitter())
PAIRS = 7


def motion() -> Trajectory:
    """A slow swing of the arm above the cubes, about 6 s."""
    assert SCENE.robot is not None
    model = RobotModel(SCENE.robot)
    start = SCENE.robot.column("initial_position")[:7]
    timed = straight_move(start, start + np.array([0.8, -0.2, 0, 0, 0, 0, 0.5]), speed=0.1)
    rows = len(timed.position)
    position = np.hstack([timed.position, np.full((rows, 2), 0.035)])
    velocity, acceleration = (
        np.hstack([part, np.zeros((rows, 2))]) for part in (timed.velocity, timed.acceleration)
    )
    gravity = np.array(SCENE.gravity)
    effort = model.inverse_dynamics(gravity, position, velocity, acceleration)
    return Trajectory(0.004, position, velocity, effort)


def bare(name: str) -> float:
    """CPU seconds of a loop with nothing in it but command and step."""
    cls = adapter(name)
    simulator = cls(cls.profiles["tuned"])
    simulator.load(SCENE)
    points = motion().resampled(simulator.settings.timestep)
    rows = list(zip(points.position, points.velocity, points.effort, strict=True))
    began = time.process_time()
    for row in rows:
        simulator.command(*row)
        simulator.step()
    return time.process_time() - began


def worker(name: str) -> tuple[float, float]:
    """CPU seconds of the same motion in a worker: its own clock, and the whole request."""
    path = registered()[name].value
    process = WorkerProcess(Launch(path), Where(name, "headless"))
    process.request(
        "construct", adapter=path, profile="tuned", changes={}, gui=False, real_time=False
    )
    world = World(process, SCENE)
    trajectory = motion()
    assert process.pid is not None
    watched = psutil.Process(process.pid)
    began = sum(watched.cpu_times()[:2])
    world.follow(trajectory)
    whole = sum(watched.cpu_times()[:2]) - began
    clock = world.stats()["stepping"]["cpu"]
    process.close()
    return clock, whole


def main(names: list[str]) -> None:
    if names[:1] == ["--bare"]:
        print(json.dumps(bare(names[1])))
        return
    for name in names or ["mujoco", "pybullet", "dart"]:
        clock, whole = [], []
        for _ in range(PAIRS):
            output = subprocess.check_output([sys.executable, __file__, "--bare", name], text=True)
            alone = json.loads(output.splitlines()[-1])
            mine, request = worker(name)
            clock.append(mine / alone)
            whole.append(request / alone)
        for title, ratios in (("clock", clock), ("all", whole)):
            print(
                f"{name}: {title} {statistics.median(ratios):.3f} x the bare loop "
                f"(min {min(ratios):.3f}, max {max(ratios):.3f}, {PAIRS} pairs)"
            )


if __name__ == "__main__":
    main(sys.argv[1:])
