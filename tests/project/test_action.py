"""What `action.yml` does on GitHub, with a stand-in for `gh`: one comment, written or changed."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
ACTION = yaml.safe_load((ROOT / "action.yml").read_text("utf-8"))
STEPS: dict[str, dict[str, Any]] = {
    step["id"]: step for step in ACTION["runs"]["steps"] if "id" in step
}

GH = """#!/bin/bash
echo "$*" >> calls
case "$*" in
    *-X*) exit "${REFUSED:-0}" ;;
    *) echo "$FOUND" ;;
esac
"""

PYTEST = """#!/bin/bash
if [[ $1 == -c ]]; then exec python3 "$@"; fi
printf '%s\\n' "$@" > calls
exit 3
"""

pytestmark = pytest.mark.skipif(not shutil.which("bash"), reason="this machine has no bash")


def program(folder: Path, name: str, text: str) -> None:
    path = folder / "bin" / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)


def run(folder: Path, step: str, **variables: str) -> str:
    """Run a step's script as GitHub does; its output."""
    result = subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", STEPS[step]["run"]],
        cwd=folder, capture_output=True, text=True, check=True,
        env={
            "PATH": f"{folder / 'bin'}:{os.environ['PATH']}",
            "RUNNER_TEMP": str(folder), "GITHUB_REPOSITORY": "some/one",
            "GITHUB_OUTPUT": str(folder / "output"), "FOLDER": "out", **variables,
        },
    )  # fmt: skip
    return result.stdout


def comment(folder: Path, **variables: str) -> tuple[list[str], str, str]:
    """What `gh` was called with, the comment, and what the log shows."""
    program(folder, "gh", GH)
    shown = run(folder, "comment", KEY="k", NUMBER="7", GH_TOKEN="x", **variables)
    body = (folder / "simbench-comment.md").read_text("utf-8")
    return (folder / "calls").read_text().splitlines(), body, shown


def test_pytest_gets_its_arguments_as_quoted_and_the_status_is_kept(tmp_path: Path) -> None:
    program(tmp_path, "python", PYTEST)
    run(tmp_path, "compare", ARGUMENTS="test_a.py --sim=mujoco -k 'this or that'")
    words = (tmp_path / "calls").read_text().splitlines()
    expected = ["test_a.py", "--sim=mujoco", "-k", "this or that", "--sim-output=out"]
    assert words == ["-m", "pytest", *expected]
    assert (tmp_path / "output").read_text() == "status=3\n"


@pytest.mark.parametrize(
    ("found", "written"),
    [
        ("", "-X POST repos/some/one/issues/7/comments"),
        ("41\n42", "-X PATCH repos/some/one/issues/comments/41"),
    ],
)
def test_the_first_run_writes_the_comment_and_later_ones_change_it(
    tmp_path: Path, found: str, written: str
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "report.md").write_text("# Report\n")
    calls, body, shown = comment(tmp_path, FOUND=found)
    assert len(calls) == 2
    assert written in calls[1]
    assert body == "<!-- pytest-simbench k -->\n# Report\n"
    assert shown == ""


def test_a_long_report_is_cut_between_characters_and_a_missing_one_told(tmp_path: Path) -> None:
    assert "left no report" in comment(tmp_path, FOUND="")[1]
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "report.md").write_text("a" + "ü" * 50_000, "utf-8")
    _, body, _ = comment(tmp_path, FOUND="")
    assert 30_000 < len(body) < 65_536
    assert body.endswith("ü")


def test_who_may_not_comment_fails_nothing(tmp_path: Path) -> None:
    _, _, shown = comment(tmp_path, FOUND="", REFUSED="1")
    assert shown.startswith("::warning::no comment was written")


def test_every_input_is_used_and_reaches_a_script_as_a_variable_alone() -> None:
    """A text that is put into a script could be run by it."""
    text = (ROOT / "action.yml").read_text("utf-8")
    assert [name for name in ACTION["inputs"] if f"inputs.{name}" not in text] == []
    scripts = [step["run"] for step in ACTION["runs"]["steps"] if "run" in step]
    assert [script for script in scripts if "${{" in script] == []
