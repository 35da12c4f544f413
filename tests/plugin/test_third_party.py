"""A simulator from another package runs all suites without a change in this one."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.laws import LAWS
from tests.cli.command import simbench
from tests.plugin.inner import distribution, importable, records

ADAPTER = '''
"""A third party's simulator: MuJoCo with a coarser step, under its own name."""

from dataclasses import replace

from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.sims.mujoco.settings import MuJoCoSettings


class Elsewhere(MuJoCo):
    info = replace(MuJoCo.info, name="elsewhere", title="Elsewhere")
    profiles = {
        "default": MuJoCoSettings(),
        "tuned": replace(MuJoCo.profiles["tuned"], timestep=0.002, solref=(0.004, 1.0)),
    }
'''


def test_third_party_simulator_runs_all_suites(
    pytester: pytest.Pytester, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = "elsewhere = elsewhere_simbench:Elsewhere"
    importable(
        monkeypatch, distribution(pytester.path / "site", "elsewhere-simbench", entry, ADAPTER)
    )
    suites = Path(request.config.rootpath, "suites")
    output = pytester.path / "out"
    monkeypatch.delenv("SIMBENCH_DATA", raising=False)
    result = pytester.runpytest_subprocess(
        str(suites), "--sim=elsewhere", "--protocol=smoke", f"--sim-output={output}",
        "-k", "not test_law or free_fall",
    )  # fmt: skip
    result.assert_outcomes(passed=9, skipped=17, deselected=len(LAWS) - 1)  # no data, no files
    kept = records(output)
    assert [(r["simulator"], r["task"], r["status"]) for r in kept] == [
        ("elsewhere", "free_fall", "ok"),
        ("elsewhere", "pushing", "ok"),
        ("elsewhere", "pushing_curve", "ok"),
        ("elsewhere", "stacking", "ok"),
        ("elsewhere", "throwing", "ok"),
    ]
    assert {r["settings"]["timestep"] for r in kept} == {0.002}
    assert "elsewhere: Elsewhere" in simbench(pytester, "list", "-v").stdout.str()
