"""Several versions of one simulator: names, marks, settings, ids and records of a run. A regression
planted in one release: seen in the history, found by the bisection, stopped by the gate."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pytest_simbench.plugin.selection import select
from tests.cli.command import simbench
from tests.cluster.machines import release_in
from tests.plugin.inner import FALLING, records, run_pytest, usage_error, wrapper
from tests.plugin.planted import plant


@pytest.fixture
def release(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The release that is installed here, in an environment of its own that is but a wrapper."""
    monkeypatch.setenv("SIMBENCH_ENVIRONMENTS", str(tmp_path / "environments"))
    return release_in(tmp_path / "environments")


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
    python = wrapper(pytester.path / "mujoco==1.2" / "python")
    selection = select(pytester.parseconfig(f"--sim=mujoco@{python}"))
    name = release.replace("==", "@")
    assert selection.simulators == (name,)
    assert selection.pythons == {name: str(python)}


@pytest.fixture
def planted(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    plant(pytester, monkeypatch)


@pytest.mark.usefixtures("planted", "drawn")
def test_history_bisection_and_gate(pytester: pytest.Pytester) -> None:
    result = run_pytest(pytester, "--sim-history=planted:4 --reps=5", passed=4)
    result.stdout.fnmatch_lines(
        ["planted, falling (headless tuned), 4 releases, 1.2 to 1.5:",
         "  landed fell with 1.3: 100 % -> 0 %, p = *"]
    )  # fmt: skip
    (folder,) = (pytester.path / ".simbench" / "history").iterdir()
    assert len(records(folder)) == 20
    assert list(folder.glob("planted_falling_history*.png"))

    result = simbench(  # what the history has recorded is not run again
        pytester, "bisect", "planted:1.2..1.5", "landed", "--reps=5", "test_planted.py"
    )
    assert result.ret == 0
    result.stdout.fnmatch_lines(
        ["bisecting 4 releases of planted: 2 steps, and the ends",
         "1.3 landed 0 %: worse",
         "the first worse release is 1.3: 1.2 landed 100 %, 1.3 landed 0 % (p = 0.03*)",
         f"results: {folder}"]
    )  # fmt: skip
    assert len(records(folder)) == 20

    result = run_pytest(
        pytester,
        "--sim=planted==1.2,planted==1.3 --sim-baseline=planted==1.2 --reps=5",
        *("--sim-compare-fail=landed:5%", f"--sim-resume={folder}"),
        ret=1,
        passed=2,
    )
    result.stdout.fnmatch_lines(
        ["baseline: planted==1.2 in this run",
         '  versions.planted-engine was "1.2", is "1.3"',
         "FAILED *[[]planted==1.3-headless[]]: landed fell from 100 % to 0 %"]
    )  # fmt: skip


@pytest.mark.usefixtures("planted")
def test_a_bisection_tells_of_the_test_that_ran_now(pytester: pytest.Pytester) -> None:
    other = f"{FALLING}def test_other(repeat):\n    repeat(Falling(0.5))\n"
    good = "1.2 landed 100 %, 1.3 landed 0 %: *"
    for code, metric, told in (
        (FALLING, "landed", good),
        (other, "landed", good),  # which lies beside the first
        (other, "cpu_cost", "1.2 cpu_cost *, 1.3 cpu_cost *"),
        (other.replace("0.5", "0.4"), "landed", "*duration was 0.5, is 0.4; remove *"),
        (other.replace("(Falling(0", "(fall(0"), "landed", "*run on planted==1.2 (NameError: *"),
    ):
        pytester.makepyfile(test_planted=code)
        words = ("planted:1.2..1.3", metric, "--reps=2", "test_planted.py")
        chosen = ("-k", "other") if code != FALLING else ()
        result = simbench(pytester, "bisect", *words, *chosen)
        (result.stdout if told[0] == "1" else result.stderr).fnmatch_lines([told])


@pytest.mark.usefixtures("planted")
def test_a_worker_with_another_release_than_its_name_says(pytester: pytest.Pytester) -> None:
    other = pytester.path / "environments" / "planted==1.4" / "bin" / "python"
    result = run_pytest(
        pytester, f"--sim=planted==1.2 --sim-spec=planted==1.2=popen//python={other} --reps=1"
    )
    result.stdout.fnmatch_lines(["CRASHED falling, planted==1.2 *: 1 x WorkerStartError in *"])
    (record,) = pytester.path.glob(".simbench/*/records.jsonl")
    assert json.loads(record.read_text())["error"]["message"] == (
        "planted==1.2 was asked for, and the worker's interpreter has planted-engine 1.4; name one "
        "that has 1.2, or write planted@PYTHON to call it by what it has"
    )


@pytest.mark.usefixtures("planted")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--sim-bisect", "planted:1.0..1.9", "landed"],
            "simbench bisect: the package index has no planted-engine 1.9 for Python *",
        ),
        (["--sim=planted==1.2", "--sim-baseline=planted==1.2"], "*no other version of planted*"),
        (["--sim-history=ode:3"], "--sim-history: ode comes with packages of the system*"),
    ],
)
def test_wrong_input_is_one_sentence(
    pytester: pytest.Pytester, arguments: list[str], message: str
) -> None:
    result = run_pytest(pytester, "", *arguments)
    usage_error(result, f"ERROR: *{message}")
