"""Names of files: safe, and never shared."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.ground.names import data_digest, file_name

texts = st.text(st.characters(exclude_categories=()), max_size=300)
near = st.text(st.sampled_from("aAbB/_.-: "), max_size=6)


@given(texts | near)
def test_every_name_is_safe(text: str) -> None:
    name = file_name(text)
    assert re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.=-]{0,99}", name)
    assert not name.endswith(".")


@given(near | texts, near | texts)
def test_different_texts_have_different_names_also_where_case_is_not_told(a: str, b: str) -> None:
    if a != b:
        assert file_name(a).lower() != file_name(b).lower()
        assert file_name(a).lower() != file_name(file_name(b)).lower() or a == file_name(b)


@given(near, near, near, near)
def test_what_is_not_shown_counts(a: str, b: str, c: str, d: str) -> None:
    if (a, b) != (c, d):
        assert file_name("x", a, b) != file_name("x", c, d)
        assert file_name("x", a, b) != file_name("x")


@pytest.mark.parametrize("text", ["stacking", "leaning_towers", "a-b.c=1"])
def test_plain_names_stay(text: str) -> None:
    assert file_name(text) == text


@pytest.mark.parametrize(
    "text", ["..", ".", "", "../../victim", "/etc/passwd", "a\0b", "\udcff", "x" * 999]
)
def test_nothing_leads_anywhere(text: str, tmp_path: Path) -> None:
    path = tmp_path / f"{file_name(text)}.log"
    path.touch()
    assert path.resolve().parent == tmp_path.resolve()


def test_what_is_left_of_a_name_word_by_word() -> None:
    """Each run of unsafe characters is one underscore; ten digits of the digest follow."""
    assert re.fullmatch(r"a_b_C-[0-9a-f]{10}", file_name("a / b::C"))
    assert re.fullmatch(r"unnamed-[0-9a-f]{10}", file_name("../"))
    assert re.fullmatch(r"unnamed-[0-9a-f]{10}", file_name(""))
    assert re.fullmatch(r"x{80}-[0-9a-f]{10}", file_name("x" * 81))
    assert file_name("x" * 80) == "x" * 80
    assert re.fullmatch(r"a-0123456789-[0-9a-f]{10}", file_name("a-0123456789"))
    assert re.fullmatch(r"a-[0-9a-f]{10}", file_name("a", 1))
    assert re.fullmatch(r"X_y_X-[0-9a-f]{10}", file_name("..X y X.-"))


def test_numbers_are_alike_where_processors_differ() -> None:
    """Of about 500, and of 0. What is no number stays, and so does an infinite one."""
    same = {"far": float("-inf"), "n": 3, "t": ("a", None, Path("b"))}
    here = {"k": [545.150123097334, {"x": 6.6e-24}], **same}
    there = {**here, "k": [545.150123097335, {"x": -1e-17}]}
    assert data_digest(here, 16) == data_digest(there, 16)
    told = '{"far": -Infinity, "k": [545.1501231, {"x": 0.0}], "n": 3, "t": ["a", null, "b"]}'
    assert data_digest(there, 9) == hashlib.sha256(told.encode()).hexdigest()[:9]
    other = [{**here, "k": [545.1501232, {"x": x}]} for x in (0.0, 2e-12)]
    assert len({data_digest(one, 12) for one in (here, *other)}) == 3
