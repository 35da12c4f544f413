"""A task of another package keeps its meaning where that package is gone: the folder tells it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.cli.command import simbench
from tests.plugin.inner import records, run_pytest

PACKAGE = '''
    """Pours seven drops: what only this package says of its numbers."""

    import os
    from dataclasses import dataclass
    from typing import ClassVar

    from pytest_simbench.scene import Pose, Scene
    from pytest_simbench.tasks.base import Outcome, Task, cube
    from pytest_simbench.records.metrics import Metric

    @dataclass(frozen=True)
    class Pouring(Task):
        name: ClassVar[str] = "pouring"
        study_timeout: ClassVar[float] = 60.0
        references: ClassVar[dict] = {"spill": 0.25}

        @property
        def metrics(self):
            return (
                Metric("caught", "caught drops", kind="share", of=7, study=True),
                Metric("spill", "spilt volume", os.environ.get("UNIT", "ml"), better="lower",
                       resolution=0.01, least=0),
                Metric("left", "way to the left", "m", better=None),
            )

        def scene(self, seed, jitter):
            return Scene("pouring", (cube("glass", Pose.at(0.0, 0.0, 0.1), (1, 1, 1, 1)),))

        def perform(self, world, seed, count):
            world.mark("start")
            world.wait(0.01)
            world.mark("end")
            spill = 2.5 + seed % 3 + float(os.environ.get("MORE", "0"))
            return Outcome({"caught": (5 + seed % 3) / 7, "spill": spill, "left": seed / 1e4})
'''
TEST = """
    from pouring import Pouring

    def test_pouring(repeat):
        repeat(Pouring()).assert_at_least("caught", 0.1)
"""
OTHER = """
    from tests.tiny import Falling

    def test_falling(repeat):
        repeat(Falling(duration=0.01))
"""


def run(pytester: pytest.Pytester, *more: str, ret: int = 0, **outcomes: int) -> pytest.RunResult:
    return run_pytest(pytester, "--sim=mujoco -p no:cacheprovider", *more, ret=ret, **outcomes)


@pytest.fixture
def package(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("COLUMNS", "160")  # no table is cut
    monkeypatch.syspath_prepend(pytester.path)
    pytester.makepyfile(pouring=PACKAGE, test_it=TEST)
    return pytester.path / "pouring.py"


def report(folder: Path) -> dict[str, bytes]:
    """The files of a report, taken out of its folder."""
    found = {path.name: path.read_bytes() for path in folder.glob("report.*")}
    for path in [*folder.glob("report.*"), *folder.glob("*.png")]:
        path.unlink()
    return found


def told(text: str) -> None:
    """Heading, unit, share in percent, interval and reference are there."""
    assert "pouring: 9 repetitions, protocol fast" in text
    assert "| caught drops % |" in text
    assert "71 / 86 / 100 [52, 96]" in text
    assert "| simulator | spilt volume ml | way to the left m |" in text
    assert "| reference | 0.25 |  |" in text
    assert "| 3.5 [2.635, 4.365] |" in text
    assert "does not say" not in text


@pytest.mark.usefixtures("drawn")
def test_where_the_package_is_gone(
    pytester: pytest.Pytester, package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(pytester, "--reps=6", "--sim-output=a", "--benchmark-json=a.json", passed=1)
    run(pytester, "--reps=3", "--sim-seed=10007", "--sim-output=b", "-n2", passed=1)
    assert "spilt volume ml" in Path("b/report.md").read_text()  # xdist's controller read it there
    straight = report(Path("a"))
    assert set(straight) == {"report.html", "report.md", "report.csv"}
    for path in (package, pytester.path / "test_it.py"):
        path.unlink()
    monkeypatch.setenv("PYTHONPATH", "")
    elsewhere = pytester.mkdir("elsewhere")
    for name in ("a", "b", "a.json"):
        shutil.move(name, elsewhere / name)
    monkeypatch.chdir(elsewhere)

    shown = simbench(pytester, "report", "-v", "a").stdout.str()
    assert "spilt volume ml" in shown
    assert report(Path("a")) == straight

    merged = simbench(pytester, "merge", "-v", "b", "a", "--output=whole")
    merged.stdout.fnmatch_lines(
        ["caught drops: mujoco 86 %*", "*spilt volume ml*", "reference*0.25*"]
    )
    whole = report(Path("whole"))
    told(whole["report.md"].decode())
    before = sorted(path for path in Path(".").rglob("*") if path.is_file())
    both = simbench(pytester, "report", "-v", "a", "b")  # nowhere to write
    assert sorted(path for path in Path(".").rglob("*") if path.is_file()) == before
    both.stdout.fnmatch_lines(["pouring: 9 repetitions*", "*spilt volume ml*", "reference*0.25*"])
    simbench(pytester, "report", "a", "b", "--output=both")
    told(report(Path("both"))["report.md"].decode())

    # Limits are known by name, unit and direction before anything has run.
    for baseline, limit, message in (
        ("a", "spil:1", "no metric is named 'spil' in the baseline; did you mean 'spill'? valid *"),
        (
            "a.json",
            "caught:5",
            "caught:5 can never be exceeded: caught lies between 0 and 100 %; *",
        ),
    ):
        given = [f"--sim-baseline={baseline}", f"--sim-compare-fail={limit}"]
        result = run(pytester, *given, ret=pytest.ExitCode.USAGE_ERROR)
        result.stderr.fnmatch_lines([f"ERROR: --sim-compare-fail: {message}"])


def test_the_gate_and_a_resumed_run_know_it_too(
    pytester: pytest.Pytester, package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(pytester, "--reps=6", "--sim-output=a", "--benchmark-json=a.json", passed=1)
    monkeypatch.setenv("MORE", "5")
    result = run(pytester, "--reps=6", "--sim-baseline=a.json", "--sim-compare-fail=spill:1", ret=1)
    result.stdout.fnmatch_lines(
        [
            "FAILED test_pouring[[]mujoco-headless[]]: spill rose from 3.5 ml to 8.5 ml (worse by "
            "5 ml, limit 1 ml; p = *, 6 pairs)"
        ]
    )
    monkeypatch.delenv("MORE")
    # What a metric means is part of the configuration.
    monkeypatch.setenv("UNIT", "l")
    result = run(pytester, "--reps=6", "--sim-resume=a", ret=1)
    message = 'unit of the metric spill of pouring was "ml", is "l"'
    result.stdout.fnmatch_lines([f"test_pouring*would not be comparable: {message}"])
    assert len(Path("a/tasks.jsonl").read_text().splitlines()) == 1
    run(pytester, "--reps=1", "--sim-output=litres", "--sim-seed=3000")
    result = simbench(pytester, "merge", "a", "litres")
    result.stderr.fnmatch_lines([f"simbench merge: a and litres are not*: {message} (*is a)"])
    result = run(pytester, "--reps=1", "--sim-baseline=a")
    result.stdout.fnmatch_lines(["different in the baseline*", f"*{message}*"])
    monkeypatch.delenv("UNIT")
    # Nothing is missing: judged and shown again, nothing is run or written twice.
    lines = {name: Path("a", name).read_bytes() for name in ("records.jsonl", "tasks.jsonl")}
    straight = Path("a/report.md").read_bytes()
    run(pytester, "--reps=6", "--sim-resume=a", passed=1)
    assert {name: Path("a", name).read_bytes() for name in lines} == lines
    assert Path("a/report.md").read_bytes() == straight


GIVEN = """
    import pytest
    from pytest_simbench.records.metrics import Metric
    from pytest_simbench.tasks.base import Outcome
    from pouring import Pouring

    GIVEN = {
        "rounded": Outcome({"spill": -1e-12}), "share": Outcome({"caught": 1.5}),
        "nan": Outcome({"spill": float("nan")}), "less": Outcome({"spill": -1.0}),
        "text": Outcome({"spill": "7"}), "large": Outcome({"spill": 1e101}),
        "nothing": None, "typo": Outcome({"cauhgt": 1.0}),
    }

    @pytest.mark.parametrize("given", GIVEN)
    def test_giving(repeat, given):
        repeat(type("Giving", (Pouring,), {"perform": lambda *_: GIVEN[given]})())

    class Scene(Pouring):
        def scene(self, seed, jitter):
            pass

    class Kind(Pouring):
        @property
        def metrics(self):
            return (Metric("caught", "caught", kind="shares", of=7),)

    class Raising(Pouring):
        def perform(self, world, seed, count):
            raise ValueError("a mistake of mine")

    @pytest.mark.parametrize("task", [Scene, Kind, Raising])
    def test_task(repeat, task):
        repeat(task())
"""


@pytest.mark.usefixtures("package")
def test_an_outcome_that_no_record_can_hold_fails_its_test_and_no_other(
    pytester: pytest.Pytester,
) -> None:
    pytester.makepyfile(test_it=GIVEN)
    result = run(pytester, "--reps=1", "--sim-output=a", ret=1)
    result.assert_outcomes(passed=1, failed=10)  # and pytest-benchmark warns of none
    result.stdout.fnmatch_lines(
        ["FAIL mujoco, test_giving share: Failed: caught of pouring cannot be 1.5",
         "FAIL mujoco, test_giving nan: *pouring must be a number up to 1e100 or None, not nan",
         "FAIL mujoco, test_giving less: *spill of pouring cannot be -1",
         "FAIL mujoco, test_giving text: *pouring must be a number up to 1e100 or None, not '7'",
         "FAIL mujoco, test_giving large: *must be a number up to 1e100 or None, not 1e+101",
         "FAIL mujoco, test_giving nothing: *perform() returns an Outcome, not NoneType",
         "FAIL mujoco, test_giving typo: *no metric is named 'cauhgt' in the outcome of pouring; "
         "did you mean 'caught'? *",
         "FAIL mujoco, test_task Scene: *scene() returns a Scene, not NoneType",
         "FAIL mujoco, test_task Kind: *metric 'caught': kind='shares'; choose from 'share', *",
         "FAIL mujoco, test_task Raising: ValueError: a mistake of mine"]
    )  # fmt: skip
    assert [r["metrics"] for r in records("a")] == [{"spill": 0.0}, *[{}] * 9]
    told = result.stdout.str()
    assert "raise ValueError" in told
    assert "repeater.py" not in told  # nor any other line of ours before it
