"""`simbench watch` on an engine whose world stands still from release 1.3 on (`plugin.planted`)."""

from __future__ import annotations

import json
import re
import sys
from datetime import date
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.cli import watch
from pytest_simbench.cli.main import main
from pytest_simbench.cli.search import Search
from pytest_simbench.cli.values import BadInput
from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.measure.watching import Step
from pytest_simbench.records.folder import RunFolder
from tests.approval import assert_approved_line
from tests.plugin.planted import offer, plant
from tests.records.build import record

DRIVER = """
import sys
from pytest_simbench.cli import main, watch
from tests.tiny import Falling

watch.TASKS, watch.LIMITS = (Falling(),), "landed:5%"
watch.TASKS_RUN = ("test_planted.py",)
watch.LAWS_RUN += ("-k", "free_fall")
watch.SCENE_RUN += ("-k", "headless and not mm and not step")
sys.exit(main.main(sys.argv[1:]))
"""
"""The command with less work to do."""

BALL = """<mujoco><worldbody><geom type="plane" size="1 1 1"/>
<body name="ball" pos="0 0 1"><freejoint/><geom type="sphere" size="0.1"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def index(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The page of a package index."""
    pytester.makepyfile(driver=DRIVER)
    (pytester.path / "ball.xml").write_text(BALL)
    return plant(pytester, monkeypatch)


def test_what_is_new_is_compared_with_what_was_seen(pytester: pytest.Pytester, index: Path) -> None:
    offer(index, "1.1", "1.2", "1.3")
    state = pytester.path / "w" / "watch.json"
    state.parent.mkdir()
    state.write_text('{"seen": {"planted": "1.2"}}')

    words = ("watch", "planted", "--reps=1", "--scene=ball.xml", "--output=w")
    result = pytester.run(sys.executable, "driver.py", *words)

    assert result.ret == 1
    result.stdout.fnmatch_lines(
        ["planted: after 1.2 came 1.3",
         "planted 1.3, after 1.2",
         "  free_fall is broken (0.*x -> *x)",
         "  (*: 1 and 1 repetitions are too few for a change of landed to be significant *",
         "  (ball.xml: ball ends * mm elsewhere; no moved start was tried, so it may be noise)",
         "page: w/index.html"]
    )  # fmt: skip
    page, text = (state.with_name(name).read_text() for name in ("index.html", "index.md"))
    for told in (page, text):
        assert "is broken (0.36x" in told
        assert "planted: after 1.2 came 1.3" in told
    told = json.loads(state.read_text())
    assert told["seen"] == {"planted": "1.3"}
    (step,) = told["steps"]
    assert list(step["reports"]) == ["laws", "tasks", "ball.xml"]
    for address in step["reports"].values():
        assert f'href="{address}"' in page
        assert (state.parent / address).is_file()


RELEASES = ["3.2.0", "3.2.7", "3.3.0", "3.3.7", "4.0.0"]
"""Of a made-up index; the adapter runs with nothing older than 3.2.4."""


@pytest.fixture
def work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The releases that were run, in place of runs; each step changes what its release says."""
    ran: list[list[str]] = []

    def judged(runs: watch.Runs, limits: object, steps: int) -> list[Step]:
        if runs.releases[1:]:
            ran.append([*runs.releases])
        if "3.3.0" in runs.releases:
            raise BadInput("the run ended with exit code 4")
        told = [f"{runs.repetitions} of {steps} steps in {runs.folder}", *map(str, runs.scenes)]
        return [Step(runs.engine, old, new, ["<b>"] if new == "4.0.0" else [], told)
                for old, new in pairwise(runs.releases)]  # fmt: skip

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(watch, "releases", lambda distribution: RELEASES)
    monkeypatch.setattr(watch.Runs, "judged", judged)
    return ran


@pytest.mark.parametrize("releases", [["1.2"], ["1.1", "1.2", "1.3"]])
def test_what_is_run_on_the_releases(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, releases: list[str]
) -> None:
    """A scene of an engine that has the profile `file` is run as the file has it, a URDF is not."""
    asked: list[Any] = []

    class Kept(Search):
        def run(self, *places: int) -> None:
            asked.append((self.simulator, places, self.releases, self.arguments))
            assert self.folder.parents[1] == tmp_path
            run = RunFolder(self.folder)
            run.append(record(1, simulator="mujoco==1.2"))
            run.flush()

    monkeypatch.setattr(watch, "Search", Kept)
    scenes = [tmp_path / name for name in ("a.xml", "b.URDF")]
    for scene in scenes:
        scene.write_text("x")
    found = watch.Runs("mujoco", releases, tmp_path, 5, scenes).judged((), 2)
    if len(releases) == 1:
        assert (found, asked) == ([], [])
        return
    tuned = "--sim-profile=tuned"
    assert asked == [
        ("mujoco", (0, 1, 2), releases, words) for words in (
            (*watch.LAWS_RUN, tuned), (*watch.TASKS_RUN, tuned, "--reps=5"),
            (*watch.SCENE_RUN, f"--sim-scene={scenes[0]}", "--sim-profile=file"),
            (*watch.SCENE_RUN, f"--sim-scene={scenes[1]}", tuned),
        )
    ]  # fmt: skip
    assert [(s.engine, s.old, s.new) for s in found] == [
        ("mujoco", "1.1", "1.2"), ("mujoco", "1.2", "1.3"),
    ]  # fmt: skip
    for step in found:
        assert [*step.reports] == ["laws", "tasks", *map(str, scenes)]
        assert step.day == date.today().isoformat()
        for address in step.reports.values():
            assert re.fullmatch(r"mujoco-1\.1-1\.3-[0-9a-f]+/[\w-]+/report\.html", address)
    assert len({*found[0].reports.values()}) == 4


def test_the_first_watch_notes_the_newest_and_the_next_begins_there(
    work: list[list[str]], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(watch, "releases", lambda distribution: RELEASES[:-1])
    for begins in ("; --since mujoco==RELEASE begins earlier", ""):
        assert main(["watch", "mujoco"]) == 0
        told, page = capsys.readouterr().out.splitlines()
        assert told == f"mujoco: nothing came after 3.3.7{begins}"
        assert page == "page: .simbench/watch/index.html"
    monkeypatch.setattr(watch, "releases", lambda of: ["3.2.4", "3.2.7", "3.3.6", "4.0.0"])
    assert main(["watch", "mujoco"]) == 1  # 3.3.7 was taken back
    assert work == [["3.3.6", "4.0.0"]]
    page = Path(".simbench/watch/index.html").read_text()
    assert "&lt;b&gt;" in page
    assert "<b>" not in page
    assert main(["watch", "mujoco"]) == 0


@pytest.mark.parametrize(
    ("words", "status", "ran"),
    [("--since mujoco==3.2.7:minor", 1, ["3.2.7", "3.3.7", "4.0.0"]),
     ("--since mujoco==3.2.7", 2, RELEASES[1:]), ("--since mujoco==4.0.0", 0, None),
     ("mujoco --since mujoco==3.3.7 --reps 3 --scene a.xml --output out", 1, ["3.3.7", "4.0.0"])],
)  # fmt: skip
def test_a_watch_may_begin_earlier(
    work: list[list[str]], capsys: pytest.CaptureFixture[str],
    words: str, status: int, ran: list[str] | None,
) -> None:  # fmt: skip
    Path("a.xml").touch()
    assert main(["watch", *words.split()]) == status
    assert work == ([ran] if ran else [])
    assert_approved_line("watch", capsys.readouterr().out.replace("\n", " | "))


def test_one_that_cannot_be_judged_holds_up_no_other(
    work: list[list[str]], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def of(distribution: str) -> list[str]:
        if distribution == "sapien":
            raise SimulatorError("no package index tells the releases of sapien")
        return RELEASES

    monkeypatch.setattr(watch, "releases", of)
    assert main(["watch", "sapien", "mujoco"]) == 2
    assert main(["watch", "sapien", "--since", "mujoco==3.3.7"]) == 1
    assert_approved_line("watch", capsys.readouterr().out.replace("\n", " | "))
