"""CPU seconds of a loop with nothing in it but command and step; run by stepping.py.

Reads from standard input what to load and which set points to command: an engine's own interpreter
has neither this package nor pytest nor a planner; numpy and the engine are all that is needed.
"""

from __future__ import annotations

import json
import pkgutil
import runpy
import sys
import time


def main() -> None:
    order = json.load(sys.stdin)
    finder = runpy.run_path(order["bootstrap"])["PackageFinder"]
    sys.meta_path.insert(0, finder(order["packages"]))
    import numpy as np

    from pytest_simbench.scene import Scene, Trajectory

    cls = pkgutil.resolve_name(order["adapter"])
    simulator = cls(cls.profiles["tuned"])
    scene = Scene.from_wire(order["scene"])
    if cls.info.costly_start:
        simulator.compile(scene)
    simulator.load(scene)
    simulator.read_back()  # as in the worker: what engines load when first asked is not stepping
    rows = (np.array(order[part]) for part in ("position", "velocity", "effort"))
    points = Trajectory(order["tick"], *rows).resampled(simulator.settings.timestep)
    commands = list(zip(points.position, points.velocity, points.effort, strict=True))
    began = time.process_time()
    for row in commands:
        simulator.command(*row)
        simulator.step()
    print(time.process_time() - began)


main()
