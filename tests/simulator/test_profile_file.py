"""Profiles of files: told by name and content, and what is said of bad ones."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.identity import settings
from pytest_simbench.records.tuned_on import Seen
from pytest_simbench.simulator import SettingsError
from pytest_simbench.simulator.profile_file import read_profile, write_profile

TEXT = """
simulator = "mujoco"
base = "tuned"
[settings]
timestep = 0.004
solref = [0.01, 1.0]
[chosen]
by = "hand"
seeds = [["stacking", 7, 9]]
"""


def written(folder: Path, text: str, name: str = "quick.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_a_file_changes_a_profile(tmp_path: Path) -> None:
    path = written(tmp_path, TEXT)
    case = Case.of(
        "mujoco", profile=str(path), changes={"impratio": 3}, test="t", mode="headless",
        folder=tmp_path,
    )  # fmt: skip
    told = settings(case)
    assert (told["timestep"], told["solref"], told["impratio"]) == (0.004, (0.01, 1.0), 3)
    assert told["cone"] == "elliptic"  # of its base
    assert (case.base, case.chosen_on[-1]) == ("tuned", Seen.seeds("stacking", 7, 9))
    assert case.chosen_on[:-1]  # and on what the base was chosen


def test_a_file_may_change_nothing(tmp_path: Path) -> None:
    found = read_profile(written(tmp_path, 'simulator = "mujoco"\nbase = "tuned"\n'))
    assert (found.changes, found.chosen_on) == ({}, ())
    assert read_profile(written(tmp_path, 'simulator = "mujoco"\n')).base == "default"


def test_two_files_of_one_name_are_told_apart(tmp_path: Path) -> None:
    first = read_profile(written(tmp_path, TEXT)).label
    assert first == read_profile(written(tmp_path, f"\ufeff# the same\n{TEXT}")).label
    assert first != read_profile(written(tmp_path, TEXT.replace("0.004", "0.005"))).label
    assert first.startswith("quick-")


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    by = 'a "quoted"\nname \U0001f600'
    chosen = {"by": by, "seeds": [["stacking", 7, 9]], "versions": {"a-b": "1", "c": "2"}}
    text = write_profile("tuned", "mujoco", {"timestep": 0.004, "solref": (0.01, 1.0)}, chosen)
    assert tomllib.loads(text)["chosen"] == chosen
    assert read_profile(written(tmp_path, text)) == read_profile(written(tmp_path, TEXT))
    text = write_profile("default", "ovphysx", {"contact_offset": None}, {})
    assert read_profile(written(tmp_path, text)).settings().contact_offset is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("timestep", "step", r"has no setting 'step'; choose from timestep=0.001, "),
        ("0.004", '"fast"', "mujoco.timestep=fast: give a finite number"),
        ('"tuned"', '"tunes"', "no settings profile 'tunes'; choose from default, tuned, real"),
        ('"mujoco"', '"mujoko"', "unknown simulator 'mujoko'; choose from "),
        ('"mujoco"', "3", "give texts: simulator = NAME"),
        ("base", "basis", "'basis' means nothing here; choose from simulator, base, settings"),
        ("[settings]", "[settings", "is no TOML file: "),
        ("[settings]", "[[settings]]", "are tables, "),
        ('["stacking", 7, 9]', "7", "seeds are lists"),
        ("7, 9", "1, inf", "seeds are lists"),
        ("7, 9", "9, 7", "FIRST at most LAST"),
        ("7, 9", "1, 1" + "0" * 400, "seeds are lists"),
        ("timestep = 0.004", "iterations = 1" + "0" * 400, "give a whole number"),
    ],
)
def test_bad_files(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = written(tmp_path, TEXT.replace(old, new, 1))
    with pytest.raises(SettingsError, match=message) as raised:
        read_profile(path)
    assert str(path) in str(raised.value)
    assert "\n" not in str(raised.value)


def test_another_simulators_file(tmp_path: Path) -> None:
    file = read_profile(written(tmp_path, TEXT))
    assert file.settings("mujoco==3.3.7") == file.settings()
    with pytest.raises(SettingsError, match="is a profile of mujoco, not of drake"):
        file.settings("drake")
