"""Published numbers are of these settings.

Who changes a setting of a profile measures the pages again (docs/made.py), and then its line here.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from hashlib import sha256

import pytest

from pytest_simbench.simulator.registry import adapter, registered

PUBLISHED = {
    "coppeliasim": {"default": "2d3b75f8", "tuned": "552fe23e", "real": "48756f54"},
    "dart": {"default": "898a4638", "tuned": "43e82ad0", "real": "43e82ad0"},
    "drake": {"default": "09441a8f", "tuned": "cf3c33e5", "real": "d8e9fec8"},
    "gazebo": {"default": "3def4e2e", "tuned": "5fd809f9", "real": "5fd809f9"},
    "genesis": {
        "default": "de5dd03b",
        "tuned": "22a5088c",
        "real": "22a5088c",
        "file": "aa91ebd9",
    },
    "mujoco": {
        "default": "9e12b480",
        "tuned": "59838416",
        "real": "7273ea8e",
        "file": "aeed4602",
    },
    "newton": {
        "default": "bddba8dd",
        "tuned": "2cd5fcfb",
        "real": "0c3f8545",
        "file": "aeed4602",
    },
    "ode": {"default": "f1f2c655", "tuned": "7c840eea", "real": "85bf7f2e"},
    "ovphysx": {"default": "0791bbcb", "tuned": "d65af419", "real": "e9c2722b"},
    "pybullet": {"default": "2ff35d9e", "tuned": "2684c5fd", "real": "a214713d"},
    "sapien": {"default": "67451d2d", "tuned": "c57855c2", "real": "72f5c933"},
}


def digests(name: str) -> dict[str, str]:
    """Of each profile of a simulator: what its settings are, in eight letters."""
    told = {
        profile: json.dumps(asdict(settings), sort_keys=True)
        for profile, settings in adapter(name).profiles.items()
    }
    return {profile: sha256(text.encode()).hexdigest()[:8] for profile, text in told.items()}


@pytest.mark.parametrize("name", sorted(registered()))
def test_profiles_are_those_of_the_published_numbers(name: str) -> None:
    assert digests(name) == PUBLISHED[name]
