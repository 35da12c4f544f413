"""Old options that are commands now, and engines of an untested version."""

from __future__ import annotations

import pytest

from pytest_simbench.cli import main
from pytest_simbench.plugin import old_options
from tests.cli.command import simbench
from tests.plugin.conftest import Configure
from tests.plugin.inner import FALLING, distribution, importable, run_pytest, usage_error


def old(configure: Configure, monkeypatch: pytest.MonkeyPatch, *words: str) -> list[str]:
    """What the command is asked for by an old option."""
    given: list[list[str]] = []
    monkeypatch.setattr(main, "main", lambda words: given.append(words) or 0)
    config = configure(*words)
    command = old_options.asked(config)
    assert old_options.run_command(config, command) == 0
    return given[0]


@pytest.mark.parametrize(
    ("words", "command"),
    [
        ("--sims", "list -v"),
        ("--sim-list --sim=mujoco", "list -v"),
        ("--robots", "robots"),
        ("--sim-robots --robot=ur5", "robots ur5"),
        ("--sim-install genesis,newton --sim-install x", "install genesis newton x"),
        ("--sim-uninstall=genesis", "uninstall genesis"),
        ("--sim-environments", "environments"),
        ("--sim-download=cube_tosses --sim-data=d", "download cube_tosses --data d"),
        ("--sim-merge a b --sim-merge c --sim-output=d", "merge a b c --output d"),
        ("-v --sim-report a --sim-badge=b --sim-record=mcap",
         "report a --badge b --record mcap -v"),
    ],
)  # fmt: skip
def test_an_old_option_is_a_command(
    configure: Configure,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: str,
    command: str,
) -> None:
    assert old(configure, monkeypatch, *words.split()) == command.split()
    assert f"will go with the next release; write: simbench {command}\n" in capsys.readouterr().err


@pytest.mark.parametrize(("status", "code"), [(0, 0), (1, 1), (main.BAD_INPUT, 4), (130, 2)])
def test_the_run_ends_as_the_command_does(
    configure: Configure, monkeypatch: pytest.MonkeyPatch, status: int, code: int
) -> None:
    monkeypatch.setattr(main, "main", lambda words: status)
    config = configure("--sim-environments")
    assert old_options.run_command(config, old_options.asked(config)) == code


def test_an_old_option_that_cannot_be(pytester: pytest.Pytester) -> None:
    result = run_pytest(pytester, "--sim-merge none")
    usage_error(
        result,
        "--sim-merge will go with the next release; write: simbench merge none",
        "simbench merge: none: cannot read records from *",
    )


ADAPTERS = """
from dataclasses import replace
from pytest_simbench.sims.mujoco.adapter import MuJoCo

class Newer(MuJoCo):
    info = replace(MuJoCo.info, name="newer", tested_version="3.9.0")

class Unlisted(MuJoCo):  # as an engine of the system, which is no Python package
    info = replace(MuJoCo.info, name="unlisted", distribution="no-such-package")
"""


def test_an_untested_version_runs_and_is_named(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    entries = "newer = newer:Newer\nunlisted = newer:Unlisted"
    importable(monkeypatch, distribution(pytester.path / "site", "newer", entries, ADAPTERS))
    pytester.makepyfile(test_it=FALLING)
    result = run_pytest(pytester, "--sim=newer --reps=1 --sim-output=out", ret=0)
    result.stdout.fnmatch_lines(["*UNTESTED VERSION: mujoco * is here, the*"])
    result = simbench(pytester, "list", "-v")
    result.stdout.fnmatch_lines(
        ["newer: *", "*UNTESTED*", "unlisted: *", "    version not known, installed"]
    )
