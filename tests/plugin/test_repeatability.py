"""`replay`, `perturb` and `simulator.episode` as users type them."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import create_autospec

import numpy as np
import pytest

from pytest_simbench.client.display import Displays
from pytest_simbench.client.errors import DisplayError
from pytest_simbench.experiment.case import PROTOCOLS, Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.plugin import repeatability
from pytest_simbench.plugin.repeatability import Perturber
from pytest_simbench.records.repeatability import NAME, Line
from pytest_simbench.repeatability import search, stability
from pytest_simbench.repeatability.agreement import Sample
from pytest_simbench.repeatability.perturbation import Perturbation
from pytest_simbench.simulator.registry import adapter
from tests.cli.command import simbench
from tests.plugin.inner import distribution, importable, run_pytest
from tests.tiny import Falling

drawn = pytest.mark.usefixtures("drawn")

TEST = """
    from pytest_simbench.tasks import Moment
    from pytest_simbench.tasks import LeaningTowers
    from tests.repeatability.conftest import Tumbling

    def test_again(replay):
        result = replay(Tumbling(), moments=(Moment("in flight", "fly"),))
        result.assert_as_claimed()

    def test_push(perturb):
        towers = perturb(LeaningTowers())
        assert len(towers.task.margins) == 1  # the smoke version
        gentle = towers.stability({"x": 0.001}, examples=20)
        gentle.assert_kept_at_least(0.9)
        assert len(gentle.kept) == 5  # of the smoke protocol too
        towers.search({"x": 0.012}, shrinks=10, at_once=1).assert_found()
        towers.sensitivity("cube_01").assert_below(10.0, until=1.0)
"""


@drawn
@pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["one process", "xdist"])
def test_results_tables_and_files(pytester: pytest.Pytester, workers: tuple[str, ...]) -> None:
    pytester.makepyfile(TEST)
    result = run_pytest(
        pytester, "--sim=mujoco,pybullet --protocol=smoke --sim-output=out", *workers, passed=4
    )
    out = pytester.path / "out"
    lines = [json.loads(text) for text in (out / "repeatability.jsonl").read_text().splitlines()]
    kinds = sorted((line["simulator"], line["kind"]) for line in lines)
    assert kinds == [
        (name, kind)
        for name in ("mujoco", "pybullet")
        for kind in ("replay", "search", "sensitivity", "stability")
    ]
    assert all(line["settings"]["timestep"] > 0 for line in lines)
    assert all(line["versions"] for line in lines)
    text = result.stdout.str()
    assert text.count("= repeatability =") == 1
    for part in (
        "Replay: tumbling, seed 10001",
        "topples tower 1",
        "Agreement: tumbling, seed 10001, test_again",
    ):
        assert part in text
    assert "# Repeatability" in (out / "repeatability.md").read_text()


NOISY = """
from dataclasses import replace
from tests.repeatability import wrong

class Noisy(wrong.Noisy):
    info = replace(wrong.Noisy.info, name="noisy")
"""


@drawn
def test_a_broken_claim_fails_the_test(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = "noisy = noisy_simbench:Noisy"
    importable(monkeypatch, distribution(pytester.path / "site", "noisy-simbench", entry, NOISY))
    pytester.makepyfile(TEST)
    result = run_pytest(
        pytester, "--sim=noisy --protocol=smoke --sim-output=out -k again", failed=1
    )
    result.stdout.fnmatch_lines(
        [
            "*noisy claims to be deterministic, but*",
            "*after a reset: first differs at t = 0.02 s*",
            "*Replay: tumbling, seed 10001, growth*",
        ]
    )


@drawn
def test_a_failing_example_shrinks_and_tells_how_to_replay(pytester: pytest.Pytester) -> None:
    """No health check is silenced, a crash is a failing example, the worker is reused, and the
    line that is printed replays the smallest example."""
    pytester.makepyfile(
        """
        import os, signal
        from hypothesis import given, settings, strategies as st
        from pytest_simbench.scene import Pose, Scene
        from pytest_simbench.tasks.base import cube

        @settings(settings.get_profile("sim-dev"), max_examples=30, derandomize=True)
        @given(height=st.integers(10, 100))
        def test_falls(simulator, sim_name, sim_mode, height):
            body = cube("a", Pose.at(0, 0, height / 100), (1, 1, 1, 1))
            with simulator.episode(Scene("s", (body,))) as world:
                world.wait(0.1)
                if height >= 42:
                    os.kill(world.process.pid, signal.SIGSEGV)
                world.wait(0.1)
        """
    )
    result = run_pytest(pytester, "--sim=mujoco --sim-output=out", failed=1)
    text = result.stdout.str()
    assert "WorkerExited: the worker was killed by SIGSEGV" in text
    assert "height=42" in text
    assert "HealthCheck" not in text
    (example,) = (pytester.path / "out" / "examples").iterdir()
    command = f"simbench replay out/examples/{example.name}"
    assert f"replay this episode: {command}" in text
    replayed = simbench(pytester, *command.split()[1:])
    assert replayed.ret == 0
    replayed.stdout.fnmatch_lines(["mujoco headless tuned, t = 0.200 s", "  a: 0.0000 0.0000 0.2*"])


@dataclass(frozen=True)
class Result:
    """What was asked for, in place of what came of it."""

    asked: Any
    strict: bool = False
    first: str = "the first run"

    def to_wire(self) -> dict[str, Any]:
        return {"sentence": f"{self.asked}, {self.strict}"}


def world(tmp_path: Path, mode: str = "gui", **more: Any) -> tuple[Case, Any]:
    """A case, and its episodes that nobody runs."""
    case = Case("a.py::test_x[mujoco]", "mujoco", mode, "tuned", "a:B", tmp_path, seed=7, **more)
    constructed = SimpleNamespace(settings={"timestep": 0.1}, versions={"numpy": "2"})
    experiment = Experiment(case, Falling())
    handle = SimpleNamespace(constructed=constructed)
    return case, SimpleNamespace(experiment=experiment, handle=handle, task=Falling())


def line(kind: Any, case: Case, result: Any) -> Line:
    settings = {"timestep": 0.1, "task.duration": 0.6}
    of = case.test, "mujoco", case.mode, "tuned", "falling", 7
    return Line(kind, *of, settings, {"numpy": "2"}, result)


@pytest.mark.parametrize(("protocol", "most"), [("fast", None), ("smoke", 5)])
def test_what_perturb_asks_for_and_keeps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, protocol: str, most: int | None
) -> None:
    case, episodes = world(tmp_path, protocol=PROTOCOLS[protocol])
    for module, name in ((search, "search"), (stability, "stability"), (stability, "sensitivity")):
        monkeypatch.setattr(module, name, lambda of, *given, **more: Result((*given, more)))
    monkeypatch.setattr(search, "to_wire", Result.to_wire)
    perturber = Perturber(episodes, strict=True)
    assert perturber.task == Falling()
    every = [
        perturber.search({"x": 0.1}, shrinks=3),
        perturber.stability({"x": 0.1}, examples=20),
        perturber.stability(),
        perturber.stability(examples=2),
        perturber.sensitivity("left", 3, moments=()),
    ]
    assert every == [
        Result(({"x": 0.1}, {"shrinks": 3})),
        Result(({"x": 0.1}, {"examples": most or 20}), strict=True),
        Result((None, {"examples": most} if most else {}), strict=True),
        Result((None, {"examples": 2}), strict=True),
        Result((Perturbation("x", 3, "left"), {"moments": ()})),
    ]
    kinds = "search", *("stability",) * 3, "sensitivity"
    kept = [json.loads(text) for text in (tmp_path / NAME).read_text().splitlines()]
    assert kept == [
        {"schema": 1, **vars(line(kind, case, result.to_wire()))}
        for kind, result in zip(kinds, every, strict=True)
    ]


class Handle:
    """In place of a simulator's."""

    def __init__(self, case: Case) -> None:
        self.case, self.closed = case, False
        self.constructed = SimpleNamespace(settings={"timestep": 0.1}, versions={"numpy": "2"})

    def close(self) -> None:
        self.closed = True


@pytest.mark.parametrize(
    ("mode", "display"), [("gui", True), ("headless", True), ("headless", False)]
)
def test_what_replay_asks_for_and_keeps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: str, display: bool
) -> None:
    case, episodes = world(
        tmp_path, mode, function="a.py::test_x", variant="v",
        own_timestep=0.002, changes={"timestep": 0.001},
    )  # fmt: skip
    displays = create_autospec(Displays, instance=True)
    displays.environment.side_effect = None if display else DisplayError("there is no display")
    saved: list[Any] = []
    sample = Sample("", "", 0, (), {}, (), np.zeros((0, 1)))
    monkeypatch.setattr(repeatability, "SimulatorHandle", Handle)
    monkeypatch.setattr(
        repeatability,
        "Episodes",
        lambda of, handle: SimpleNamespace(experiment=of, handle=handle, task=of.task),
    )
    monkeypatch.setattr(repeatability, "replay", lambda of, **more: Result({"of": of, **more}))
    monkeypatch.setattr(Sample, "of", lambda *told: saved.append(told) or sample)
    monkeypatch.setattr(Sample, "save", lambda *told: saved.append(told))
    asked = repeatability.replayed(episodes.experiment, displays, 3, moments=()).asked
    of, fresh, other = asked.pop("of"), asked.pop("fresh"), asked.pop("other_mode")
    info = adapter("mujoco").info
    assert asked == {"capabilities": info.capabilities, "jobs": 3, "moments": ()}
    assert (of.handle.case, fresh.case, of.handle is fresh) == (case, case, False)
    if mode == "gui":
        assert other.case == replace(case, mode="headless", display=None)
    elif display:
        assert other.case == replace(case, mode="gui", display=displays)
    else:
        assert other == "there is no display"
    assert all(one.closed for one in (of.handle, fresh, other) if one != "there is no display")
    named = replace(sample, test="test_x, v, 1ms", parameters='{"task.duration": 0.6}')
    assert saved.pop() == (named, tmp_path, "motions/test_x_mujoco-3e3e85c6d4.npz")
    assert saved == [("the first run", f"mujoco {mode} tuned", "falling", 7)]
    (kept,) = map(json.loads, (tmp_path / NAME).read_text().splitlines())
    assert kept["kind"] == "replay"
    assert repeatability._other_mode(case, (mode,), displays) == "mujoco has no window"
