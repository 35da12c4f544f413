"""What of a run's options holds for each simulator, mode and profile."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.cli.selection import Selection, profiles_of
from pytest_simbench.experiment.variants import Variant


@pytest.mark.parametrize(("name", "ratio"), [("mujoco", "5"), ("mujoco==3.3.7", "7")])
def test_the_profile_then_ours_then_the_user_s(name: str, ratio: str, tmp_path: Path) -> None:
    """A file's profile and a plain one, changed for all releases and for one."""
    path = tmp_path / "quick.toml"
    path.write_text('simulator = "mujoco"\nbase = "tuned"\n[settings]\ntimestep = 0.004\n')
    (plain, quick), files = profiles_of(("default", str(path)))
    changes = {"mujoco": {"impratio": "5", "cone": "pyramidal"}, "mujoco==3.3.7": {"impratio": "7"}}
    chosen = Selection((name,), ("gui",), (plain, quick), changes, files=files)
    for label, step in ((plain, 0.002), (quick, 0.004)):
        given = vars(chosen.settings(name, label, {"timestep": 0.005, "impratio": 9}))
        assert (given["timestep"], given["impratio"]) == (0.005, float(ratio))
        assert vars(chosen.settings(name, label))["timestep"] == step
    variant, ours = Variant(name, "gui", quick, 0.008, 0.004), {"iterations": 40, "cone": "x"}
    case = chosen.case(variant, ours, test="t", folder=Path())
    assert (case.mode, case.own_timestep, case.base) == ("gui", 0.004, "tuned")
    assert case.changes == {**ours, "timestep": 0.008, "impratio": ratio, "cone": "pyramidal"}


def test_two_files_that_say_the_same_are_one_profile(tmp_path: Path) -> None:
    """One file by two paths, say."""
    paths = [tmp_path / "quick.toml", tmp_path / "sub" / "quick.toml"]
    paths[1].parent.mkdir()
    for path in paths:
        path.write_text('simulator = "mujoco"\n')
    labels, files = profiles_of([*map(str, paths), "tuned"])
    assert labels == (*files, "tuned")
