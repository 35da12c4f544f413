"""Faults that are planted (tests/mutation.py)."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests import mutation
from tests.mutation import Asking, Fault, planted

SOURCE = """\
class A:
    def one(self, of=lambda: 2):
        def inner(): ...
        return 1

def two(): return 2
"""


def test_a_fault_stands_in_its_file_for_a_while(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mutation, "ROOT", tmp_path)
    (tmp_path / "a.py").write_text(SOURCE)
    os.utime(tmp_path / "a.py", (1, 1))
    changed = SOURCE.replace("return 1", "return 3")
    with planted(Fault("a.py", 0, 4, "", changed)) as (old, new):
        assert (tmp_path / "a.py").read_text() == changed
        assert (old.co_qualname, new.co_qualname) == ("A.one", "A.one")
        assert 1 in old.co_consts
        assert 3 in new.co_consts
    assert (tmp_path / "a.py").read_text() == SOURCE
    assert (tmp_path / "a.py").stat().st_mtime == 1


def test_those_that_reach_the_statement_are_asked_the_shortest_first() -> None:
    """One of the room counts as shorter; together they have a limit."""
    seconds = {"tests/b/test_x.py::slow": 2.0, "tests/a/test_y.py::near": 3.0,
               "tests/b/test_x.py::quick": 1.0, "tests/b/test_x.py::long": 40.0}  # fmt: skip
    learnt = {"seconds": seconds, "reach": {"p/a/m.py": {"3": [0, 1, 2, 3], "9": [3]}}}
    asking = Asking([], Path(), learnt)
    found = asking.tests(Fault("p/a/m.py", 0, 5, "", ""), dict.fromkeys(seconds))
    assert [test.partition("::")[2] for test in found] == ["near", "quick", "slow"]
    assert asking.tests(Fault("p/a/m.py", 0, 9, "", ""), dict.fromkeys(seconds)) == [*seconds][3:]
    assert asking.tests(Fault("p/b/m.py", 0, 9, "", ""), dict.fromkeys(seconds)) == []
