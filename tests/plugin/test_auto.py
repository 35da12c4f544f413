"""`--reps auto` as users run it."""

from __future__ import annotations

import json
import re
from xml.etree import ElementTree

import pytest

from tests.plugin.inner import records

TEST = """
    from tests.tiny import Falling

    def test_decided(repeat):
        repeat(Falling()).assert_at_least("landed", 0.5)

    def test_undecided(repeat):
        repeat(Falling()).assert_at_least("landed", 0.9)

    def test_without_a_claim(repeat):
        repeat(Falling())
"""


def test_it_repeats_until_the_claims_are_decided(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(TEST)
    result = pytester.runpytest_subprocess(
        *("--sim=mujoco", "--reps=auto:12", "--sim-output=out", "--sim-jobs=4"),
        *("--junitxml=junit.xml", "--benchmark-json=b.json"),
    )
    result.assert_outcomes(passed=3)
    kept = records(pytester.path / "out")
    tests = [record["test"].split("::")[1].split("[")[0] for record in kept]
    wanted = {"test_decided": 10, "test_undecided": 12, "test_without_a_claim": 10}
    assert {name: tests.count(name) for name in wanted} == wanted
    result.stdout.fnmatch_lines(["UNDECIDED test_undecided: *>= 90 %: mujoco *"])
    told = re.findall(r"repetition (\d+) of (\d+)", result.stdout.str())
    assert told
    assert [pair for pair in told if int(pair[0]) > int(pair[1])] == []
    # What pytest-benchmark and JUnit are told is known when the test has ended only.
    saved = json.loads((pytester.path / "b.json").read_text())["benchmarks"]
    assert [b["stats"]["rounds"] for b in saved] == [10, 12, 10]
    found = ElementTree.parse(pytester.path / "junit.xml").iterfind(
        ".//property[@name='repetitions']"
    )
    assert [item.get("value") for item in found] == ["10", "12", "10"]
