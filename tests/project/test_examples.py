"""What the pages tell users to type does what they say."""

from __future__ import annotations

import re
import shlex
import sys
import textwrap
from pathlib import Path

import pytest
import yaml

from pytest_simbench.measure.limits import parse_limits
from pytest_simbench.tasks import Stacking, Throwing

DOCS = Path(__file__).resolve().parents[2] / "docs"


def block(page: str, language: str, number: int = 0) -> str:
    """A block of code on a page."""
    text = (DOCS / page).read_text("utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)[number]


@pytest.mark.parametrize(
    ("page", "shown"),
    [
        (
            "write_a_task.md",
            ("*2/2 cubes landed*", "simulator * landed % *", "mujoco * 0 of 5 * 100 [[]*"),
        ),
        ("extending/arm.md", ("*1/1 cubes pushed*",)),
        ("policies.md", ("*1/1 goals reached*", "*test_reach: success >= 80 %*")),
    ],
)
def test_tasks(pytester: pytest.Pytester, page: str, shown: tuple[str, ...]) -> None:
    pytester.makepyfile(test_mine=block(page, "python"))
    result = pytester.runpytest_subprocess("test_mine.py", "--sim=mujoco", "--reps=5")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(shown)


def test_a_rate_that_fits_no_step_is_told_in_a_sentence(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_mine=block("policies.md", "python").replace("10.0  # Hz", "30.0"))
    result = pytester.runpytest_subprocess("test_mine.py", "--sim=mujoco", "--reps=5")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines("a policy at 30 Hz is asked every 33.33 ms, which is no multiple*")
    result.stdout.no_fnmatch_line("*closed_loop.py*")


def commands(program: str) -> list[tuple[str, str]]:
    """Page and command line, of each line that begins with the program; $VARIABLES are 1."""
    found = []
    for path in sorted([DOCS.parent / "README.md", *DOCS.glob("*.md"), *DOCS.glob("e*/*.md")]):
        text = re.sub(r" *\\\n *", " ", path.read_text("utf-8"))
        for line in re.findall(rf"^(?:    )?({program} [^`\n]*)$", text, re.MULTILINE):
            found.append((path.name, re.sub(r"\$\(\(.*?\)\)|\$\w+", "1", line)))
    return found


@pytest.mark.parametrize(("page", "line"), commands("pytest"))
def test_commands_for_pytest_are_understood(
    pytester: pytest.Pytester, page: str, line: str
) -> None:
    """No page names an option that is not there, or a value that is none; nothing is run."""
    _, *words = shlex.split(line, comments=True)
    config = pytester.parseconfig(*words)
    for word in words:
        if word.startswith("suites/"):
            assert (DOCS.parent / word).exists()
    assert config.invocation_params.args


@pytest.mark.parametrize(("page", "line"), commands("simbench"))
def test_commands_of_simbench_are_understood(page: str, line: str) -> None:
    main = pytest.importorskip("pytest_simbench.cli.main")
    _, *words = shlex.split(line, comments=True)
    _, left = main.parser().parse_known_args(words)
    assert not left


def test_example_workflow(pytester: pytest.Pytester) -> None:
    """Save a run and compare with it, by the commands of the file but for the size of the work."""
    text = (DOCS / "example_workflow.yml").read_text("utf-8")
    save, gate = (
        re.sub(r'["#]|--reps=20', "", command).split()
        for command in re.findall(r"pytest (--pyargs (?:.|\n#? +)*?)(?=\n#?\n|\n      -)", text)
    )
    smallest = ("--protocol=smoke", "--reps=1")
    assert pytester.runpytest_subprocess(*save, *smallest).ret == 0
    result = pytester.runpytest_subprocess(*gate, *smallest)
    assert result.ret == 1
    (told,) = {line for line in result.outlines if line.startswith("FAILED")}
    assert told == "FAILED no limit can fail with so few repetitions; raise --reps in both runs"


def test_build_workflow(pytester: pytest.Pytester) -> None:
    """Its commands name suites and options that there are, and its kit is one; nothing is run."""
    text = (DOCS / "build_workflow.yml").read_text("utf-8")
    (kit,) = re.findall(r"<<END\n(.*?)\n +END", text, re.DOTALL)
    pytester.makepyfile(test_kit=textwrap.dedent(kit).replace("build/bin/python", sys.executable))
    commands = re.findall(r"pytest (--pyargs (?:.|\n +)*?)(?=\n +- )", text)
    assert len(commands) == 3
    typed = re.findall(r'--sim-compare-fail="(.*)"', text)[0]
    metrics = [metric for task in (Stacking(), Throwing()) for metric in task.metrics]
    assert len(parse_limits(typed, metrics)) == 3
    line = " ".join(commands).replace('"', "").replace("build/bin/python", sys.executable)
    line = line.replace("=mujoco==4.0.0,", f"=mujoco@last={sys.executable},")  # not installed here
    words = line.replace("mujoco==4.0.0", "mujoco@last").split()
    words = [word for word in words if word not in ("--pyargs", "--sim-install-missing")]
    result = pytester.runpytest_subprocess("--collect-only", "--pyargs", *words, "test_kit.py")
    assert result.ret == 0
    result.stdout.fnmatch_lines(
        ["*test_stacking[[]mujoco@build-headless[]]*", "*test_throwing[[]mujoco@build-headless[]]*",
         "*test_law[[]mujoco@build-headless-tower[]]*",
         "*test_conformance[[]mujoco-tuned-slides_flat[]]*"]
    )  # fmt: skip


def test_watch_workflow() -> None:
    """Its command is one, and what a watch saw is found again by the next one."""
    text = (DOCS / "watch_workflow.yml").read_text("utf-8")
    steps = yaml.safe_load(text)["jobs"]["watch"]["steps"]
    lines = [step["run"] for step in steps if "simbench watch" in step.get("run", "")]
    (_, *words), *others = map(shlex.split, lines)
    given = pytest.importorskip("pytest_simbench.cli.main").parser().parse_args(words)
    assert not others
    assert steps[-1]["with"] == {"name": "watch", "path": given.output}
    assert f"--name=watch --dir={given.output}" in text
