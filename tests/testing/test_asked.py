"""What each check of the kit builds, commands, measures and allows, as approved: each is asked of a
made-up world, which no check passes. That checks find what is wrong, `test_checks` shows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import permutations
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo

import pytest_simbench.testing as kit
from pytest_simbench.client.motion import Motion
from pytest_simbench.ground.names import data_digest
from pytest_simbench.scene import FloatArray, Pose, Scene, Trajectory
from pytest_simbench.tasks.on_scene import OnScene
from pytest_simbench.testing import CHECKS, Subject
from tests.approval import assert_approved
from tests.made_up_world import MadeUp

LEFT_OUT = """
    fresh_processes_agree imports_without_engine planted_faults_are_seen
    read_back_is_the_engines reading_changes_nothing reused_process_agrees thrown_cube_flies_free
    time_advances unknown_setting_rejected window_changes_nothing worlds_leave_no_memory
"""
"""They look at processes, files, throws or steps."""


class Told:
    """Lines, and numbers that a check asked for again and again, as their sums."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.sums: dict[str, FloatArray] = {}

    def require(self, holds: object, message: str) -> None:
        self.lines.append(f"{'holds' if holds else 'fails'}: {message}")

    def require_close(
        self, what: str, value: float, expected: float, tolerance: float, unit: str
    ) -> None:
        key = f"{what} [{unit}]"
        now = np.array([1.0, value, expected, tolerance])
        self.sums[key] = self.sums.get(key, np.zeros(4)) + now

    def text(self) -> str:
        counted = Counter(self.lines)
        lines = [line + (f" ({n} times)" if n > 1 else "") for line, n in counted.items()]
        for key, (n, *numbers) in self.sums.items():
            value, expected, tolerance = (f"{number / n + 0.0:.6g}" for number in numbers)
            line = f"{key}: {value} for {expected} within {tolerance}"
            lines.append(line + (f" (means of {n:g})" if n > 1 else ""))
        return "\n".join(lines)


class Asked(MadeUp):
    """Keeps what it is built of and told to do."""

    def __init__(self, scene: Scene, told: Told) -> None:
        super().__init__(scene)
        self.told = told
        digest = OnScene.parameters(Mock(world=scene, starts=()))["task.scene_digest"]
        told.lines.append(f"{scene.name} {digest[:6]}")

    def wait(self, duration: float, *, log_period: float | None = None) -> Motion:
        self.told.lines.append(f"waits {duration:.6g} s, looks each {log_period}")
        return super().wait(duration)

    def follow(self, rows: Trajectory, *, log_period: float | None = None) -> Motion:
        values = {name: np.asarray(value).tolist() for name, value in vars(rows).items()}
        self.told.lines.append(f"follows {len(rows.position)} rows {data_digest(values, 6)}")
        return super().follow(rows, log_period=log_period or 0.0)

    def save(self) -> None:
        self.told.lines.append("saves")

    def restore(self) -> None:
        self.told.lines.append("restores")

    def contact_count(self) -> int:
        return len(self.scene.bodies)

    def poses(self) -> dict[str, Pose]:
        return {
            body.name: Pose(row[:3], row[3:7])
            for body, row in zip(self.scene.free_bodies, self.bodies, strict=True)
        }

    def pose(self, name: str) -> Pose:
        return self.poses()[name]

    def contact_forces(self) -> dict[tuple[str, str], FloatArray]:
        """Of all pairs, both ways."""
        names = ["ground", *(f"body/{body.name}" for body in self.scene.free_bodies)]
        force = np.array([1.0, 2.0, 30.0 + self.time, 4.0, 5.0, 6.0])
        return {pair: force * k for k, pair in enumerate(permutations(names, 2), 1)}

    def render(self, width: int, height: int) -> FloatArray:
        return np.zeros((height, width, 3))


@dataclass(frozen=True)
class Questioned(Subject):
    told: Told = field(default_factory=Told)

    @contextmanager
    def world(self, scene: Scene, **options: Any) -> Iterator[Any]:
        self.told.lines.append(f"a world {options}" if options else "a world")
        yield Asked(scene, self.told)


UNABLE = type("Unable", (MuJoCo,), {"info": replace(MuJoCo.info, capabilities=frozenset())})
"""It can only what every engine can."""

ANOTHER = "moves_as_prescribed parity_of_full_scene parity_where_links_collide"
"""Checks that ask it something else."""


def test_checks_ask_this() -> None:
    texts = []
    asked = [(MuJoCo, name) for name in CHECKS if name not in LEFT_OUT.split()]
    for cls, name in [*asked, *((UNABLE, name) for name in ANOTHER.split())]:
        subject = Questioned(cls)
        with pytest.MonkeyPatch.context() as patch:
            for module in vars(kit).values():
                for function in ("require", "require_close"):
                    if hasattr(module, function):
                        patch.setattr(module, function, getattr(subject.told, function))
            CHECKS[name].law(subject)
        texts.append(f"{name}{'' if cls is MuJoCo else ', unable'}\n{subject.told.text()}\n")
    assert_approved("kit", "\n".join(texts))
