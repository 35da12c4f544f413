"""Every option, by itself: its help, its bad values on the command line and in the ini file.

The tests go through `OPTIONS`, so that a new option is covered as soon as it is there.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import pytest

from pytest_simbench.plugin import options
from pytest_simbench.plugin.options import OPTIONS, Option
from pytest_simbench.plugin.selection import select

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
    "sim_output": PATHS, "sim_baseline": PATHS, "sim_resume": PATHS, "sim_merge": PATHS,
    "sim_report": PATHS, "sim_badge": PATHS, "sim_data": PATHS,
    "sim_gui": {"zero"}, "sim_headless": {"zero"}, "sim_fresh": {"zero"}, "sim_pictures": {"zero"},
    "sim_install_missing": {"zero"},
    "sim_bisect": {"minus inf"},  # where a second value is missing then, for argparse
    "sim_strict": {"zero"}, "sim_crashes": {"zero"},
}  # fmt: skip
"""Values that an option may have after all."""

LATER = {"sim_download", "sim_install", "sim_profile", "sim_uninstall"}
"""Options of names that are looked up when they are used: any word will do for a start."""

Configure = Callable[..., pytest.Config]


@pytest.fixture
def configure(pytester: pytest.Pytester) -> Configure:
    return pytester.parseconfig


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
        any(known in text for known in (*option.flags, name, "simulator"))
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


@pytest.mark.parametrize("name", [o.name for o in OPTIONS if not o.kind.flag])
def test_bad_values_on_the_command_line(configure: Configure, name: str) -> None:
    option = options.option(name)
    found = {
        what: complaint(configure, [f"{option.flag}={text}"]) for what, text in bad(option).items()
    }
    if option.arguments.get("nargs") in ("+", 2):
        more = ["placed"] if option.arguments["nargs"] == 2 else []
        found = {w: complaint(configure, [option.flag, t, *more]) for w, t in bad(option).items()}
    assert {what: text for what, text in found.items() if not is_sentence(text, name)} == {}


@pytest.mark.parametrize("name", [o.name for o in OPTIONS if o.ini])
def test_bad_values_in_the_ini_file(pytester: pytest.Pytester, name: str) -> None:
    option = options.option(name)
    found = {}
    for what, text in bad(option).items():
        config = pytester.parseconfig("-o", f"{name}={text}")
        try:
            checked(config)
        except pytest.UsageError as error:
            found[what] = str(error)
        else:
            found[what] = ""
    assert {what: text for what, text in found.items() if not is_sentence(text, name)} == {}


@pytest.mark.parametrize("name", [o.name for o in OPTIONS if o.kind.flag and o.ini])
@pytest.mark.parametrize(("word", "value"), [("yes", True), ("TRUE", True), ("off", False)])
def test_ini_flags(pytester: pytest.Pytester, name: str, word: str, value: bool) -> None:
    assert options.value(pytester.parseconfig("-o", f"{name}={word}"), name) is value


def test_jobs_auto_takes_the_cores_that_pytest_may_use(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda pid: {0, 1, 3})
    assert options.value(pytester.parseconfig("--sim-jobs=auto"), "sim_jobs") == 3
    assert options.value(pytester.parseconfig("-o", "sim_jobs=auto"), "sim_jobs") == 3


@pytest.mark.parametrize("short", [o.short for o in OPTIONS if o.short])
def test_short_names_are_the_same_option(pytester: pytest.Pytester, short: str) -> None:
    option = next(o for o in OPTIONS if o.short == short)
    words = {"--sim": "mujoco", "--robot": "ur5", "--reps": "3", "--protocol": "smoke"}
    word = {**words, "--jitter": "2"}.get(short)
    value = [] if word is None else [word]
    by_short = options.value(pytester.parseconfig(short, *value), option.name)
    by_long = options.value(pytester.parseconfig(option.flag, *value), option.name)
    assert by_short == by_long != option.default
    if option.ini:
        ini = f"{short.lstrip('-')}={word or 'true'}"
        assert options.value(pytester.parseconfig("-o", ini), option.name) == by_long


@pytest.mark.parametrize("name", ["sim_merge", "sim_report"])
def test_runs_may_be_given_one_by_one(configure: Configure, name: str) -> None:
    flag = options.option(name).flags[0]
    config = configure(flag, "a", "b", flag, "c")
    assert options.value(config, name) == ["a", "b", "c"]


def test_values_of_every_form(pytester: pytest.Pytester) -> None:
    config = pytester.parseconfig(
        "--sim=mujoco,pybullet", "--sim=drake", "--sim-set=mujoco.timestep=1,pybullet.timestep=2",
        "--sim-spec=mujoco=popen//python=a,b=c d", "--sim-threshold=placed=.9", "--reps=auto:7",
        "--jitter=1E-3", "--sim-seed=0", "--sim-memory-limit=2e3", "--sim-resume",
    )  # fmt: skip
    found = options.values(config)
    assert found["sim_name"] == ["mujoco", "pybullet", "drake"]
    assert found["sim_set"] == {"mujoco.timestep": "1", "pybullet.timestep": "2"}
    assert found["sim_spec"] == {"mujoco": "popen//python=a,b=c d"}
    assert found["sim_threshold"] == {"placed": 0.9}
    assert found["sim_reps"] == options.Auto(7)
    assert (found["sim_jitter"], found["sim_seed"], found["sim_memory_limit"]) == (1e-3, 0, 2000)
    assert found["sim_resume"] is True


def test_lists_in_the_ini_file(pytester: pytest.Pytester) -> None:
    pytester.makeini(
        """
        [pytest]
        sim_name = mujoco pybullet,drake
        sim_set = mujoco.timestep=0.001
            pybullet.timestep=0.002
        sim_python = mujoco=/a b/python, 3
            pybullet=~/x
        """
    )
    found = options.values(pytester.parseconfig())
    assert found["sim_name"] == ["mujoco", "pybullet", "drake"]
    assert found["sim_set"] == {"mujoco.timestep": "0.001", "pybullet.timestep": "0.002"}
    assert found["sim_python"] == {"mujoco": "/a b/python, 3", "pybullet": "~/x"}


def test_the_same_in_pyproject(pytester: pytest.Pytester) -> None:
    pytester.makepyprojecttoml(
        '[tool.pytest.ini_options]\nsim_name = ["mujoco", "drake"]\nreps = "5"\ngui = "maybe"\n'
    )
    config = pytester.parseconfig()
    with pytest.raises(pytest.UsageError, match="^the ini option gui=maybe: give true or false$"):
        options.values(config)


@pytest.mark.parametrize("text", ["50 %", "100 %, and %(prog)s %d", "%"])
def test_any_help_text_renders(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    """argparse expands %, in whichever text it stands."""
    from pytest_simbench.plugin import spellings

    changed = [
        Option(o.flag, o.kind, text, metavar=o.metavar, ini=False, arguments=o.arguments)
        for o in OPTIONS
    ]
    monkeypatch.setattr(spellings, "OPTIONS", changed)
    result = pytester.inline_run("--help")
    assert result.ret == 0


def test_help_shows_every_option(pytester: pytest.Pytester) -> None:
    result = pytester.runpytest_subprocess("--help")
    assert result.ret == 0
    shown = " ".join(result.stdout.str().split())
    for option in OPTIONS:
        assert f"{option.flag}" in shown
        assert " ".join(option.help.split()) in shown
        if option.short:
            assert f" {option.short}" in shown
        if option.ini:
            assert f" {option.name} (" in shown
    assert "Traceback (" not in shown + result.stderr.str()


@pytest.mark.parametrize(
    "command",
    ["--help", "--sims", "--sim-list", "--markers", "--fixtures", "--fixtures-per-test",
     "--version", "--collect-only", "--setup-plan", "--sims --sim=mujoco", "--cache-show",
     "--trace-config --collect-only"],
)  # fmt: skip
def test_informational_commands(pytester: pytest.Pytester, command: str) -> None:
    pytester.makepyfile("def test_it(repeat):\n    pass\n")
    result = pytester.runpytest_subprocess(*command.split())
    assert result.ret == 0
    assert "Traceback (" not in result.stdout.str() + result.stderr.str()
