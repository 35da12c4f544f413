"""Adapters of other packages: one that works runs all suites without a change in this one; those
that are broken spoil no other, and are told by their reason."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from pytest_simbench.laws import LAWS
from tests.cli.command import simbench
from tests.plugin.inner import FALLING, distribution, importable, records, run_pytest, usage_error

GOOD = """
from dataclasses import replace
from pathlib import Path
from pytest_simbench.simulator import NotSupportedError
from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.sims.mujoco.settings import MuJoCoSettings

class Good(MuJoCo):
    info = replace(MuJoCo.info, name="good", title="Good")

class OnlyDefault(Good):
    profiles = {"default": MuJoCo.profiles["default"]}

class Unable(Good):
    def load(self, scene):
        raise NotSupportedError("good has no boxes")

class Picky(Good):
    info = replace(Good.info, name="picky")

    def load(self, scene):
        seen = Path(__file__).with_suffix(".seen")
        if seen.exists():
            raise NotSupportedError("good has one scene")
        seen.touch()
        super().load(scene)

class UnableLater(Good):
    info = replace(Good.info, name="late")

    def step(self):
        raise NotSupportedError("late has no steps")

class NoInfo(MuJoCo):
    info = None

class NoProfiles(MuJoCo):
    profiles = None

class Dicts(Good):
    info = replace(Good.info, name="broken09")
    profiles = {"default": {"timestep": 0.002}}

class Own(MuJoCoSettings):
    timestep: float = 0.004

class Undecorated(Good):
    info = replace(Good.info, name="broken10")
    profiles = {"default": Own()}
"""


@pytest.fixture
def site(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder on sys.path with modules of a third party."""
    folder = pytester.mkdir("site")
    (folder / "good_adapter.py").write_text(GOOD)
    (folder / "raises.py").write_text("raise ValueError('no\\nluck')")
    (folder / "exits.py").write_text("import sys; sys.exit(3)")
    importable(monkeypatch, folder)
    pytester.makepyfile(FALLING)
    return folder


BROKEN = {
    "nosuch_module:Class": "does not import: ModuleNotFoundError: No module named 'nosuch_module'",
    "good_adapter:Missing": "does not import: AttributeError: *Missing*",
    "raises:Class": "does not import: ValueError: no luck",
    "exits:Class": "does not import: SystemExit: 3",
    "good_adapter:GOOD": "does not import: *",
    "good_adapter:replace": "is no Simulator subclass",
    "good_adapter:NoInfo": "has no SimulatorInfo in its attribute info",
    "good_adapter:NoProfiles": "has no settings in its attribute profiles",
    "!!": "does not import: *",
    "good_adapter:Dicts": "has wrong settings: profile 'default' is no instance of *",
    "good_adapter:Undecorated": "has wrong settings: what the class sets counts in a *class Own",
    "good_adapter:Good": "says in its info that its name is 'good'",
}


def test_broken_adapters_end_no_other(pytester: pytest.Pytester, site: Path) -> None:
    """All kinds at once: each is told with its reason, and is an error only when it is named."""
    names = {f"broken{number:02}": value for number, value in enumerate(BROKEN)}
    entries = [f"{name} = {value}" for name, value in names.items()]
    distribution(site, "broken-sims", "\n".join([*entries, "good = good_adapter:Good"]))
    said = {
        name: f"the adapter of {name} ({value}, of broken-sims 1.0) {BROKEN[value]}"
        for name, value in names.items()
    }
    result = simbench(pytester, "list", "-v")
    assert result.ret == 0
    result.stdout.fnmatch_lines([f"{name}: BROKEN: {text}" for name, text in said.items()])
    result.stdout.fnmatch_lines(["good: Good (*", "mujoco: MuJoCo (*"])
    result = run_pytest(pytester, "--collect-only -q")
    result.stdout.fnmatch_lines(["*::test_falling?good-headless?", "*?mujoco-headless?"])
    assert "broken" not in result.stdout.str().replace("test_broken", "")
    run_pytest(pytester, "--sim=good --reps=1", passed=1)
    result = run_pytest(pytester, "--sim=broken03")
    usage_error(result, f"ERROR: {said['broken03']}")


def test_all_skips_a_broken_one_with_its_reason(pytester: pytest.Pytester, site: Path) -> None:
    distribution(site, "broken-sims", "broken = nosuch:Class")
    pytester.makepyfile(
        FALLING.replace("def ", "import pytest\n@pytest.mark.only_sim('broken')\ndef ")
    )
    result = run_pytest(pytester, "--sim=all -rs", skipped=1)
    result.stdout.fnmatch_lines(
        ["SKIPPED*the adapter of broken (nosuch:Class, of broken-sims 1.0)*"]
    )


def test_two_distributions_of_one_name(pytester: pytest.Pytester, site: Path) -> None:
    distribution(site, "first-sims", "good = good_adapter:Good")
    distribution(site, "second-sims", "good = nosuch:Other")
    sentence = (
        "good is registered by first-sims 1.0 (good_adapter:Good) and second-sims 1.0 "
        "(nosuch:Other); uninstall or rename one of them"
    )
    for arguments in (["--sim=good"], ["--sim-set=good.timestep=0.001"], ["--sim-python=good=sh"]):
        result = run_pytest(pytester, "", *arguments, ret=pytest.ExitCode.USAGE_ERROR)
        assert sorted(result.stderr.str().split()) == sorted(f"ERROR: {sentence}".split())
    result = simbench(pytester, "list", "-v")
    result.stdout.fnmatch_lines(["good: BROKEN: good is registered by *"])
    run_pytest(pytester, "--sim=mujoco --reps=1", passed=1)


def test_one_of_ours_cannot_be_taken_over(pytester: pytest.Pytester, site: Path) -> None:
    distribution(site, "second-sims", "mujoco = good_adapter:Good")
    result = run_pytest(pytester, "--sim=mujoco")
    result.stderr.fnmatch_lines(["*mujoco is registered by second-sims 1.0 *pytest-simbench*"])
    run_pytest(pytester, "--sim=pybullet --reps=1", passed=1)


def test_the_same_adapter_twice_is_no_clash(pytester: pytest.Pytester, site: Path) -> None:
    distribution(site, "first-sims", "good = good_adapter:Good")
    distribution(site, "second-sims", "good = good_adapter:Good")
    run_pytest(pytester, "--sim=good --reps=1", passed=1)


def test_odd_metadata(pytester: pytest.Pytester, site: Path) -> None:
    distribution(site, "malformed", "= x:Y")
    distribution(site, "nameless", "x = y", metadata=False)
    result = simbench(pytester, "list", "-v")
    assert result.ret == 0
    result.stdout.fnmatch_lines_random(["*BROKEN: *malformed*", "*BROKEN: *nameless*"])
    run_pytest(pytester, "--sim=mujoco --reps=1", passed=1)


@pytest.mark.parametrize("entries", ["a line that is none", b"\xff\xfe = x:Y"])
def test_metadata_that_nobody_can_read(
    pytester: pytest.Pytester, site: Path, entries: str | bytes
) -> None:
    """pytest itself does not survive it where it looks for plugins; our own registry does."""
    distribution(site, "malformed", entries)
    script = (
        "from pytest_simbench.simulator.registry import registered, registry; "
        "print(*registered()); print(*registry().unreadable)"
    )
    result = pytester.run(sys.executable, "-c", script)
    result.stdout.fnmatch_lines(
        ["*mujoco*", "the metadata of the distribution *malformed-1.0.dist-info cannot be read (*"]
    )


def test_a_profile_that_one_simulator_lacks(pytester: pytest.Pytester, site: Path) -> None:
    distribution(site, "good-sims", "good = good_adapter:OnlyDefault")
    result = run_pytest(pytester, "--collect-only -q")
    assert "mujoco-headless" in result.stdout.str()
    assert "good-headless" not in result.stdout.str()
    result = run_pytest(pytester, "--sim=good")
    usage_error(result, "*good has no settings profile 'tuned'; choose from default")
    run_pytest(pytester, "--sim=good --sim-profile=tuned,default --reps=1", passed=1, skipped=1)


def test_a_scene_that_a_simulator_cannot_hold_is_no_crash(
    pytester: pytest.Pytester, site: Path
) -> None:
    """It is skipped and told, as where a mark says so; what is missed later, or of one scene of
    several, is a crash."""
    distribution(site, "good-sims", "good = good_adapter:Unable")
    result = run_pytest(
        pytester, "--sim=good,mujoco --reps=1 --sim-output=out -rs", passed=1, skipped=1
    )
    result.stdout.fnmatch_lines(
        ["mujoco did falling: 1 repetition, none crashed.", "SKIPPED*good has no boxes"]
    )
    told = "test_falling[good-headless] was skipped: good has no boxes"
    assert told in " ".join(result.stdout.str().split())
    assert [r["simulator"] for r in records(pytester.path / "out")] == ["mujoco"]
    distribution(site, "picky-sims", "picky = good_adapter:Picky")
    run_pytest(pytester, "--sim=picky --reps=2 --sim-output=two", failed=1)
    told = [(r["status"], (r["error"] or {}).get("type")) for r in records(pytester.path / "two")]
    assert told == [("ok", None), ("failed", "SceneRefused")]
    distribution(site, "late-sims", "late = good_adapter:UnableLater")
    result = run_pytest(pytester, "--sim=late --reps=1", failed=1)
    result.stdout.fnmatch_lines(["*EngineFailed in fall (*: late has no steps)*"])


COARSER = '''
"""A third party's simulator: MuJoCo with a coarser step, under its own name."""

from dataclasses import replace

from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.sims.mujoco.settings import MuJoCoSettings


class Elsewhere(MuJoCo):
    info = replace(MuJoCo.info, name="elsewhere", title="Elsewhere")
    profiles = {
        "default": MuJoCoSettings(),
        "tuned": replace(MuJoCo.profiles["tuned"], timestep=0.002, solref=(0.004, 1.0)),
    }
'''


def test_third_party_simulator_runs_all_suites(
    pytester: pytest.Pytester, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = "elsewhere = elsewhere_simbench:Elsewhere"
    importable(
        monkeypatch, distribution(pytester.path / "site", "elsewhere-simbench", entry, COARSER)
    )
    suites = Path(request.config.rootpath, "suites")
    output = pytester.path / "out"
    monkeypatch.delenv("SIMBENCH_DATA", raising=False)
    result = pytester.runpytest_subprocess(
        str(suites), "--sim=elsewhere", "--protocol=smoke", f"--sim-output={output}",
        "-k", "not test_law or free_fall", "-rs",
    )  # fmt: skip
    lacks = re.findall(
        r"SKIPPED \[(\d+)\] .*(?:the data set|and none was named|is named)", result.stdout.str()
    )
    result.assert_outcomes(passed=9, skipped=sum(map(int, lacks)), deselected=len(LAWS) - 1)
    kept = records(output)
    assert [(r["simulator"], r["task"], r["status"]) for r in kept] == [
        ("elsewhere", "free_fall", "ok"),
        ("elsewhere", "pushing", "ok"),
        ("elsewhere", "pushing_curve", "ok"),
        ("elsewhere", "stacking", "ok"),
        ("elsewhere", "throwing", "ok"),
    ]
    assert {r["settings"]["timestep"] for r in kept} == {0.002}
    assert "elsewhere: Elsewhere" in simbench(pytester, "list", "-v").stdout.str()
