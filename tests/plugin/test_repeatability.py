"""`replay`, `perturb` and `simulator.episode` as users type them."""

from __future__ import annotations

import json

import pytest

from tests.cli.command import simbench
from tests.plugin.inner import distribution, importable, run_pytest

pytestmark = pytest.mark.usefixtures("drawn")

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
