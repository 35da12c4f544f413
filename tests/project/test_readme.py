"""The README begins with a test that runs, is short, and leads somewhere."""

from __future__ import annotations

import html
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "docs"))

import made  # noqa: E402

README = (ROOT / "README.md").read_text("utf-8")
MADE = {made.DATA / f"{name}.md" for name in made.PAGES}
"""Pages that are there when the site was built."""
PAGES = [
    path
    for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md"))
    if "_build" not in path.parts and path not in MADE
]


def test_it_is_short() -> None:
    lines = README.splitlines()
    assert len(lines) <= 100
    assert [line for line in lines if len(line) > 120 and not line.startswith("|")] == []


def test_its_two_commands_are_these() -> None:
    install = "python3 -m venv .venv && .venv/bin/pip install -q -e '.[all,test]'"
    run = ".venv/bin/pytest suites/ --sim=all --reps=20"
    assert f"```sh\n{install} && {run}\n```" in README
    assert "```sh\nbash .ci/run\n```" in README


@pytest.mark.usefixtures("drawn")
def test_it_begins_with_a_test_that_runs(pytester: pytest.Pytester) -> None:
    blocks = re.findall(r"```(\w+)\n(.*?)```", README, re.DOTALL)
    (first, code), (second, command) = blocks[:2]
    assert (first, second) == ("python", "sh")
    assert len(code.splitlines()) <= 6
    pytester.makepyfile(test_throwing=code)

    result = pytester.runpytest_subprocess("test_throwing.py", "--sim=mujoco", "--protocol=smoke")

    assert command.startswith("pytest test_throwing.py --sim=mujoco")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(
        ["UNDECIDED *hit >= 80 %: mujoco *"]
    )  # one repetition is not judged


def test_the_picture_is_of_the_command() -> None:
    command = re.findall(r"```sh\n(.*)\n```", README)[0]
    picture = (ROOT / "docs" / "pictures" / "first_test.svg").read_text("utf-8")
    assert f"$ {command}" in html.unescape(picture).replace("\xa0", " ")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.DOTALL)
    targets = re.findall(r"\]\((?!https?:|#)([^)#\s]+)", text)
    paths = {target: (page.parent / target).resolve() for target in targets}
    assert [name for name, path in paths.items() if not path.exists() and path not in MADE] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_pages_name_no_machine(page: Path) -> None:
    """Paths of the machine on which a page was written."""
    assert (
        re.findall(r"(?<![\w.~])/(?:work|home|root|Users|tmp)/\S*", page.read_text("utf-8")) == []
    )
