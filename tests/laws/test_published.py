"""What docs/data/truth.csv tells of a law is what the engine does today, in the published version.

An engine repeats itself to the last digit. So whatever changes how an adapter builds, pushes or
reads a world shows here, and the page is measured again. Genesis is not asked: it compiles for the
processor, and slides otherwise on another one (docs/engines/genesis.md).
"""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from pytest_simbench.client.environments import missing
from pytest_simbench.laws import LAWS
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks.base import Jitter
from pytest_simbench.testing.subject import Subject

TRUTH = Path(__file__).parents[2] / "docs" / "data" / "truth.csv"

LONGEST = 0.3
"""CPU seconds of the stepping of a law that is asked here: Newton takes minutes for all of them."""

SAME = 0.01
"""How far from the published value, as a share of what the law allows, beside the last of its six
digits: not all processors have the same instructions."""

BY_NAME = {law.name: law for law in LAWS}


def published(simulator: str) -> dict[str, dict[str, str]]:
    """By law."""
    with TRUTH.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["profile"] == "tuned"]
    return {row["law"]: row for row in rows if row["simulator"] == simulator and row["value"]}


@pytest.mark.engine
@pytest.mark.parametrize(
    "name", ["dart", "drake", "mujoco", "newton", "ode", "ovphysx", "pybullet", "sapien"]
)
def test_laws_give_what_is_published(name: str) -> None:
    rows, engine = published(name), adapter(name)
    if absent := missing(engine.info):
        pytest.skip(absent)
    subject, odd = Subject(engine), {}
    made = subject.construct(subject.shared())
    versions = {row["version"] for row in rows.values()}
    if made.versions.get(engine.info.distribution) not in versions:
        pytest.skip(f"published is {name} {', '.join(versions)}, installed is another one")
    for law, row in rows.items():
        if float(row["cpu"]) > LONGEST:
            continue
        asked = BY_NAME[law]
        with subject.world(asked.scene(0, Jitter(0.0, 0.0))) as world:
            found = asked.perform(world, 0, lambda done, total: None).reading
        allowed = SAME * float(row["tolerance"])
        if found.value != pytest.approx(float(row["value"]), rel=1e-5, abs=allowed):
            odd[law] = f"{found.value:.6g}, published {row['value']}, allowed {row['tolerance']}"
    assert not odd
