"""Hypothesis profiles for tests that run a simulator in each example.

Hypothesis calls `register` when it is imported (entry-point group `hypothesis`), so the profiles
are there in a conftest as well as for `--hypothesis-profile=sim-ci`, and a pytest run that does not
use Hypothesis never imports it. None of them is ever loaded here: that is the user's choice.
They silence no health check, and are the same wherever they run: they derive from Hypothesis'
`default`, not from the profile in force, which in CI is its `ci` (derandomized, `too_slow`
silenced).
"""

from __future__ import annotations

from typing import Any

PROFILES: dict[str, dict[str, Any]] = {
    "sim-dev": {"max_examples": 10, "deadline": None, "print_blob": True},
    "sim-ci": {"max_examples": 30, "deadline": None, "print_blob": True, "derandomize": True},
    "sim-night": {"max_examples": 500, "deadline": None, "print_blob": True},
}
"""By name. No deadline, as an example takes as long as its simulator; few examples while
developing; the same ones each time in CI; many, and other ones, at night."""


def register() -> None:
    """Make the profiles known to Hypothesis; the loaded profile stays as it is."""
    from hypothesis import settings

    plain = settings.get_profile("default")
    for name, values in PROFILES.items():
        settings.register_profile(name, plain, **values)
