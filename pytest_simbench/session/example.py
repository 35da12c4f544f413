"""Episodes as files: scene and commands of one that failed, and the line that replays it."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from pytest_simbench.client.tape import Operation
from pytest_simbench.measure.names import file_name
from pytest_simbench.scene import Scene
from pytest_simbench.session.case import Case

FOLDER = "examples"
SCHEMA = 1


class ExampleError(ValueError):
    """A file that holds no episode; the message names it."""


def write_example(case: Case, name: str, scene: Scene, tape: Sequence[Operation]) -> Path:
    """Write an episode to the run folder; one of the same test and name is replaced.

    Under Hypothesis the last failing example is the smallest, so that is what stays.

    Args:
        case: simulator and settings.
        name: the readable part of the file's name.
        scene: of the episode.
        tape: what was done.

    Raises:
        OSError: the folder cannot be written to.
    """
    test = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" ")[0]
    path = case.folder / FOLDER / f"{file_name(name, test, case.test)}.json"
    example = {
        "schema": SCHEMA,
        "case": {key: getattr(case, key) for key in _KEPT} | {"changes": dict(case.changes)},
        "scene": scene.to_wire(),
        "tape": [operation.to_wire() for operation in tape],
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(example) + "\n", encoding="utf-8")
    return path


_KEPT = (
    "test", "simulator", "mode", "profile", "adapter", "python", "spec", "stall_timeout",
    "costly_start", "compile_timeout",
)  # fmt: skip
"""Fields of a case that a replay needs."""


def read_example(path: Path, folder: Path, **changes: Any) -> tuple[Case, Scene, list[Operation]]:
    """An episode from its file, with a run folder of its own.

    Args:
        path: of the file.
        folder: for the replay's logs.
        changes: of the case, `mode` for instance.

    Raises:
        ExampleError: no such file, or something else in it.
    """
    try:
        data = json.loads(path.read_text("utf-8"))
        case = replace(Case(folder=folder, **data["case"]), **changes)
        tape = [Operation.from_wire(operation) for operation in data["tape"]]
        return case, Scene.from_wire(data["scene"]), tape
    except OSError as error:
        raise ExampleError(f"cannot read {path}: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise ExampleError(f"{path} holds no episode of pytest-simbench") from None


def replay_command(path: Path) -> str:
    """What to type to see the episode in `path` again."""
    with suppress(ValueError):
        path = path.absolute().relative_to(Path.cwd())
    return f"python -m pytest_simbench.repeatability {path}"
