"""What a user's test asks for, and what is said of one that asks for nothing."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from textwrap import dedent

import pytest

from pytest_simbench.cli.asked import asked
from pytest_simbench.cli.values import BadInput
from pytest_simbench.experiment.case import PROTOCOLS, Case
from tests.approval import assert_approved_line

TESTS = """
    import pytest
    from tests.tiny import Falling

    @pytest.fixture
    def duration():
        return 0.4

    @pytest.mark.sim_timeout(7)
    def test_claims(repeat, threshold, duration):
        result = repeat(Falling(duration))
        assert result.records[0].profile == "tuned"
        result.assert_crashed_at_most(0.1)
        result.assert_at_least("landed", threshold("landed", 0.9))
        result.assert_between("ram", 1.0, 900.0)

    @pytest.mark.parametrize("duration", [0.3, 0.5], ids=["a", "b"])
    def test_ids(repeat, duration):
        assert repeat(Falling(duration)).values("landed") == [0.5], "not known"

    def test_nothing(sim_name):
        pass

    def test_two(repeat):
        repeat(Falling(0.3))
        repeat(Falling(0.4))

    def test_law(repeat):
        from pytest_simbench.laws import LAWS
        repeat(LAWS[0])

    def test_fails(repeat):
        raise ValueError("before it")

    @pytest.mark.skip(reason="not today")
    def test_skipped(repeat):
        pass

    @pytest.mark.needs("gpu")
    def test_needs(repeat):
        pass

    def test_lower(repeat):
        from pytest_simbench.tasks import Throwing
        assert repeat(Throwing()).values("landing_error") == [0.0]

    def test_scene(repeat, scene_file):
        repeat(scene_file("gone.xml"))
"""

OPTIONS = ("--sim-name=mujoco", "--sim-profile=tuned")


@pytest.fixture(autouse=True)
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.delitem(sys.modules, "test_mine", raising=False)
    Path("test_mine.py").write_text(dedent(TESTS))
    Path("pytest.ini").write_text("[pytest]\nsim_strict = true\nreps = 40\nsim_jobs = 2\n")


def test_the_task_the_case_and_the_claims(capfd: pytest.CaptureFixture[str]) -> None:
    found = asked("test_mine.py::test_claims", OPTIONS)
    case, task = found.experiment.case, found.experiment.task
    assert (case.timeout, case.profile, task.parameters()) == (7, "tuned", {"task.duration": 0.4})
    assert [f"{metric.name} {claim}" for metric, claim in found.claims] == [
        "landed at least 0.9", "ram at least 1", "ram at most 900",
    ]  # fmt: skip
    assert not found.failed
    assert capfd.readouterr() == ("", "")
    assert not Path(".simbench").exists()


def test_the_whole_case() -> None:
    options = """--sim-name=mujoco --sim-profile=real --sim-seed=7 --sim-jitter=0.5 --sim-fresh
        --sim-protocol=smoke --sim-stall-timeout=50 --sim-memory-limit=900 --sim-trace=on
        --sim-set=mujoco.cone=pyramidal --sim-timeout=8"""
    case = asked("test_mine.py::test_ids[b]", options.split()).experiment.case
    test = "test_mine.py::test_ids"
    assert replace(case, folder=Path()) == Case.of(
        "mujoco", profile="real", changes={"cone": "pyramidal"}, test=f"{test}[mujoco-headless-b]",
        function=test, variant="b", mode="headless", folder=Path(), protocol=PROTOCOLS["smoke"],
        timeout=8, stall_timeout=50.0, memory_limit=900.0, seed=7, jitter=0.5, trace="on",
        fresh=True,
    )  # fmt: skip
    case = asked("test_mine.py::test_ids[b]", [*OPTIONS, "--sim-record=mcap"]).experiment.case
    assert (case.trace, case.video, case.fresh, case.needs) == ("on", "off", False, ())


@pytest.mark.parametrize("ids", ["b", "mujoco-headless-b"])
def test_one_of_several_parameters(ids: str) -> None:
    found = asked(f"test_mine.py::test_ids[{ids}]", OPTIONS)
    assert found.experiment.task.parameters() == {"task.duration": 0.5}
    assert (found.claims, found.failed) == ((), "AssertionError: not known")


def test_what_is_better_the_lower_it_is_is_nought() -> None:
    assert asked("test_mine.py::test_lower", OPTIONS).failed == ""


ASKING_NOTHING = """test_mine.py::test_nothing test_mine.py::test_two test_mine.py::test_law
test_mine.py::test_fails test_mine.py::test_skipped test_mine.py::test_needs
test_mine.py::test_scene test_mine.py::test_ids test_mine.py::test_ids[c]
test_mine.py::test_gone gone.py::test_gone test_bad.py::test_it"""


@pytest.mark.parametrize("test", ASKING_NOTHING.split())
def test_what_asks_for_nothing(test: str, tmp_path: Path) -> None:
    Path("test_bad.py").write_text("import nothing_of_that_name")
    with pytest.raises(BadInput) as told:
        asked(test, OPTIONS)
    assert_approved_line("asked", f"{test}: {told.value}".replace(f"{tmp_path}", "DIR"))
