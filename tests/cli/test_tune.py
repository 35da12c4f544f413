"""`simbench tune` on MuJoCo, and what is said of wrong arguments."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import pytest

from pytest_simbench.cli import tune as cli_tune
from pytest_simbench.cli.main import main
from pytest_simbench.cli.runs import RUNS
from pytest_simbench.cli.tune import _judge
from pytest_simbench.cli.tune_told import (
    Result,
    front_of,
    profile_of,
    progress,
    together,
    verdict_of,
)
from pytest_simbench.cli.values import BadInput
from pytest_simbench.measure.intervals import Interval
from pytest_simbench.records.tuned_on import Seen
from pytest_simbench.simulator.profile_file import read_profile
from pytest_simbench.tuning.search import front
from tests.approval import assert_approved, assert_approved_line
from tests.cli.command import said
from tests.tuning.made_up import target, trials

pytest.importorskip("optuna")

SLIPS = ("tune", "laws:grip_holds", "--sim", "mujoco", "--profile", "default", "--output", "out")


def test_a_grip_that_creeps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """By default a held cube creeps 3.7 mm/s; the search finds settings that hold it, writes them
    as a profile, and called again goes on with more trials alone."""
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    few = ("--settings", "cone,impratio,noslip_iterations")
    assert main([*SLIPS, *few, "--trials", "6"]) == 0
    told = capsys.readouterr().out
    assert "held-out half: better" in told
    assert "recommended" in told
    profile = read_profile(tmp_path / "out/mujoco.tuned.toml")
    assert profile.simulator == "mujoco"
    assert {*profile.changes} <= {"cone", "impratio", "noslip_iterations"}
    before = (tmp_path / "out/records.jsonl").read_text()
    assert main([*SLIPS, *few, "--trials", "8"]) == 0
    made = before.count("\n")
    assert f"\ngoes on with {made} repetitions of out\n" in capsys.readouterr().out
    after = (tmp_path / "out/records.jsonl").read_text()
    assert after.startswith(before)
    made = [json.loads(line) for line in after.splitlines()]
    assert len({(r["test"], r["task"], r["repetition"]) for r in made}) == len(made)
    for record in made:  # today's tell the time-out of the others, which they must agree on
        record["seconds"] = record["seconds"] if "today" in record["test"] else {}
    lines = (json.dumps(record) + "\n" for record in made)
    (tmp_path / "out/records.jsonl").write_text("".join(lines))
    (tmp_path / "out/front.png").unlink()
    (tmp_path / "out/front.png").mkdir()
    assert main([*SLIPS, *few, "--trials", "8"]) == 2
    assert "Is a directory" in capsys.readouterr().err
    assert main([*SLIPS, *few, "--trials", "1"]) == 2  # today's alone: nothing else is recommended
    assert not (tmp_path / "out/mujoco.tuned.toml").exists()


def test_how_many_seeds_are_judged_and_on_which_it_was_chosen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a time, of looks of 1 s; a smaller step costs eight of them. A profile that began with
    another file's was chosen on its seeds, too; and it says when its commit is not all."""
    path = tmp_path / "first.toml"
    path.write_text('simulator = "mujoco"\n[chosen]\nseeds = [["stacking", 7, 9]]\n')
    for jobs, converged, seeds in ((1, False, 10), (2, False, 20), (2, True, 5)):
        of = replace(target(2, 40), converged=converged)
        looks, _ = trials(tmp_path / f"{jobs}{converged}", lambda s, k: 1.0, of, jobs)
        looks.case = replace(looks.case, file=read_profile(path), changes={"cone": "elliptic"})
        today = looks.today()
        found = looks.choose("trial1", {"timestep": 0.004}, [today])
        halves = _judge(looks, today, found, 20.0)
        assert [len(one.records) for one in halves] == [seeds, seeds]
    assert _judge(looks, today, today, 20.0) == []
    monkeypatch.chdir(tmp_path)
    words = "init -q; git add first.toml; git -c user.name=x -c user.email=x commit -qm x"
    subprocess.run(f"git {words}; echo >>first.toml", shell=True, check=True)
    path.write_text(profile_of(Result(looks, [today, found], found, "why", halves)))
    passing = r', "mujoco" = "[^"]*"|[0-9a-f]{12}(?=-dirty)|(?<== ")\d[^"]*(?=")'
    assert_approved("tuned", re.sub(passing, "", path.read_text()))
    told = [Seen.seeds("stacking", 7, 9), Seen.seeds("falling", 300_001, 300_002)]
    assert [*read_profile(path).chosen_on] == told


def test_all_that_is_said_of_a_search(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One that ends with a cheaper point; the same one not judged; and one that keeps today's."""
    looks, _ = trials(
        tmp_path, lambda s, k: None if s["timestep"] > 0.01 else 1.0 - (s["timestep"] > 0.004) / k,
        target(4, 60),
    )  # fmt: skip
    today = looks.today()
    done, tell = [today], progress(looks)
    for number, step in enumerate((0.003, 0.015, 0.001, 0.008, *[0.0029] * 7), 1):
        more = {"cone": "elliptic", "impratio": 1.0} if step == 0.008 else {}  # which is today's
        one = looks.choose(f"trial{number}", {"timestep": step, **more}, done)
        done.append(one)
        tell(one, front(done, looks))
    better = Result(looks, done, done[1], "it is cheaper", _judge(looks, today, done[1], 500.0))
    unknown = replace(better, halves=())
    kept, law = replace(unknown, found=today), replace(better)
    half = replace(better.judgement, worse_by=None, cheaper=Interval(2.0, 1.5, 2.5, 60, "t"))
    vars(law)["judgement"] = half
    lines = [capsys.readouterr().out, *together((better, unknown, kept))]
    for of in (better, unknown, kept, law, replace(kept, done=[today])):
        lines += [*front_of(of), *verdict_of(of)]
    for cpu, record in zip(("slow", "quick"), today.records.values(), strict=False):
        vars(record)["host"] = {"cpu": cpu, "node": cpu}
    lines += verdict_of(kept)
    assert_approved("tune", "\n".join(lines))


TEST = """
from tests.tiny import Falling

def test_falls(repeat):
    repeat(Falling()).assert_between("landed", 0.9, 1.0)
"""


def test_a_test_on_several_simulators(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each in a folder of its own; who cannot is told and left out."""
    for name in ("mujoco", "pybullet"):
        pytest.importorskip(name)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    Path("test_falls.py").write_text(TEST)
    words = ("tune", "test_falls.py::test_falls", "--sim", "mujoco,pybullet", "--output", "out")
    few = ("--trials", "2", "--seeds", "2", "--budget", "30s", "--settings", "timestep,cone")
    assert main([*words, *few, "--jobs", "2"]) == 0
    told = capsys.readouterr().out
    assert "pybullet is left out: pybullet has no setting 'cone' to search" in told
    begins = "test_falls.py::test_falls on mujoco, from its profile tuned; over timestep, cone\n"
    assert f"\nmujoco\n{begins}claimed: landed at least 0.9; landed at most 1\n" in told
    table = told[told.index("simulator  cost today") :].splitlines()
    assert table[1].startswith("mujoco ")
    made = [*map(json.loads, Path("out/mujoco/records.jsonl").read_text().splitlines())]
    assert {(r["function"], r["task"]) for r in made} == {("tune_test_falls", "falling")}
    assert all(r["contended"] for r in made)
    assert (Path("out/mujoco/records.jsonl").exists(), Path("out/pybullet").exists()) == (1, 0)


def test_who_is_not_here_takes_no_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco")
    given: list[float] = []

    def search(chosen: object, executor: object, target: str, options: object, seconds: float,
               out: object) -> None:  # fmt: skip
        given.append(seconds)
        raise BadInput("it is not here")

    monkeypatch.setattr(cli_tune, "_search", search)
    with pytest.raises(BadInput, match="^none of 2 simulators could be tuned$"):
        cli_tune.tune("stacking", ["mujoco", "mujoco==0.0.1"], budget=60.0)
    assert given == [60.0, 60.0]


def test_a_test_that_was_edited_is_searched_for_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    words = ("tune", "test_edited.py::test_falls", "--sim", "mujoco", "--settings", "timestep")
    for text in (TEST, TEST, f"{TEST}# edited"):
        Path("test_edited.py").write_text(text)
        assert main([*words, "--trials", "1", "--seeds", "1", "--budget", "5s"]) == 0
    assert len([*Path(RUNS).iterdir()]) == 2


def test_it_begins_with_the_profile_s_file_and_what_the_test_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    search = Mock(side_effect=BadInput("seen"))
    monkeypatch.setattr(cli_tune, "Search", search)
    Path("test_begun.py").write_text(TEST)
    Path("pytest.ini").write_text("[pytest]\nsim_set = mujoco.timestep=0.003\n")
    Path("own.toml").write_text('simulator = "mujoco"\n[settings]\niterations = 42\n')
    words = ("tune", "test_begun.py::test_falls", "--sim", "mujoco", "--profile", "own.toml")
    assert main([*words, "--output", "out"]) == 2
    base = search.call_args.args[1]
    assert (base.timestep, base.iterations) == (0.003, 42)


def test_killed_and_gone_on_with(tmp_path: Path) -> None:
    """No repetition twice, whatever it was that was killed."""
    pytest.importorskip("mujoco")
    (tmp_path / "test_falls.py").write_text(TEST)
    words = [sys.executable, "-m", "pytest_simbench", "tune", "test_falls.py::test_falls"]
    words += ["--sim", "mujoco", "--output", "out", "--jobs", "2", "--trials", "4"]
    words += ["--error", "converged:landed", "--settings", "timestep", "--budget", "40s"]
    here = {"cwd": tmp_path, "env": {**os.environ, "PYTHONPATH": os.getcwd()}}
    records = tmp_path / "out/records.jsonl"

    def made() -> list[str]:
        return records.read_text().splitlines(keepends=True) if records.exists() else []

    first = subprocess.Popen(words, start_new_session=True, stdout=subprocess.DEVNULL, **here)  # type: ignore[call-overload]
    until = time.monotonic() + 120
    while len(made()) < 10:
        assert first.poll() is None
        assert time.monotonic() < until
        time.sleep(0.02)
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    before = [line for line in made() if line.endswith("\n")]
    again = subprocess.run(words, check=True, capture_output=True, text=True, **here)  # type: ignore[call-overload]
    assert f"goes on with {len(before)} repetitions" in again.stdout
    found = [json.loads(line) for line in made()]
    assert [json.loads(line) for line in before] == found[: len(before)]
    assert len({(r["test"], r["repetition"]) for r in found}) == len(found) > len(before)
    converged = [r for r in found if r["variant"] == "converged"]
    today = next(r for r in found if r["variant"] == "today")
    assert len(converged) == 4
    assert converged[0]["settings"]["timestep"] == today["settings"]["timestep"] / 8


WRONG = """laws:x --sim mujoco; stacking; x.py::test_x --sim mujoco; tosses --sim mujoco;
stacking --sim mujoco --jobs 2 --cluster tcp://127.0.0.1:1;
stacking --sim mujoco,drake --settings condim; stacking --sim mujoko;
stacking --sim mujoco --settings condim; stacking --sim mujoco --budget 0s;
stacking --sim mujoco --profile tuned,real; stacking --sim mujoco --profile no.toml;
stacking --sim mujoco --profile best; stacking --sim mujoco --output /dev/null"""


@pytest.mark.parametrize("words", re.split(r";\s", WRONG))
def test_bad_input(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SIMBENCH_DATA", str(tmp_path / "none"))
    status, _, told = said(capsys, "tune", *words.split())
    assert (status, told.count("\n")) == (2, 1)
    assert_approved_line("tune_words", f"{words}: {told.strip()}".replace(f"{tmp_path}", "DIR"))
    assert not list(tmp_path.iterdir())
