"""What is asked of every engine, word for word: scenes, set points, metrics and parameters of all
laws and tasks, in full and small. Who changes a number of theirs reads it here."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from pytest_simbench.laws import LAWS, Law
from pytest_simbench.laws.base import held_out
from pytest_simbench.simulator import Capability
from pytest_simbench.tasks import (
    Carrying,
    CurvePushing,
    Inserting,
    Nesting,
    Opening,
    Oversized,
    PickAndPlace,
    Pouring,
    Pushing,
    PushingToGoal,
    Reaching,
    Slipping,
    Stacking,
    Throwing,
)
from pytest_simbench.tasks.base import Jitter, Task
from pytest_simbench.tasks.carrying import Shape
from pytest_simbench.tasks.inserting import Section
from pytest_simbench.tasks.towers import LeaningTowers
from pytest_simbench.testing import faults, scenes
from tests.approval import assert_approved

LONGEST = 24
"""Numbers that are written out; of more there is a digest."""


def limp(observation: Any) -> Any:
    """Asks for what is."""
    return observation.position


TASKS = (
    Stacking(), Throwing(), Pushing(), CurvePushing(), LeaningTowers(),
    *map(Carrying, get_args(Shape)), Slipping(), *map(Inserting, get_args(Section)),
    *map(Oversized, get_args(Section)), Nesting(), Pouring(), Opening(), Reaching(limp),
    PushingToGoal(limp), PickAndPlace(limp),
)  # fmt: skip


def words(value: Any) -> str:
    """A value in short: of a dataclass what is not as by default, of a file its name."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, float):
        return f"{round(value, 9) + 0.0:.9g}"
    if isinstance(value, Path) or (isinstance(value, str) and value.startswith("/")):
        return Path(value).name
    if is_dataclass(value) and not isinstance(value, type):
        kept = [
            f"{each.name}={words(getattr(value, each.name))}"
            for each in fields(value)
            if each.default is MISSING or repr(getattr(value, each.name)) != repr(each.default)
        ]
        return f"{type(value).__name__}({', '.join(kept)})"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {words(item)}" for key, item in value.items()) + "}"
    if isinstance(value, np.ndarray) or (
        isinstance(value, Sequence) and not isinstance(value, str)
    ):
        numbers = _numbers(value)
        if numbers.size > LONGEST:
            rounded = (np.round(numbers, 6) + 0.0).tobytes()
            return f"<{numbers.size}: {hashlib.sha256(rounded).hexdigest()[:10]}>"
        return "(" + ", ".join(map(words, value)) + ")"
    return str(value)


def _numbers(value: Any) -> np.ndarray:
    """Those that it holds; none where it holds something else."""
    try:
        return np.asarray(value, float)
    except (TypeError, ValueError):
        return np.zeros(0)


def told(task: Task) -> Iterator[str]:
    """A line for each thing that a task says of itself."""
    scene = task.scene(1001, Jitter(0.001, 0.01))
    yield from map(
        words, (*scene.bodies, *filter(None, [scene.robot]), *scene.starts, *scene.apart)
    )
    parameters = {k: v for k, v in task.parameters().items() if k != "task.policy_digest"}
    kept = ("name", "gravity", "ground_friction", "ground_restitution", "room", "friction_rule")
    yield words({name: getattr(scene, name) for name in kept})
    yield words({"parameters": parameters, "references": task.references})
    yield words({name: getattr(task, name) for name in ("study_timeout", "scale", "repetitions")})
    yield words(task.metrics)
    yield words(task.moments)
    if isinstance(task, Law):
        yield words((task.phenomenon, task.quantity, task.unit, task.needs))
        if (rows := task.commands()) is not None:
            yield words(rows)


def everything(tasks: Sequence[Task]) -> str:
    """Of each in full, small, by the study's rules, and of laws held out; each line once."""
    lines = []
    for task in tasks:
        versions = {"": task, "small": task.smoke(), "of the study": task.study()}
        if isinstance(task, Law) and (other := held_out(task)):
            versions["held out"] = other
        for name, each in versions.items():
            lines += [f"# {task.name} {name}", *told(each)]
    return "\n".join(dict.fromkeys(lines))


@pytest.mark.parametrize("phenomenon", sorted({law.phenomenon for law in LAWS}))
def test_laws(phenomenon: str) -> None:
    found = everything([law for law in LAWS if law.phenomenon == phenomenon])
    assert_approved(f"asked-{phenomenon.replace(' ', '-')}", found)


def test_tasks() -> None:
    assert_approved("asked-tasks", everything(TASKS))


def test_scenes_of_the_kit() -> None:
    robot = scenes.lifted(scenes.arm())
    made = (
        scenes.falling(), scenes.tower(), scenes.tumbling((0.1, 0.06, 0.04)), robot,
        scenes.at_random(robot, np.random.default_rng(1)), scenes.wedge(), faults.true_scene(),
        *(scene for scene, _ in faults.mechanisms(Capability)),
    )  # fmt: skip
    planted = faults.FAULTS.items(), *(f.items() for _, f in faults.mechanisms(Capability))
    told = [
        f"{name}: {fault.what}; {fault.quantity}; {fault.needs}; {fault.word}"
        for found in planted
        for name, fault in found
    ]
    assert_approved("asked-kit", "\n".join([*map(words, made), *told]))
