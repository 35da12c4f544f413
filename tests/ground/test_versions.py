"""Names with a version in them."""

from __future__ import annotations

import pytest

from pytest_simbench.ground.versions import VersionedName, covers, release_numbers


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("mujoco", ("mujoco", "", "")),
        ("mujoco==3.3.7", ("mujoco", "==", "3.3.7")),
        ("a-b_c==0.7.0.74035321", ("a-b_c", "==", "0.7.0.74035321")),
        ("mujoco@4.1.0.dev3+g12ab", ("mujoco", "@", "4.1.0.dev3+g12ab")),
        ("mujoco==", ("mujoco==", "", "")),
        ("mujoco==1 2", ("mujoco==1 2", "", "")),
    ],
)
def test_a_name_taken_apart(text: str, parts: tuple[str, str, str]) -> None:
    name = VersionedName.of(text)
    assert (name.base, name.kind, name.which) == parts


def test_a_bare_name_means_all_versions() -> None:
    assert covers("mujoco", "mujoco==3.3.7")
    assert covers("mujoco==3.3.7", "mujoco==3.3.7")
    assert not covers("mujoco==3.3.7", "mujoco")
    assert not covers("mujoco==3.3.7", "mujoco==3.3.6")


def test_versions_are_compared_by_their_numbers() -> None:
    assert release_numbers("3.10.0") > release_numbers("3.9.2.dev1") > release_numbers("3.9")
    assert release_numbers("1.0") == release_numbers("1")
