"""`python -m pytest_simbench.repeatability FILE`: replay a failing episode outside pytest."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from pytest_simbench.client.errors import WorkerError
from pytest_simbench.session.example import ExampleError, read_example
from pytest_simbench.session.handle import SimulatorHandle


def main(arguments: Sequence[str] | None = None) -> int:
    """Replay, print where the cubes end, and return the exit status: 0, or 1 when the worker
    failed, or 2 for a file that holds no episode."""
    parser = argparse.ArgumentParser(
        prog="python -m pytest_simbench.repeatability",
        description="Replay an episode that a failing test left in its run folder.",
    )
    parser.add_argument("file", type=Path, help="examples/NAME.json in the run folder")
    parser.add_argument("--gui", action="store_true", help="in the simulator's own window")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        try:
            changes = {"mode": "gui"} if given.gui else {}
            case, scene, tape = read_example(given.file, Path(folder), **changes)
        except ExampleError as error:
            print(error, file=sys.stderr)
            return 2
        if case.mode == "gui" and not (
            os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        ):
            print("there is no display for a window; try xvfb-run", file=sys.stderr)
            return 2
        handle = SimulatorHandle(case)
        try:
            with handle.episode(scene) as world:
                world.play(tape)
                print(f"{case.simulator} {case.mode} {case.profile}, t = {world.time:.3f} s")
                for name, pose in world.poses().items():
                    start = scene.body(name).pose.position
                    moved = sum((a - b) ** 2 for a, b in zip(pose.position, start, strict=True))
                    x, y, z = pose.position
                    print(f"  {name}: {x:.4f} {y:.4f} {z:.4f} m, {1000 * moved**0.5:.1f} mm moved")
        except WorkerError as error:
            print(error, file=sys.stderr)
            return 1
        finally:
            handle.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
