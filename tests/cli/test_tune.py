"""`simbench tune` on MuJoCo, and what is said of wrong arguments."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pytest_simbench.cli.main import main
from pytest_simbench.simulator.profile_file import read_profile

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
    after = (tmp_path / "out/records.jsonl").read_text()
    assert after.startswith(before)
    made = [json.loads(line) for line in after.splitlines()]
    assert len({(r["test"], r["task"], r["repetition"]) for r in made}) == len(made)
    untimed = (json.dumps({**record, "seconds": {}}) + "\n" for record in made)
    (tmp_path / "out/records.jsonl").write_text("".join(untimed))
    (tmp_path / "out/front.png").unlink()
    (tmp_path / "out/front.png").mkdir()
    assert main([*SLIPS, *few, "--trials", "8"]) == 2
    assert "Is a directory" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("laws:x", "--sim", "mujoco"), "no law or phenomenon is named 'x'"),
        (("stacking",), "name a simulator: --sim NAME"),
        (("stacking", "--sim", "mujoko"), "unknown simulator 'mujoko'; choose from"),
        (("stacking", "--sim", "mujoco", "--settings", "condim"), "no setting 'condim' to search"),
        (("stacking", "--sim", "mujoco", "--budget", "5"), "give a time: 90s, 30min or 2h"),
        (("stacking", "--sim", "mujoco", "--profile", "tuned,real"), "give one profile"),
        (
            ("stacking", "--sim", "mujoco", "--profile", "no.toml"),
            "cannot read the profile no.toml",
        ),
        (
            ("stacking", "--sim", "mujoco", "--profile", "best"),
            "no simulator has a settings profile",
        ),
    ],
)
def test_bad_input(
    words: tuple[str, ...], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    try:
        status = main(["tune", *words])
    except SystemExit as error:
        status = int(error.code or 0)
    told = capsys.readouterr().err
    assert (status, told.count("\n")) == (2, 1)
    assert message in told
    assert not list(tmp_path.iterdir())
