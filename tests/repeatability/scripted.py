"""Experiments whose every run is written down: what repeatability makes of them is known by hand.

`Scripted` stands where an `Experiment` stands. A run gives what a function says of the
perturbations; no simulator runs. This calibrates the instrument; it is no simulator.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from pytest_simbench.client.answers import Constructed
from pytest_simbench.client.errors import Where, WorkerError, WorkerExited
from pytest_simbench.client.motion import Motion
from pytest_simbench.client.tape import Operation, Tape
from pytest_simbench.records.metrics import Metric
from pytest_simbench.repeatability.episode import Episode
from pytest_simbench.repeatability.perturbation import Perturbation
from pytest_simbench.scene import Box, FloatArray, Pose, Scene
from pytest_simbench.tasks import LeaningTowers
from pytest_simbench.tasks.base import Outcome

METRICS = (
    Metric("standing", "standing", kind="share", of=4),
    Metric("lost", "lost", kind="yes_no", better="lower"),
    Metric("height", "height", unit="m"),
)
NAMES = ("a", "b")


def motion(times: Sequence[float], *ways: Sequence[float]) -> Motion:
    """Cubes that stand at these x [m] at these times [s]; no joints, no velocity told."""
    bodies = np.zeros((len(times), len(ways), 13))
    bodies[:, :, 3] = 1.0
    for cube, way in enumerate(ways):
        bodies[:, cube, 0] = way
    return Motion(np.array(times, dtype=float), np.zeros((len(times), 2, 0)), bodies)


def operation(kind: str, phase: str, duration: float, goal: FloatArray | None = None) -> Operation:
    """A wait, or a motion to a set point."""
    if kind == "wait":
        return Operation("wait", {"duration": duration}, phase)
    rows = np.zeros((2, 1)) if goal is None else np.array([0 * goal, goal])
    return Operation(
        "follow",
        {"tick": duration, "position": rows, "velocity": rows, "effort": rows},
        phase,
    )


def episode(
    metrics: dict[str, float | None],
    motions: Sequence[Motion],
    tape: Tape = (),
    details: dict[str, Any] | None = None,
) -> Episode:
    counts = {m.name: metrics.get(m.name) for m in METRICS if m.bounded}
    return Episode(Outcome(metrics, details or {}), counts, tape, motions, NAMES, None)


class Toppling:
    """The task: it says what toppled, where its outcome tells."""

    name = "scripted"
    metrics = METRICS
    moments = ()
    parameters = staticmethod(dict)

    def change(self, before: Outcome, after: Outcome) -> str:
        known = "toppled" in before.details
        return LeaningTowers().change(before, after) if known else ""


class Scripted:
    """An experiment of two cubes.

    Args:
        run: the episode of a run with these perturbations.

    Attributes:
        asked: perturbations and tape of every run.
    """

    def __init__(self, run: Callable[[tuple[Perturbation, ...]], Episode]) -> None:
        self._run = run
        self.asked: list[tuple[tuple[Perturbation, ...], Any]] = []
        case = SimpleNamespace(simulator="sim", mode="headless")
        self.handle = SimpleNamespace(case=case, tape=(), constructed=Constructed())
        self.task = Toppling()

    def scene(self) -> Scene:
        cubes = (Box(n, (0.05,) * 3, Pose.at(0.5 * k, 0, 0.025), 0.1) for k, n in enumerate(NAMES))
        return Scene("scripted", tuple(cubes))

    def run(self, perturbations: Sequence[Perturbation] = (), *, play: Any = None) -> Episode:
        self.asked.append((tuple(perturbations), play))
        return self._run(tuple(perturbations))


ALL = {"standing": 1.0, "lost": 0.0, "height": 0.3}
Perturbed = tuple[Perturbation, ...]


def shift(perturbed: Perturbed) -> float:
    """Displacement of cube a in x [m]."""
    return sum(p.amount for p in perturbed if p.quantity == "x" and p.body == "a")


def moved(x: float, metrics: dict[str, float | None] = ALL, **details: object) -> Episode:
    """Cube a starts `x` farther than 0.1 and goes 0.2 + 3 x; cube b stays."""
    motions = [motion([0.0], [0.1 + x], [0.5]), motion([0.5, 1.0], [0.2, 0.3 + 4 * x], [0.5, 0.5])]
    return episode(metrics, motions, [operation("wait", "fall", 1.0)], details)


def dead(perturbed: Perturbed) -> WorkerError:
    return WorkerExited("it is gone", Where("sim", "headless"))


def toppling(perturbed: Perturbed) -> Episode:
    """Beyond 0.5 mm one of four falls, beyond 0.8 mm another."""
    x = abs(shift(perturbed))
    fallen = ["one"] * (x > 4.5e-4) + ["two"] * (x > 7.5e-4)
    return moved(shift(perturbed), {**ALL, "standing": 1 - len(fallen) / 4}, toppled=fallen)
