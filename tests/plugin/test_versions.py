"""Several versions of one simulator in one run: names, marks, settings, ids, records."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pytest_simbench.client.environments import MARKER, Environment
from pytest_simbench.plugin.selection import select
from pytest_simbench.simulator.registry import adapter
from tests.plugin.inner import records, run_pytest, wrapper


@pytest.fixture
def release(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The release that is installed here, in an environment of its own that is but a wrapper."""
    monkeypatch.setenv("SIMBENCH_ENVIRONMENTS", str(tmp_path / "environments"))
    name = f"mujoco=={adapter('mujoco').info.tested_version}"
    environment = Environment.of(adapter(name).info)
    wrapper(environment.python)
    told = {"requirements": list(environment.info.requirements)}
    (environment.folder / MARKER).write_text(json.dumps(told))
    return name


def test_versions_side_by_side(pytester: pytest.Pytester, release: str) -> None:
    wrapper(pytester.path / "mine" / "python")
    pytester.makepyfile(
        f"""
        import pytest
        from tests.tiny import Falling

        def test_falling(repeat):
            repeat(Falling())

        @pytest.mark.only_sim("mujoco")
        @pytest.mark.skip_sim("{release}", reason="this one not")
        def test_marked(sim_case):
            pass

        @pytest.mark.only_sim("mujoco@mine")
        def test_one(sim_case):
            pass
        """
    )
    result = run_pytest(
        pytester,
        f"--sim=mujoco,{release},mujoco@mine=mine/python --reps=2 --sim-output=out",
        *("--sim-set=mujoco.timestep=0.001", f"--sim-set={release}.timestep=0.004"),
        passed=6,
        skipped=1,
    )
    for name in ("mujoco", release, "mujoco@mine"):
        result.stdout.fnmatch_lines([f"{name} *"])  # of a table
    kept = records(pytester.path / "out")
    found = {(r["simulator"], r["settings"]["timestep"], r["seed"]) for r in kept}
    tests = {record["test"].partition("::")[2] for record in kept}
    assert tests == {f"test_falling[{name}-headless]" for name, _, _ in found}
    steps = {"mujoco": 0.001, release: 0.004, "mujoco@mine": 0.001}
    assert found == {(name, step, seed) for name, step in steps.items() for seed in (10001, 10002)}


def test_a_build_without_a_label_is_called_by_its_version(
    pytester: pytest.Pytester, release: str
) -> None:
    python = wrapper(pytester.path / "mine" / "python")
    selection = select(pytester.parseconfig(f"--sim=mujoco@{python}"))
    name = release.replace("==", "@")
    assert selection.simulators == (name,)
    assert selection.pythons == {name: str(python)}
