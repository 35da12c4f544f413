"""Every option, by itself: its help, its bad values on the command line and in the ini file.

The tests go through `OPTIONS`, so that a new option is covered as soon as it is there.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, repeat
from pathlib import Path

import pytest

from pytest_simbench.cli.values import Auto, BadValue, flag
from pytest_simbench.plugin import options, registration
from pytest_simbench.plugin.old_options import OLD_OPTIONS
from pytest_simbench.plugin.options import OPTIONS, Option
from pytest_simbench.plugin.selection import parse, select
from pytest_simbench.simulator import registry
from tests.plugin.conftest import Configure
from tests.plugin.inner import run_pytest

NAMES = [option.name for option in OPTIONS]

BAD = {
    "empty": "", "blank": " ", "comma": ",", "equals": "=", "x": "x", "negative": "-1",
    "zero": "0", "too large": "1e999", "huge": "9" * 40, "nan": "nan", "inf": "inf",
    "minus inf": "-inf", "digits of another script": "１２", "umlaut": "ü", "long": "x" * 10_000,
    "long list": "x," * 5_000, "NUL": "a\0b", "escape": "\x1b[31m", "line end": "a\nb",
    "half a word": "\ud800", "per cent": "%s", "quote": "'", "slashes": "//", "dashes": "a--b",
    "unbalanced": "mujoco=", "no key": "=3", "twice": "mujoco.timestep=1,mujoco.timestep=1",
}  # fmt: skip

PATHS = BAD.keys() - {"empty", "blank", "long", "long list", "NUL", "half a word"}
FINE = {
    "sim_jitter": {"zero"}, "sim_seed": {"zero"},
    "sim_output": PATHS, "sim_baseline": PATHS, "sim_resume": PATHS, "sim_badge": PATHS,
    "sim_data": PATHS, "sim_scene": PATHS,
    "sim_gui": {"zero"}, "sim_headless": {"zero"}, "sim_fresh": {"zero"}, "sim_pictures": {"zero"},
    "sim_install_missing": {"zero"},
    "sim_strict": {"zero"}, "sim_crashes": {"zero"},
}  # fmt: skip
"""Values that an option may have after all."""

LATER = {"sim_profile"}
"""Options of names that are looked up when they are used: any word will do for a start."""


def checked(config: pytest.Config) -> None:
    """What is checked before anything is collected."""
    options.values(config)
    select(config)


def complaint(configure: Configure, arguments: Sequence[str]) -> str:
    """What is said of a command line; nothing when it is fine."""
    try:
        checked(configure(*arguments))
    except pytest.UsageError as error:
        return str(error)
    return ""


def is_sentence(text: str, name: str) -> bool:
    """Whether a message is one short line that names the option."""
    option = options.option(name)
    return (
        any(known in text for known in (option.flag, option.sure, name, "simulator"))
        and len(text) < 600
        and "\n" not in text
        and text.isprintable()
    )


def bad(option: Option) -> dict[str, str]:
    """The values that an option must refuse."""
    fine = set(FINE.get(option.name, ()))
    if option.name in LATER:
        words = r"[^,\s\x00-\x1f\ud800]{1,100}"
        fine = {w for w, text in BAD.items() if re.fullmatch(rf"{words}(,{words})?", text)}
    return {what: text for what, text in BAD.items() if what not in fine}


@pytest.mark.parametrize("name", [o.name for o in OPTIONS if o.type is not flag])
def test_bad_values(configure: Configure, name: str) -> None:
    """Most are refused by their form alone; the others when they are looked up."""
    option = options.option(name)
    found = {}
    for what, text in bad(option).items():
        try:
            option.value([text])
        except BadValue as error:
            found[what] = error.sentence(option.flag)
        else:
            found[what] = complaint(configure, [f"{option.flag}={text}"])
    assert {what: text for what, text in found.items() if not is_sentence(text, name)} == {}


@pytest.mark.parametrize("name", [o.name for o in OPTIONS if o.ini])
def test_bad_values_in_the_ini_file(configure: Configure, name: str) -> None:
    texts = bad(options.option(name))
    found = {
        what: complaint(configure, ["-o", f"{name}={texts[what]}"])
        for what in ("empty", "quote", "escape", "half a word")
        if what in texts
    }
    assert {what: text for what, text in found.items() if not is_sentence(text, name)} == {}


@pytest.mark.parametrize("name", [o.name for o in OPTIONS if o.type is flag and o.ini])
@pytest.mark.parametrize(("word", "value"), [("yes", True), ("TRUE", True), ("off", False)])
def test_ini_flags(configure: Configure, name: str, word: str, value: bool) -> None:
    assert options.value(configure("-o", f"{name}={word}"), name) is value


@pytest.mark.parametrize("option", [o for o in OPTIONS if o.long], ids=lambda o: o.flag)
def test_the_sure_name_is_the_same_option(configure: Configure, option: Option) -> None:
    words = {"--sim": "mujoco", "--robot": "ur5", "--reps": "3", "--protocol": "smoke"}
    word = {**words, "--jitter": "2", "--policies": __file__}.get(option.flag)
    value = [] if word is None else [word]
    by_flag = options.value(configure(option.flag, *value), option.name)
    by_long = options.value(configure(option.long, *value), option.name)
    assert by_flag == by_long != option.default
    for name in option.ini_names:
        ini = f"{name}={word or 'true'}"
        assert options.value(configure("-o", ini), option.name) == by_flag


def test_values_that_are_given_in_parts(configure: Configure) -> None:
    config = configure(
        "--sim=mujoco,pybullet", "--sim=drake", "--sim-set=mujoco.timestep=1,pybullet.timestep=2",
        "--sim-spec=mujoco=popen//python=a,b=c d", "--sim-resume", "--reps=auto:7",
    )  # fmt: skip
    found = options.values(config)
    assert found["sim_name"] == ["mujoco", "pybullet", "drake"]
    assert found["sim_set"] == {"mujoco.timestep": "1", "pybullet.timestep": "2"}
    assert found["sim_spec"] == {"mujoco": "popen//python=a,b=c d"}
    assert found["sim_reps"] == Auto(7)
    assert found["sim_resume"] is True


def test_lists_in_the_ini_file(configure: Configure) -> None:
    Path("pytest.ini").write_text(
        """\
[pytest]
sim_name = mujoco pybullet,drake
sim_set = mujoco.timestep=0.001
    pybullet.timestep=0.002
sim_python = mujoco=/a b/python, 3
    pybullet=~/x
"""
    )
    found = options.values(configure())
    assert found["sim_name"] == ["mujoco", "pybullet", "drake"]
    assert found["sim_set"] == {"mujoco.timestep": "0.001", "pybullet.timestep": "0.002"}
    assert found["sim_python"] == {"mujoco": "/a b/python, 3", "pybullet": "~/x"}


def test_the_same_in_pyproject(configure: Configure) -> None:
    Path("pyproject.toml").write_text(
        '[tool.pytest.ini_options]\nsim_name = ["mujoco", "drake"]\nreps = "5"\ngui = "maybe"\n'
    )
    config = configure()
    with pytest.raises(pytest.UsageError, match="^the ini option gui=maybe: give true or false$"):
        options.values(config)


def test_any_help_text_renders(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """argparse expands %, in whichever text it stands."""
    texts = chain(["50 %", "100 %, and %(prog)s %d", "%"], repeat("fine"))
    changed = [
        replace(option, help=text, rare=False) for option, text in zip(OPTIONS, texts, strict=False)
    ]
    monkeypatch.setattr(registration, "OPTIONS", changed)
    assert pytester.inline_run("--help").ret == 0


def test_help_shows_an_option_once_and_no_old_one(pytester: pytest.Pytester) -> None:
    result = run_pytest(pytester, "--help", ret=0)
    shown = " ".join(result.stdout.str().split())
    for option in OPTIONS:
        assert (f" {option.flag}" in shown.partition("[pytest] ")[0]) is not option.rare
        assert (" ".join(option.help.split()) in shown) is not option.rare
        assert all(f" {name} (" in shown for name in option.ini_names)
    old = {*(o.long for o in OPTIONS if o.long), *(c.flag for c in OLD_OPTIONS)}
    assert [name for name in old if re.search(rf"{name}[ =]", shown)] == []


@pytest.mark.parametrize(
    "command",
    ["--markers", "--fixtures-per-test", "--setup-plan", "--trace-config --collect-only"],
)
def test_informational_commands(pytester: pytest.Pytester, command: str) -> None:
    pytester.makepyfile("def test_it(repeat):\n    pass\n")
    run_pytest(pytester, command, ret=0)


def test_without_a_name_every_simulator_is_meant(configure: Configure) -> None:
    every = tuple(registry.known())
    assert parse(configure()).simulators == parse(configure("--sim=all")).simulators == every
    first, *others = every
    assert parse(configure(f"--sim={first}")).simulators == (first,)
    assert parse(configure(f"--sim={others[0]},all")).simulators == every


def test_a_profile_of_a_file(configure: Configure) -> None:
    pytest.importorskip("mujoco")
    text = 'simulator = "mujoco"\n[settings]\ntimestep = 0.004\n'
    Path("quick.toml").write_text(text)
    Path("wrong.toml").write_text(text.replace("mujoco", "mujoko"))
    selection = select(configure("--sim-profile=quick.toml,tuned", "--sim=mujoco"))
    label, tuned = selection.profiles
    assert (label[:6], tuned) == ("quick-", "tuned")
    assert selection.settings("mujoco", label).timestep == 0.004
    for words, message in (
        ("--sim-profile=quick.toml --sim=drake", "quick.toml is a profile of mujoco, not of drake"),
        ("--sim-profile=wrong.toml", "wrong.toml: unknown simulator 'mujoko'; choose from "),
        ("--sim-profile=no.toml", "cannot read the profile no.toml: No such file"),
        ("--sim-profile=best", "no simulator has .* 'best'; choose from .*, or give a file that"),
    ):
        with pytest.raises(pytest.UsageError, match=message):
            select(configure(*words.split()))
