"""What a policy's questions cost beside the steps between them, in the scene of the stacking.

    python benchmarks/closed_loop.py [SIMULATOR...] [--seconds 1] [--pairs 30]

Bounds, MuJoCo: at 50 Hz at most 15 % of the CPU time of the same set points as a trajectory, worker
and this process together; at 500 Hz inside the worker, faster than real time. Rates are the nearest
that are whole steps. The three are measured in turn, in one worker, in pieces so short that a busy
machine slows them alike.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

from common import ROOT, arguments, case, present, spread

from pytest_simbench.client.errors import Where
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.world import World
from pytest_simbench.motion.kinematics import Servo
from pytest_simbench.scene import Trajectory
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks import Jitter, Stacking

sys.path.insert(0, str(ROOT / "tests" / "client"))
from waving import Waving, still


def costs(name: str, seconds: float, pairs: int) -> None:
    launch = case(name, Path(os.devnull), stall_timeout=600.0).launch("loop")
    process = WorkerProcess(launch, Where(name, "headless", seed=1))
    process.construct()
    world = World(process, Stacking().scene(1, Jitter()), kinematics=Servo)
    step = adapter(name).profiles["tuned"].timestep
    slow, fast = (1 / (max(1, round(1 / (rate * step))) * step) for rate in (50.0, 500.0))
    clock = ~(process.pid or 0) << 3 | 2  # its CPU time: man clock_getcpuclockid

    def cpu(act: Callable[[], object]) -> float:
        before = time.clock_gettime(clock) + time.process_time()
        act()
        return time.clock_gettime(clock) + time.process_time() - before

    world.control(still, until=1.0, rate=slow)
    held = Trajectory.holding(seconds, world.joints[0])
    found = []
    for _ in range(pairs):
        waited = cpu(lambda: world.wait(seconds))
        alone = cpu(lambda: world.follow(held))
        asked = cpu(lambda: world.control(still, until=seconds, rate=slow))
        began = time.perf_counter()
        world.control(Waving(0.1), until=seconds, rate=fast, inside=True)
        times = seconds / (time.perf_counter() - began)
        found.append((100 * (asked / alone - 1), 100 * (asked / waited - 1), times))
    process.close()
    more, over_waiting, inside = (spread(values, ".1f") for values in zip(*found, strict=True))
    ms = f"{1000 * alone / seconds / slow:.2f} ms of steps between two questions"
    print(f"{name}: at {slow:.3g} Hz, % of CPU more: {more}; than waiting: {over_waiting}; {ms}")
    print(f"{name}: inside at {fast:.3g} Hz, times real time: {inside}", flush=True)


if __name__ == "__main__":
    given = arguments(__doc__, {"simulators": []}, seconds=1.0, pairs=30)
    for simulator in given.simulators or present():
        costs(simulator, given.seconds, given.pairs)
