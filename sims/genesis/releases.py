"""Where Genesis' releases differ for this adapter."""

from __future__ import annotations

from typing import Any

from pytest_simbench.scene import FloatArray
from pytest_simbench.simulator import lazy_import

genesis = lazy_import("genesis")

OLDEST = "1.2.3"
"""The oldest one that runs: before, there was no elliptic friction cone, which the profile `tuned`
asks for (1.0.0, 1.1.2 and 1.2.0 to 1.2.2 have no `genesis.friction_cone`)."""


def centre_of_mass() -> Any:
    """How a link's centre of mass is named where one asks for its velocity or pushes there: 1.4
    has an enumeration for it, the older one a text."""
    frames = getattr(genesis, "link_ref_frame", None)
    return "link_com" if frames is None else frames.link_COM


def contact_parameters(geom: Any) -> FloatArray:
    """What a shape's contacts are solved with, as MuJoCo's `solref` and `solimp`, (7,).

    The shape of 1.4 has a method for it, the older one a property.
    """
    told = geom.get_sol_params() if hasattr(geom, "get_sol_params") else geom.sol_params
    parameters: FloatArray = told.cpu().numpy().copy()
    return parameters


def of_collider(collider: Any, name: str) -> Any:
    """Its `collider_state` or `collider_info`: before 1.4 their names began with `_`."""
    return getattr(collider, name, None) or getattr(collider, f"_{name}")
