"""One run of an experiment, in a world that writes down what reaches it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

from pytest_simbench.repeatability.episode import Episode, Episodes, changed
from pytest_simbench.repeatability.perturbation import Perturbation, perturbed
from pytest_simbench.scene import Scene
from pytest_simbench.tasks.base import Outcome
from tests.repeatability.scripted import METRICS, Scripted, moved, operation

WORLD = SimpleNamespace(tape=["done"], motions=["sampled"], left_at=1.5)


class Handle:
    def __init__(self) -> None:
        self.asked: list[Any] = []

    @contextmanager
    def episode(self, scene: Scene, **options: Any) -> Iterator[Any]:
        self.asked.append((scene, options))
        yield WORLD


def test_what_is_asked_of_a_run_reaches_its_world() -> None:
    scene, outcome = Scripted(lambda p: moved(0.0)).scene(), Outcome({"standing": 0.5, "height": 2})
    performed: list[Any] = []

    def perform(world: Any, seed: int, count: Any) -> Outcome:
        performed.append((world, seed, count(1, 2)))
        return outcome

    task = SimpleNamespace(metrics=METRICS, perform=perform)
    experiment = SimpleNamespace(task=task, seed=lambda: 7, scene={7: scene}.get)
    own, other, tape = Handle(), Handle(), [operation("wait", "fall", 1.0)]
    episodes: Any = Episodes(experiment, own)  # type: ignore[arg-type]
    shifted, told = Perturbation("x", 3, "a"), {"play": tape, "before": print}
    found = episodes.run([shifted, Perturbation("delay", 4)], **told, handle=other)
    counts = {"standing": 0.5, "lost": None}
    assert found == Episode(outcome, counts, WORLD.tape, WORLD.motions, ["a", "b"], 1.5)
    options = {"period": 0.02, **told, "delay": 0.004}
    assert (other.asked, own.asked) == ([(perturbed(scene, [shifted]), options)], [])
    episodes.run()
    assert own.asked == [(scene, {"period": 0.02, "play": None, "before": None, "delay": 0})]
    assert performed == [(WORLD, 7, None)] * 2


def test_what_counts_as_changed() -> None:
    assert changed({"a": 1.0, "b": None, "c": 0.5}, {"a": 1.0, "b": 0.0}) == ["b", "c"]
