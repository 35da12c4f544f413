"""`simbench replay FILE`: replay a failing episode outside pytest."""

from __future__ import annotations

import math
import os
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from pytest_simbench.client.errors import WorkerError
from pytest_simbench.experiment.example import Example, ExampleError, read_example
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.ground.text import for_terminal, in_one_line


def replay_file(
    path: str, gui: bool, python: str | None, spec: str | None, trust_robot: bool
) -> int:
    """Replay, print where the cubes end, and return the exit status: 1 when the worker failed.

    Raises:
        ExampleError: the file holds no episode for this machine.
    """
    with tempfile.TemporaryDirectory() as folder:
        mode, here = "gui" if gui else None, Path(folder)
        example = read_example(
            Path(path), here, mode=mode, python=python, spec=spec, trust_robot=trust_robot
        )
        screen = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        if example.case.mode == "gui" and not screen:
            raise ExampleError("there is no display for a window; try xvfb-run -s -noreset")
        try:
            _replay(example)
        except WorkerError as error:
            print(for_terminal(str(error)), file=sys.stderr)
            return 1
    return 0


def _replay(example: Example) -> None:
    """Play the tape and print where the cubes end."""
    case, scene = example.case, example.scene
    handle = SimulatorHandle(case)
    try:
        with handle.episode(scene) as world:
            for line in _differences(example.versions, handle.constructed.versions):
                print(in_one_line(line))
            world.play(example.tape)
            print(f"{case.simulator} {case.mode} {case.profile}, t = {world.time:.3f} s")
            for name, pose in world.poses().items():
                moved = math.dist(pose.position, scene.body(name).pose.position)
                x, y, z = pose.position
                print(f"  {name}: {x:.4f} {y:.4f} {z:.4f} m, {1000 * moved:.1f} mm moved")
    finally:
        handle.close()


def _differences(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """One sentence for each package whose version is another one than the file's."""
    return [
        f"note: the file was made with {name} {version}, this is {now.get(name, 'without it')}"
        for name, version in before.items()
        if now.get(name) != version
    ]
