"""Which bodies, links and ground of a file collide, by its masks, families and exclusions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pytest_simbench.description.carried import APPROXIMATED, CARRIED
from pytest_simbench.scene import FloatArray
from pytest_simbench.simulator import lazy_import

if TYPE_CHECKING:
    from .reading import Reading

mujoco = lazy_import("mujoco")

Pairs = tuple[tuple[str, str], ...]


def apart(reading: Reading) -> tuple[Pairs, bool]:
    """The pairs of a scene that do not collide, and whether any two links do."""
    groups = {f"body/{p.body.name}": p.geoms for p in reading.placed}
    groups |= {f"link/{link.name}": reading.geoms_of(link) for link in reading.links if link.whole}
    if reading.ground is not None:
        groups["ground"] = [reading.ground]
    names = [name for name, geoms in groups.items() if geoms]
    still = np.array(
        [n == "ground" or not reading.root_of(groups[n][0]) for n in names], dtype=bool
    )
    geoms = [geom for name in names for geom in groups[name]]
    member = np.repeat(np.arange(len(names)), [len(groups[name]) for name in names])
    share = np.zeros((len(geoms), len(names)))
    share[np.arange(len(geoms)), member] = 1.0
    meet = share.T @ collide(reading, geoms) @ share
    whole = np.outer(share.sum(axis=0), share.sum(axis=0))
    links = np.array([name.startswith("link/") for name in names], dtype=bool)
    both = np.outer(links, links)
    ask = np.triu(np.ones_like(both), 1) & ~np.outer(still, still)
    together = bool((meet[ask & both] > 0).any())
    never = ask & (meet == 0) & (~both | together)
    partly = ask & (meet > 0) & (meet < whole)
    if never.any():
        told = [f"{names[a]} and {names[b]}" for a, b in np.argwhere(never)]
        reason = f"{len(told)} pairs do not collide"
        reading.tell("geom contype, conaffinity; exclude", CARRIED, reason, told)
    if partly.any():
        told = [f"{names[a]} and {names[b]}" for a, b in np.argwhere(partly)]
        reason = "in the file some of their shapes do not collide, here all do"
        reading.tell("geom contype, conaffinity (of single shapes)", APPROXIMATED, reason, told)
    pairs = [(names[a], names[b]) for a, b in np.argwhere(never).tolist()]
    if reading.ground is None:  # the scene has one, which is not the file's
        pairs += [("ground", name) for name in names if name.startswith("link/")]
    return tuple(pairs), together


def collide(reading: Reading, geoms: list[int]) -> FloatArray:
    """1 for each two of these that MuJoCo lets collide, else 0: its rules, from its documentation
    ("Computation, Collision detection"): same body, parent and child, masks; pairs by name do."""
    model, off = reading.model, mujoco.mjtDisableBit
    if model.opt.disableflags & (off.mjDSBL_CONTACT | off.mjDSBL_CONSTRAINT):
        return np.zeros((len(geoms), len(geoms)))
    kind, affinity = model.geom_contype[geoms], model.geom_conaffinity[geoms]
    meet = (kind[:, None] & affinity) | (affinity[:, None] & kind) > 0
    body = model.geom_bodyid[geoms]
    weld = model.body_weldid[body]
    above = model.body_weldid[model.body_parentid[weld]]
    meet &= weld[:, None] != weld
    if not model.opt.disableflags & off.mjDSBL_FILTERPARENT:
        family = (weld[:, None] == above) | (above[:, None] == weld)
        meet &= ~(family & (weld[:, None] != 0) & (weld != 0))
    signature = (np.minimum(body[:, None], body) << 16) + np.maximum(body[:, None], body)
    meet &= ~np.isin(signature, model.exclude_signature)
    at = {geom: k for k, geom in enumerate(geoms)}
    for first, second in zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True):
        if first in at and second in at:
            meet[at[first], at[second]] = meet[at[second], at[first]] = True
    return meet.astype(float)
