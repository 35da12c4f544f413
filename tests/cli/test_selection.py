"""What of a run's options holds for each simulator, mode, profile and robot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from pytest_simbench.cli import selection as module
from pytest_simbench.cli.selection import Selection, check, profiles_of, robots_of
from pytest_simbench.cli.values import BadInput
from pytest_simbench.cluster.offers import PLUGIN, PYTHON, Node
from pytest_simbench.experiment.variants import Variant
from tests.motion.small_arm import small_arm

SETTINGS = """simulator = "mujoco"
base = "tuned"
[settings]
timestep = 0.004
impratio = 3
"""


@pytest.fixture
def chosen(tmp_path: Path) -> Selection:
    """A profile of a file and one of MuJoCo, changed for all of its releases, and for one."""
    path = tmp_path / "quick.toml"
    path.write_text(SETTINGS)
    labels, files = profiles_of(("default", str(path)))
    assert (labels[0], [*files]) == ("default", [labels[1]])
    changes = {"mujoco": {"impratio": "5", "cone": "pyramidal"}, "mujoco==3.3.7": {"impratio": "7"}}
    return Selection(("mujoco",), ("headless", "gui"), labels, changes, files=files)


@pytest.mark.parametrize("name", ["mujoco", "mujoco==3.3.7"])
def test_settings_are_those_of_the_profile_then_ours_then_the_user_s(
    chosen: Selection, name: str
) -> None:
    ratio = 7 if "==" in name else 5
    for label, step in zip(chosen.profiles, (0.002, 0.004), strict=True):
        given = chosen.settings(name, label, {"timestep": 0.005, "impratio": 9})
        assert (given.timestep, given.impratio, given.cone) == (0.005, ratio, "pyramidal")  # type: ignore[attr-defined]
        plain = chosen.settings(name, label)
        assert (plain.timestep, plain.impratio) == (step, ratio)  # type: ignore[attr-defined]
    case = chosen.case(
        Variant(name, "gui", chosen.profiles[1], 0.008, 0.004), {"iterations": 40, "cone": "x"},
        test="t", folder=Path(),
    )  # fmt: skip
    assert (case.simulator, case.mode, case.profile) == (name, "gui", chosen.profiles[1])
    assert (case.own_timestep, case.base, case.robot) == (0.004, "tuned", None)
    assert case.changes == {
        "timestep": 0.008, "impratio": str(ratio), "iterations": 40, "cone": "pyramidal"
    }  # fmt: skip


def test_variants_of_robots_profiles_and_steps(chosen: Selection, tmp_path: Path) -> None:
    quick = chosen.profiles[1]
    assert chosen.variants("mujoco", "gui") == [
        Variant("mujoco", "gui", "default"), Variant("mujoco", "gui", quick)
    ]  # fmt: skip
    robots = robots_of(small_arm(tmp_path))
    assert [*robots] == ["small"]
    swept = replace(chosen, robots={"": None, **robots}, sweep=(0.002, 0.001))
    assert [v[2:] for v in swept.variants("mujoco", "headless")] == [
        (profile, step, own, robot)
        for robot in ("", "small")
        for profile, step, own in (
            ("default", None, None), ("default", 0.001, 0.002),
            (quick, 0.002, 0.004), (quick, 0.001, 0.004),
        )
    ]  # fmt: skip
    assert (swept.every_robot, chosen.every_robot) == (True, False)
    unknown = replace(swept, profiles=("none",), robots={"": None})
    assert unknown.variants("mujoco", "gui") == [Variant("mujoco", "gui", "none")]


def test_why_a_simulator_is_left_out(chosen: Selection, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is usable where one profile of it is; whoever names it is told why it is not."""
    monkeypatch.setattr(module.environments, "missing", lambda info: f"no {info.title}")
    quick = chosen.profiles[1]
    assert chosen.missing("mujoco", quick) == chosen.unusable("mujoco") == "no MuJoCo"
    assert chosen.unusable("mujoco", to_install=True) is None
    elsewhere = replace(chosen, simulators=("mujoco", "drake"), pythons={"mujoco": "python"})
    assert (elsewhere.missing("mujoco", quick), elsewhere.unusable("mujoco")) == (None, None)
    assert replace(chosen, specs={"mujoco": "ssh=x"}).unusable("mujoco") is None
    assert "is a profile of mujoco, not of drake" in str(elsewhere.missing("drake", quick))
    assert elsewhere.unusable("drake") == "no Drake"  # by default
    assert elsewhere.ready().simulators == ("mujoco",)
    assert replace(elsewhere, named=("drake",)).ready().simulators == ("mujoco", "drake")
    node = Node.of("tcp://a", "lab", dict.fromkeys(["simbench", PLUGIN, PYTHON, "ode==1"], 1.0))
    assert node is not None
    cluster = replace(chosen, nodes=(node,))
    told = f"no node of the cluster offers mujoco: {node}"
    assert cluster.missing("mujoco", quick) == told
    assert cluster.missing("ode", "default") is None  # it has no window that would be needed


def test_what_cannot_run_is_refused(chosen: Selection, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module.environments, "missing", lambda info: f"no {info.title}")
    check(chosen, makes=False)
    named = replace(chosen, named=("mujoco",))
    check(named, makes=True)
    for wrong, told in (
        (named, "^no MuJoCo$"),
        (replace(chosen, profiles=("fast",)), "profile 'fast'; choose from default, tuned, .*toml"),
        (replace(chosen, sweep=(1e-3, 5.0)), "--sim-sweep=5: give time steps from"),
        (replace(chosen, pythons={"mujoco": "p"}, specs={"mujoco": "s"}), "both --sim-python and"),
        (replace(chosen, changes={"mujoco": {"cone": "round"}}), "'?cone'?"),
    ):
        with pytest.raises(BadInput, match=told):
            check(wrong, makes=False)
