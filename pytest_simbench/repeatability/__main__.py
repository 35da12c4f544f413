"""`simbench replay FILE`: replay a failing episode outside pytest."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from pytest_simbench.client.errors import WorkerError
from pytest_simbench.experiment.example import Example, ExampleError, read_example
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.ground.text import for_terminal, in_one_line


def main(arguments: Sequence[str] | None = None) -> int:
    """Replay, print where the cubes end, and return the exit status: 0, or 1 when the worker
    failed, or 2 for a file that holds no episode for this machine."""
    parser = argparse.ArgumentParser(
        prog="simbench replay",
        description="Replay an episode that a failing test left in its run folder. The file says "
        "what to simulate; how to start the simulator is this machine's own.",
    )
    parser.add_argument("file", type=Path, help="examples/NAME.json in the run folder")
    parser.add_argument("--gui", action="store_true", help="in the simulator's own window")
    parser.add_argument("--python", metavar="PATH", help="interpreter of the simulator's worker")
    parser.add_argument("--spec", help="execnet specification of the simulator's worker")
    parser.add_argument(
        "--trust-robot",
        action="store_true",
        help="use the description files that FILE names, for a robot that is not known here",
    )
    given = parser.parse_args(arguments)
    try:
        with tempfile.TemporaryDirectory() as folder:
            example = read_example(
                given.file,
                Path(folder),
                mode="gui" if given.gui else None,
                python=given.python,
                spec=given.spec,
                trust_robot=given.trust_robot,
            )
            if example.case.mode == "gui" and not (
                os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
            ):
                raise ExampleError("there is no display for a window; try xvfb-run")
            _replay(example)
    except ExampleError as error:
        return _complain(error, 2)
    except WorkerError as error:
        return _complain(error, 1)
    except KeyboardInterrupt:
        return _complain("interrupted", 130)
    return 0


def _complain(reason: object, status: int) -> int:
    print(for_terminal(str(reason)), file=sys.stderr)
    return status


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
                start = scene.body(name).pose.position
                moved = sum((a - b) ** 2 for a, b in zip(pose.position, start, strict=True))
                x, y, z = pose.position
                print(f"  {name}: {x:.4f} {y:.4f} {z:.4f} m, {1000 * moved**0.5:.1f} mm moved")
    finally:
        handle.close()


def _differences(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """One sentence for each package whose version is another one than the file's."""
    return [
        f"note: the file was made with {name} {version}, this is {now.get(name, 'without it')}"
        for name, version in before.items()
        if now.get(name) != version
    ]


if __name__ == "__main__":
    sys.exit(main())
