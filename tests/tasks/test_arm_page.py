"""The task on the page about the arm's verbs does what the page says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pytest_simbench.tasks.arm import Arm
from pytest_simbench.tasks.manipulator import Manipulator

PAGE = Path(__file__).parents[2] / "docs" / "extending" / "arm.md"


def test_the_cube_is_pushed_to_its_goal(pytester: pytest.Pytester) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    pytester.makepyfile(test_pushing=code)
    result = pytester.runpytest_subprocess("--sim=mujoco", "--reps=5")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["*repetition 5 of 5  ok after * s  1/1 cubes pushed*"])


@pytest.mark.parametrize(("owner", "count"), [(Arm, 8), (Manipulator, 6)])
def test_every_verb_of_the_page_is_there(owner: type[Arm], count: int) -> None:
    table = PAGE.read_text("utf-8").partition(f"| verb of `{owner.__name__}` |")[2]
    verbs = re.findall(r"`(\w+)\(", table.partition("\n\n")[0])
    assert len(verbs) == count
    assert [name for name in verbs if name not in vars(owner)] == []
