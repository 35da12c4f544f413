"""`simbench fit` on MuJoCo: planted values are found, a fit goes on, bad input is one sentence."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from pytest_simbench.cli.fit import _lines, _OutOfTime, _written
from pytest_simbench.cli.main import main
from pytest_simbench.scene import Start
from pytest_simbench.scene.pair_friction import OF_PAIRS
from pytest_simbench.tuning.fitting import Fit
from pytest_simbench.tuning.telling import Told
from pytest_simbench.tuning.unknowns import Unknown
from tests.approval import assert_approved
from tests.cli.command import said
from tests.tasks.scripted_scene import SCENE

DRIVE = """
<mujoco model="drive">
  <worldbody>
    <body name="rod" pos="0 0 1">
      <joint name="hinge" type="slide" axis="1 0 0" range="-2 2"/>
      <geom type="box" size=".1 .1 .1" mass="1"/>
    </body>
  </worldbody>
  <actuator><position joint="hinge" kp="{}" kv="{}" forcerange="-1000 1000"/></actuator>
</mujoco>
"""
"""1 kg behind a drive: x'' = k (u - x) - d x'."""

TIME = np.linspace(0, 1, 101)
STIFFNESS, DAMPING = 100.0, 4.0


def step() -> np.ndarray:
    """The answer to a step of 0.2 m, in closed form."""
    decay = DAMPING / 2
    speed = np.sqrt(STIFFNESS - decay**2)
    turn = speed * TIME
    return 0.2 * (1 - np.exp(-decay * TIME) * (np.cos(turn) + decay / speed * np.sin(turn)))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "drive.xml").write_text(DRIVE.format(25, 12))
    noisy = step() + 1e-3 * np.random.default_rng(1).standard_normal(len(TIME))
    told = np.full(len(TIME), 0.2)
    np.savez(tmp_path / "log.npz", time=TIME, hinge=noisy, **{"hinge/command": told})
    np.savez(tmp_path / "other.npz", time=TIME, knee=noisy)
    ball = '<body name="ball" pos="1 0 .1"><freejoint/><geom size=".1"/></body></worldbody>'
    (tmp_path / "ball.xml").write_text(DRIVE.format(25, 12).replace("</worldbody>", ball))
    pose = np.tile([1000.0, 0, 100, 1, 0, 0, 0], (len(TIME), 1))
    np.savez(tmp_path / "mm.npz", time=TIME, **{"ball/pose": pose})
    return tmp_path


BOTH = ("fit", "drive.xml", "log.npz", "--sim", "mujoco", "--noise", "0.001", "--output", "out",
        "--unknown", "stiffness:hinge", "--unknown", "damping:hinge")  # fmt: skip


@pytest.mark.engine
def test_gains_of_a_drive_from_the_closed_form(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """From a quarter of the stiffness and three times the damping; called again it repeats
    nothing, and what a killed one had not come to is run then."""
    assert main(BOTH) == 0
    told = capsys.readouterr().out
    assert "places off the log" in told
    found = json.loads((folder / "out/fitted.json").read_text())
    assert found["stiffness:hinge"]["value"] == pytest.approx(STIFFNESS, rel=0.01)
    assert found["damping:hinge"]["value"] == pytest.approx(DAMPING, rel=0.02)
    whole = (folder / "out/records.jsonl").read_text().splitlines(keepends=True)
    assert main(BOTH) == 0
    assert (folder / "out/records.jsonl").read_text() == "".join(whole)
    (folder / "out/records.jsonl").write_text("".join(whole[:12]))
    assert main(BOTH) == 0
    again = [json.loads(line) for line in (folder / "out/records.jsonl").read_text().splitlines()]
    assert [r["details"] for r in again] == [json.loads(line)["details"] for line in whole]
    assert capsys.readouterr().out.count(told.partition("values:")[0]) == 2
    monkeypatch.setattr(Fit, "widened", Mock(side_effect=_OutOfTime))  # while intervals are tried
    assert main(BOTH) == 130
    assert not (folder / "out/fitted.json").exists()
    assert "the same command with a larger --budget goes on" in capsys.readouterr().out


@pytest.mark.engine
def test_the_mass_and_both_gains_are_not_told_apart(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*BOTH, "--unknown", "mass:rod"]) == 0
    assert "the log tells its ratio to stiffness:hinge and damping:hinge alone" in (
        capsys.readouterr().out
    )
    assert json.loads((folder / "out/fitted.json").read_text()) == {}


@pytest.mark.engine
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"log.npz": "other.npz"}, "holds 'knee', which scene 'drive' has not"),
        ({"0.001": "0"}, "give a number from 1e-09 to 1"),
        ({"drive.xml": "none.xml"}, "none.xml"),
        ({"drive.xml": "ball.xml", "log.npz": "mm.npz"}, "'ball' is outside the room"),
        ({"damping:hinge": "damping:hinge=1..1e15"}, "'damping:hinge=1..1e15': the damping of"),
        ({"--noise": "--profile", "0.001": "file"}, "loads the scene as it is written"),
        ({"mujoco": "mujoco@nowhere"}, "mujoco@nowhere: there is no such program on the PATH"),
    ],
)
def test_bad_input(
    change: dict[str, str], message: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, _, told = said(capsys, *(change.get(word, word) for word in BOTH))
    assert (status, told.count("\n")) == (2, 1)
    assert message in told
    assert not (folder / "out").exists()


@pytest.mark.engine
def test_no_unknown_and_no_time(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(BOTH[:9]) == 2
    assert "name what is unknown: --unknown NAME; choose from" in capsys.readouterr().err
    assert main([*BOTH, "--budget", "0.5s"]) == 130
    assert "the budget is used up after" in capsys.readouterr().out
    own = [f"mujoco@mine={sys.executable}" if word == "mujoco" else word for word in BOTH]
    assert main([*own, "--budget", "0.5s", "--output", "mine"]) == 130
    assert '"simulator": "mujoco@mine"' in (folder / "mine/records.jsonl").read_text()
    with np.load(folder / "log.npz") as log:  # in mm
        np.savez(folder / "far.npz", **{**log, "hinge": 1000 * log["hinge"]})
    far = ["fit", "drive.xml", "far.npz", *BOTH[3:7], "--budget", "0.1s", "--output"]
    assert main([*far, "far", *BOTH[-2:]]) == 130
    assert "far.npz: hinge goes from" in capsys.readouterr().err
    (folder / "drive.xml").write_text(DRIVE.format(25, 13))
    assert main(BOTH) == 2
    assert "begin anew in another folder: --output DIR" in capsys.readouterr().err
    (folder / "run").mkdir()
    whole = (
        (folder / "out/records.jsonl").read_text().replace('"function": "fit"', '"function": "f"')
    )
    (folder / "run/records.jsonl").write_text(whole)
    assert main([*far, "run", *BOTH[-2:]]) == 2
    assert (
        "run holds another run, of fit[mujoco-headless-e0]; begin anew" in capsys.readouterr().err
    )


def test_all_that_is_said_of_a_fit() -> None:
    """Of what is determined and what is not, of joints that turn and slide, and of a misfit."""
    values = (("mass:drawer", 1.0, 2.34567, ""), ("spring:slider", 90.0, 1e-4, "no end below"),
              ("friction:ground", 0.5, 0.25, ""))  # fmt: skip
    results = [Told(Unknown(name, was, was / 10, was * 10), now, now / 2, now * 2, why)
               for name, was, now, why in values]  # fmt: skip
    log = SimpleNamespace(joints=["hinge", "slider"], start=Start((), ()))
    first, last = (SimpleNamespace(metrics={"off": off, "turned": None}) for off in (12.345, 0.98))
    last.deviations = ("soft", wrong := f"{OF_PAIRS}not the scene's: of a and b it is 0.6, not 1")
    found: Any = SimpleNamespace(columns=["slider"], record=last)
    fitting: Any = SimpleNamespace(
        scene=SCENE, log=log, looks=17, first=first, misfit=lambda of: dict.fromkeys(of, 4.5678)
    )
    assert_approved("fit", "\n".join(_lines(results, fitting, found)))
    assert json.loads(_written(results, found)) == {
        "mass:drawer": {"value": 2.34567, "low": 2.34567 / 2, "high": 2.34567 * 2},
        "friction:ground": {"value": 0.25, "low": 0.125, "high": 0.5, "warning": wrong},
    }
