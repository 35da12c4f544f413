"""Where Drake's releases differ for this adapter."""

from __future__ import annotations

from typing import Any

OLDEST = "1.40.0"
"""The oldest one that was tried and runs. 1.37 does not tell a shape's convex hull, which the
parity check asks for; 1.36 makes no hull of points."""


def without_sampled_ports(config: Any) -> dict[str, bool]:
    """Options that switch sampled output ports off, where a release has them: they would add state,
    and only cost time here."""
    name = "use_sampled_output_ports"
    return {name: False} if hasattr(config(), name) else {}
