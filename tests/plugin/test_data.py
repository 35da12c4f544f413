"""`--sim-data` and the fixture `data_set`."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.data import tosses
from tests.data.samples import falling

TEST = """
from pytest_simbench.tasks import Tossing

def test_tossing(repeat, data_set):
    repeat(Tossing(data_set("{name}")))
"""


def test_a_set_is_read_from_the_folder_and_each_toss_is_a_repetition(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("SIMBENCH_DATA", raising=False)
    pytester.makepyfile(TEST.format(name="cube_tosses"))
    folder = pytester.mkdir("here")
    path = folder / "contactnets_cube_tosses_3.npz"
    tosses.write(path, [1, 2, 3], [falling(5), falling(6), falling(7)])
    result = pytester.runpytest_subprocess("--sim=mujoco", "--sim-data=here")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["tossing: 2 repetitions, protocol fast"])


@pytest.mark.parametrize(
    ("content", "name", "outcome", "sentence"),
    [
        (None, "cube_tosses", "skipped", "*is not in *: simbench download cube_tosses*"),
        (b"x", "cube_tosses", "failed", "*contactnets_cube_tosses_1.npz holds no arrays*"),
        (None, "nosuch", "failed", "*no data set 'nosuch'; choose from cube_tosses*"),
    ],
)
def test_what_is_not_there_or_broken_is_one_sentence(
    pytester: pytest.Pytester, content: bytes | None, name: str, outcome: str, sentence: str
) -> None:
    pytester.makepyfile(TEST.format(name=name))
    folder = Path(pytester.mkdir("here"))
    if content is not None:
        (folder / "contactnets_cube_tosses_1.npz").write_bytes(content)
    result = pytester.runpytest_subprocess("--sim=mujoco", "--sim-data=here", "-rsf")
    result.assert_outcomes(**{outcome: 1})
    result.stdout.fnmatch_lines([sentence])
    assert "Traceback" not in result.stdout.str()
