"""The comparison with a baseline, as users run it: what fails, what passes, what it says."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from textwrap import dedent
from xml.etree import ElementTree

import pytest

import pytest_simbench.tasks  # noqa: F401 - pytester would import native modules a second time
from pytest_simbench.plugin.compare import _name, prepare
from pytest_simbench.records.baseline import read_baseline
from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.folder import RunContents
from tests.plugin.conftest import Configure
from tests.plugin.inner import NOTHING_LANDS, run_before, run_pytest
from tests.report.samples import STACKING, record

TEST = """
    import os
    from tests.tiny import Falling

    def test_falling(repeat):
        repeat(Falling(duration=float(os.environ.get("DURATION", "0.6"))))
"""
ARGUMENTS = "--sim=mujoco --reps=5"
WORSE = "FAILED test_falling[mujoco-headless]: landed fell from 100 % to 0 % (worse by"


@pytest.fixture(scope="module")
def saved(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Path]:
    """A folder with a run whose cubes land, saved in every form that a baseline may have."""
    words = f"{ARGUMENTS} --sim-output=base --benchmark-json=base.json --benchmark-autosave"
    with run_before(request, tmp_path_factory, TEST, words) as folder:
        yield folder


@pytest.fixture
def baseline(pytester: pytest.Pytester, saved: Path) -> Path:
    """The folder of the inner pytest, with that run in it."""
    shutil.copytree(saved, pytester.path, dirs_exist_ok=True)
    return pytester.path


@pytest.mark.parametrize("limits", [(), ("--sim-compare-fail=ram:5%",)])
def test_versions_of_a_run_are_compared_with_one_of_them(
    configure: Configure, limits: tuple[str, ...]
) -> None:
    names = ["ode", "mujoco==1.0", "mujoco", "mujoco==2.0"]
    found = prepare(configure("--sim-baseline=mujoco", *limits), [], names)
    assert found is not None
    assert (found.baseline, found.typed) == (RunContents("mujoco in this run"), bool(limits))
    assert (found.beside, len(found.limits)) == (("mujoco", [names[1], names[3]]), len(limits))
    of = [(name, k) for name in names for k in range(1, 7)]
    worse = {"mujoco==2.0": 0.1}
    run = [record(who, k, metrics={"placed": worse.get(who, 0.9) + k / 1000}) for who, k in of]
    found.make(RunContents("now", tuple(run), {"stacking": TaskDescription("stacking", STACKING)}))
    told = [line.split()[:6] for line in found.text(120).splitlines() if " placed " in line]
    assert told == [
        [f"test_stacking[{name}-headless]", "placed", "90.35", "%", now, "%"]
        for name, now in (("mujoco==1.0", "90.35"), ("mujoco==2.0", "10.35"))
    ]
    with pytest.raises(pytest.UsageError, match="no other version of ode"):
        prepare(configure("--sim-baseline=ode"), [], names)
    assert prepare(configure(), [], names) is None


@pytest.mark.parametrize(
    "form",
    [
        ["--sim-baseline=base.json"],
        ["--benchmark-compare"],
        ["--sim-baseline=base/records.jsonl", "-n2"],
    ],
    ids=["benchmark-json", "benchmark-compare", "xdist"],
)
def test_a_worse_run_fails_with_one_sentence(
    pytester: pytest.Pytester, baseline: Path, monkeypatch: pytest.MonkeyPatch, form: list[str]
) -> None:
    summary = baseline / "summary.md"
    summary.write_text("before\n")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    monkeypatch.setenv("DURATION", "0.05")  # the cubes are still in the air
    result = run_pytest(
        pytester,
        f"{ARGUMENTS} --sim-output=now --sim-compare-fail=landed:5% --sim-badge=badge.json",
        *form,
        ret=1,
        passed=1,
    )
    assert json.loads((baseline / "badge.json").read_text())["color"] == "red"
    output = result.stdout.str()
    assert output.count(WORSE) == 1
    settings = output.index("settings.task.duration was 0.6, is 0.05")
    assert output.index("landed fell") < settings < output.rindex("landed fell")
    written = summary.read_text()
    assert written.startswith("before\n## Compared with ")
    assert "- FAILED test\\_falling\\[mujoco-headless\\]: landed fell from 100 % to 0 %" in written
    assert "| test\\_falling\\[mujoco-headless\\] | landed | 100 % | 0 % |" in written
    assert written.count("## falling: 5 repetitions") == 1


def test_a_regression_that_pytest_benchmark_raises_hides_nothing(
    pytester: pytest.Pytester, baseline: Path
) -> None:
    (faster,) = baseline.glob(".benchmarks/*/*.json")
    faster.write_text(re.sub(r'"min": [^,]*', '"min": 1e-9', faster.read_text()))
    words = f"{ARGUMENTS} --sim-output=now --benchmark-compare --benchmark-compare-fail=min:1%"
    result = pytester.runpytest_subprocess(*words.split())
    output = result.stdout.str()
    assert "Performance has regressed" in result.stderr.str()
    assert output.index("comparison with the baseline") < output.index("report: now/report.html")
    assert (baseline / "now" / "outcome.json").is_file()


def test_a_first_task_that_never_finishes_hides_no_other_one(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("""
        from tests.tiny import Falling

        class Endless(Falling):
            study_timeout = 1.0

        def test_both(repeat):
            repeat(Endless(1e6)), repeat(Falling())
    """)
    words = "--sim=mujoco --reps=1 --benchmark-json=b.json"
    run_pytest(pytester, words, failed=1)
    saved = pytester.path / "b.json"
    (rounds,) = json.loads(saved.read_text())["benchmarks"]
    assert (rounds["stats"]["rounds"], rounds["extra_info"]["metrics"]) == (1, {"landed": [1.0]})
    assert [record.status for record in read_baseline(saved).records] == ["failed", "ok"]


def test_the_same_again_passes_and_says_so(pytester: pytest.Pytester, baseline: Path) -> None:
    result = run_pytest(
        pytester,
        f"{ARGUMENTS} --sim-baseline=base --sim-compare-fail=landed:0%",
        ret=0,
    )
    result.stdout.fnmatch_lines(["no metric got worse beyond its limit"])


def test_limits_in_the_ini_file_wait_for_a_baseline_which_alone_fails_nothing(
    pytester: pytest.Pytester, baseline: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DURATION", "0.05")
    monkeypatch.setenv("COLUMNS", "160")  # no table is cut
    result = run_pytest(pytester, f"{ARGUMENTS} --sim-baseline=base", ret=0)
    result.stdout.fnmatch_lines(["test_falling*landed*100 %*0 %*"])
    assert "got worse" not in result.stdout.str()
    pytester.makeini("[pytest]\nsim_compare_fail = landed:5%\n")
    run_pytest(pytester, ARGUMENTS, ret=0)
    run_pytest(pytester, f"{ARGUMENTS} --sim-baseline=base", ret=1)


def test_a_limit_of_another_package_s_share_that_nothing_can_exceed_fails_the_run(
    pytester: pytest.Pytester, baseline: Path
) -> None:
    """A run of before descriptions were kept: that `landed` is a share is known only when its
    task has run. Else it is known before."""
    result = run_pytest(
        pytester,
        f"{ARGUMENTS} --sim-baseline=base --sim-compare-fail=landed:5",
        ret=pytest.ExitCode.USAGE_ERROR,
    )
    result.stderr.fnmatch_lines(["*landed:5 can never be exceeded: landed lies between 0*"])
    (baseline / "base/tasks.jsonl").unlink()
    result = run_pytest(
        pytester, f"{ARGUMENTS} --sim-baseline=base --sim-compare-fail=landed:5", ret=1
    )
    result.stdout.fnmatch_lines(["FAILED landed:5 can never be exceeded: landed lies between 0*"])


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["other.py"], "*no test of this run is in the baseline (this run has test_other[[]*"),
        (["plain.py"], "*this run has no repetition; the baseline test_falling[[]*"),
    ],
    ids=["another test", "no repetition"],
)
def test_a_limit_that_compares_nothing_fails_the_run_and_says_why(
    pytester: pytest.Pytester,
    baseline: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    told: str,
) -> None:
    monkeypatch.setenv("COLUMNS", "300")  # no sentence is folded
    (baseline / "other.py").write_text(dedent(TEST).replace("test_falling", "test_other"))
    (baseline / "plain.py").write_text("def test_nothing():\n    pass\n")
    for more, code in (["--sim-compare-fail=landed:5%"], 1), ([], 0):
        result = run_pytest(
            pytester, "--sim=mujoco --reps=1 --sim-baseline=base", *more, *arguments, ret=code
        )
        if code:
            result.stdout.fnmatch_lines([told])
            assert "no metric got worse" not in result.stdout.str()


def test_a_test_that_is_skipped_now_fails_a_typed_limit(
    pytester: pytest.Pytester, baseline: Path
) -> None:
    pytester.makeconftest("def pytest_runtest_setup(item): __import__('pytest').skip('refused')")
    words = f"{ARGUMENTS} --sim-baseline=base --sim-compare-fail=landed:5%"
    result = run_pytest(pytester, words, ret=1)
    told = "FAILED test_falling[[]mujoco-headless[]] is in the baseline, and was skipped"
    result.stdout.fnmatch_lines([told])
    run_pytest(pytester, f"{ARGUMENTS} --sim-baseline=base", ret=0)
    (moved,) = pytester.path.glob("test_*.py")  # its baseline was made elsewhere
    (pytester.mkdir("sub") / moved.name).write_text(moved.read_text())
    run_pytest(pytester, f"{words} sub", ret=1).stdout.fnmatch_lines([told])


def test_junit_has_a_property_for_each_metric(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DURATION", "200")  # long enough for the resources to be sampled
    pytester.makepyfile(TEST)
    run_pytest(pytester, "--sim=mujoco --reps=2 --junitxml=junit.xml", passed=1)
    tree = ElementTree.parse(pytester.path / "junit.xml")
    found = {item.get("name"): item.get("value") for item in tree.iter("property")}
    assert found["repetitions"] == "2"
    assert found["crashed"] == "0"
    assert found["landed"] == "1.0"
    assert 0.1 < float(found["landed.low"] or "nan") < 0.2  # 2 of 2 prove little
    assert {"rtf", "ram", "cpu", "start", "end"} <= found.keys()
    pytester.makepyfile(
        TEST.replace("        repeat", "        repeat(Falling(0.1))\n        repeat")
    )
    run_pytest(pytester, "--sim=mujoco --reps=1 --junitxml=junit.xml", passed=1)
    tree = ElementTree.parse(pytester.path / "junit.xml")
    names = [str(item.get("name")) for item in tree.iter("property")]
    assert len({*names}) == len(names)
    assert {"falling 1: landed", "falling 2: landed"} <= {*names}


KNOWN = """
    import pytest
    from tests.tiny import Falling

    def claim(repeat):
        repeat(Falling()).assert_at_least("landed", 0.9)

    @pytest.mark.xfail
    def test_expects(repeat):
        claim(repeat)

    def test_catches(repeat):
        with pytest.raises(AssertionError):
            claim(repeat)

    def test_skips(repeat):
        try:
            claim(repeat)
        except AssertionError:
            pytest.skip("known")
"""


def test_a_claim_that_is_known_to_fail_does_so_in_junit_and_on_a_badge(
    pytester: pytest.Pytester,
) -> None:
    """One that the test itself caught was FAIL in a run that passed."""
    pytester.makeconftest(NOTHING_LANDS)
    unknown = KNOWN.replace("AssertionError", "KeyError").replace("mark.xfail", "mark.reps(8)")
    told = "--sim=mujoco --reps=8 --junitxml=junit.xml --sim-badge=badge.json"
    fails = ("FAIL   3 of 3 claims fail", "mujoco: failing", "red")
    known = ("XFAIL   0 of 3 claims hold, 3 known", "3 of 3 claims known to fail", "yellow")
    for test, folder, code, (line, message, colour) in (
        (unknown, "--sim-output=a", 1, fails),
        (KNOWN, "--sim-resume=a", 0, known),
    ):
        pytester.makepyfile(test)
        result = run_pytest(pytester, told, folder, ret=code)
        result.stdout.fnmatch_lines([f"{line}*"])
        found = ElementTree.parse(pytester.path / "junit.xml").iter("property")
        claimed = [item.get("value") for item in found if "claim " in str(item.get("name"))]
        assert claimed == [line.split()[0]] * 3
        badge = (pytester.path / "badge.json").read_text()
        assert message in badge
        assert colour in badge


def test_a_saved_run_is_named_by_its_time_and_its_commit() -> None:
    saved = {"datetime": "2026-11-01T10:00:09.123"}
    for commit, told in (("unversioned", ""), ("89abcdef0123", ", commit 89abcdef01"), (None, "")):
        found = _name({**saved, "commit_info": {"id": commit}})
        assert found == f"the run saved 2026-11-01 10:00:09 UTC{told}"
    assert _name({}) == "the run saved  UTC"
