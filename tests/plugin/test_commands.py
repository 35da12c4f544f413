"""`pytest --sims`, `--sim-install`, and engines of an untested version."""

from __future__ import annotations

import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from pytest_simbench.report.capabilities import capability_markdown
from pytest_simbench.simulator.registry import adapter, registered


def test_sims_lists_a_table_and_what_is_here(pytester: pytest.Pytester) -> None:
    result = pytester.runpytest_subprocess("--sims")
    assert result.ret == 0
    text = result.stdout.str()
    for name in registered():
        assert f"\n{name}: " in text
    result.stdout.fnmatch_lines(
        ["simulator *", "mujoco *Apache-2.0*", f"    version {version('mujoco')}*, installed"]
    )


def test_sims_says_what_mends_an_absent_one(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    own = [name for name in registered() if adapter(name).info.requirements]
    monkeypatch.setenv("SIMBENCH_ENVIRONMENTS", str(tmp_path))
    text = pytester.runpytest_subprocess("--sims").stdout.str()
    for name in own:
        assert f"not there yet: simbench install {name}" in text


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nosuch", "*unknown simulator*nosuch*mujoco*"),
        ("mujoco", "*mujoco needs no environment of its own*"),
    ],
)
def test_wrong_installs_are_one_sentence(
    pytester: pytest.Pytester, name: str, message: str
) -> None:
    result = pytester.runpytest_subprocess("--sim-install", name)
    assert result.ret == 4
    result.stderr.fnmatch_lines([message])
    assert "Traceback" not in result.stderr.str() + result.stdout.str()


def test_an_untested_version_runs_and_is_named(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        newer="""
from dataclasses import replace
from pytest_simbench.sims.mujoco.adapter import MuJoCo

class Newer(MuJoCo):
    info = replace(MuJoCo.info, name="newer", tested_version="3.9.0")

class Unlisted(MuJoCo):  # as an engine of the system, which is no Python package
    info = replace(MuJoCo.info, name="unlisted", distribution="no-such-package")
"""
    )
    package = pytester.mkdir("newer-1.0.dist-info")
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: newer\nVersion: 1.0\n")
    (package / "entry_points.txt").write_text(
        "[pytest_simbench.simulators]\nnewer = newer:Newer\nunlisted = newer:Unlisted\n"
    )
    pytester.makepyfile(
        test_it="""
from tests.tiny import Falling

def test_falling(repeat):
    repeat(Falling())
"""
    )
    result = pytester.run(
        sys.executable, "-c",
        "import sys, pytest; sys.path.insert(0, '.'); "
        "sys.exit(pytest.main(['--sim=newer', '--reps=1', '--sim-output=out']))",
    )  # fmt: skip
    assert result.ret == 0
    result.stdout.fnmatch_lines(["*UNTESTED VERSION: mujoco * is here, the*"])
    result = pytester.run(
        sys.executable, "-c",
        "import sys, pytest; sys.path.insert(0, '.'); sys.exit(pytest.main(['--sims']))",
    )  # fmt: skip
    result.stdout.fnmatch_lines(
        ["newer: *", "*UNTESTED*", "unlisted: *", "    version not known before it runs, installed"]
    )


def test_the_page_of_the_documentation_is_up_to_date(request: pytest.FixtureRequest) -> None:
    page = (request.config.rootpath / "docs" / "simulators.md").read_text("utf-8")
    assert capability_markdown([adapter(name).info for name in registered()]) in page
