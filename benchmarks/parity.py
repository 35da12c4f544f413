"""The table of planted faults, docs/data/planted_faults.csv: what finds each, in each engine.

    python benchmarks/parity.py [SIMULATOR ...]

Each fault of `pytest_simbench.testing.faults` is planted in each engine for real: the adapter
builds the faulty scene, is made to remember the true one, and reads back. What only an engine's
own functions can change (restitution, margins, ...) is planted by tests/sims; here it is looked
up whether the engine tells it. What no state holds (forces, motions in time) laws of the kit find.
Columns of simulators that are not named, or not here, stay as they are.
"""

from __future__ import annotations

import csv
import sys
from fnmatch import fnmatchcase

from common import ROOT, arguments, present

from pytest_simbench.parity.compare import ParityResult
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.testing import CHECKS, Subject
from pytest_simbench.testing.faults import FAULTS, Fault, rounds
from pytest_simbench.testing.kit import read_expected_failures, reason_for
from pytest_simbench.testing.parity import planted

TABLE = ROOT / "docs" / "data" / "planted_faults.csv"
EXPECTED = read_expected_failures(ROOT / "tests" / "sims" / "expected_failures.txt")

IN_THE_ENGINE = {
    "what touches bounces": "body/*/restitution",
    "what touches the ground bounces": "ground/restitution",
    "a body rests at a distance": "body/*/margin",
    "a link rests at a distance": "link/*/margin",
    "a body's motion is damped": "body/*/damping",
    "a link's motion is damped": "link/*/damping",
    "a body has no gravity": "body/*/gravity",
    "a link has no gravity": "link/*/gravity",
    "a body does not collide": "body/*/touches",
    "a link does not collide": "link/*/touches",
    "a body is kinematic or held": "body/*/dynamic",
    "a body's centre of mass is off": "body/*/com",
    "a joint has friction": "joint/*/friction",
    "the ground is 10 mm higher": "ground/height",
    "the step is another one": "timestep",
    "the fingers are not coupled": "gripper/coupled",
    "a loop is closed 10 mm aside": "closure/0/points",
}

IN_TIME: dict[str, tuple[str, Capability | None]] = {
    "a force from outside is twice as large": ("force_acts_for_its_time", None),
    "a torque from outside is in the body's axes": ("torque_acts_for_its_time", None),
    "a prescribed body falls": ("moves_as_prescribed", None),
    "a belt moves, its surface does not": ("belt_carries", None),
    "contact forces have the wrong sign": ("weight_is_told", Capability.CONTACT_FORCES),
    "contact forces lack friction": ("friction_is_told", Capability.CONTACT_FORCES),
    "a loop is open": ("loops_stay_closed", Capability.LOOPS),
    "links that are to collide do not": ("links_collide_when_asked", Capability.SELF_COLLIDE),
    "links that one joint joins collide": ("links_collide_when_asked", Capability.SELF_COLLIDE),
    "joint wrenches are in the link's axes": ("joint_loads_are_told", Capability.JOINT_WRENCHES),
    "a cube is welded to the closed hand": ("pulled_grip_slips", None),
    "what the hand let go falls with half its weight": ("thrown_cube_flies_free", None),
    "a released cube snaps to its place": ("released_cube_is_let_be", None),
}
"""The law that finds a fault of what happens in time, and the capability that it needs."""

MEASURED = {
    "gravity": "free_fall",
    "timestep": "free_fall",
    "gripper/coupled": "fingers_stay_coupled",
    "ground/friction": "slides_above_mu",
    "*/restitution": "bounces_as_restitution_says",
    "*/margin": "links_are_felt",
    "body/*/damping": "damps_as_the_scene_says",
    "link/*/damping": "limp_arm_falls",
    "body/*/velocity": "thrown_as_the_scene_says",
    "body/*/gravity": "every_body_falls",
    "link/*/gravity": "limp_arm_falls",
    "body/*/touches": "tower_stands",
    "link/*/touches": "links_are_felt",
    "body/*/dynamic": "every_body_falls",
    "joint/*/friction": "limp_arm_falls",
    "joint/*finger*/effort_limit": "squeeze_bounds_the_grip",
    "joint/*/effort_limit": "every_effort_limit_counts",
    "closure/*": "loops_stay_closed",
}
"""The law of the kit that measures a quantity which an engine does not tell, first match."""

HAS_NONE = (" has no ", " have no ", "neither ")
"""In a deviation's reason: the engine lacks the thing, so it cannot be wrong there."""

BY_ANOTHER = {
    ("pybullet", "joint/*/friction"): "`limp_arm_falls`",  # told as loaded, whatever came later
    ("pybullet", "body/*/damping"): "`cube_spins_on`",
}
"""What an engine changes by itself, found by another law than what the scene changes."""

WHAT, UNCLAIMED = "planted fault", "not claimed"
"""The first column; and of an adapter that does not claim a capability, so nobody asks it."""


def by_law(subject: Subject, law: str) -> str:
    """A law that finds a fault, or that the engine breaks anyway."""
    broken = reason_for(f"{subject.name}-{subject.profile}-{CHECKS[law].name}", EXPECTED)
    return f"breaks `{law}`" if broken else f"`{law}`"


def silent(subject: Subject, quantity: str) -> str:
    """What stands for a quantity that an adapter declares not to be told."""
    reason = next(d.reason for d in subject.cls.info.deviations if d.excuses(quantity))
    if any(words in reason for words in HAS_NONE):
        return "has none"
    name = next(name for pattern, name in MEASURED.items() if fnmatchcase(quantity, pattern))
    return by_law(subject, name)


def built(subject: Subject, fault: Fault, found: ParityResult) -> str:
    """What finds a fault that the scene can have."""
    if fault.quantity in found.wrong:
        return "parity"
    if fault.quantity not in found.untold:
        lacks = {d.only for d in subject.cls.info.deviations if d.only}
        return "has none" if fault.word in lacks else "**missed**"
    if fault.needs is Capability.SELF_COLLIDE:
        return by_law(subject, "links_collide_when_asked")
    return silent(subject, fault.quantity)


def looked_up(subject: Subject, quantity: str) -> str:
    """What finds a fault that only the engine's own functions can make."""
    if quantity.startswith("closure/") and not subject.can(Capability.LOOPS):
        return UNCLAIMED
    if (subject.name, quantity) in BY_ANOTHER:
        return BY_ANOTHER[subject.name, quantity]
    example = quantity.replace("*", "x")
    deviations = subject.cls.info.deviations
    untold = any(d.within is None and d.excuses(example) for d in deviations)
    return silent(subject, example) if untold else "parity"


def column(subject: Subject) -> dict[str, str]:
    """What finds each fault in one engine, by the fault in plain words."""
    print(subject.name, file=sys.stderr, flush=True)
    column = {fault.what: UNCLAIMED for fault in FAULTS.values()}
    for faults in rounds(subject.cls.info.capabilities):
        found = planted(subject, faults.values())
        column |= {fault.what: built(subject, fault, found) for fault in faults.values()}
    column |= {what: looked_up(subject, quantity) for what, quantity in IN_THE_ENGINE.items()}
    for what, (law, needs) in IN_TIME.items():
        can = needs is None or subject.can(needs)
        column[what] = by_law(subject, law) if can else UNCLAIMED
    return column


def main() -> None:
    names = arguments(__doc__, {"simulators": []}).simulators or present()
    measured = {name: column(Subject(adapter(name))) for name in names}
    rows: dict[str, dict[str, str]] = {}
    if TABLE.exists():
        with TABLE.open(newline="", encoding="utf-8") as file:
            rows = {row[WHAT]: row for row in csv.DictReader(file)}
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        columns = [WHAT, *sorted({*names}.union(*rows.values()) - {WHAT})]
        writer = csv.DictWriter(file, columns, "not measured", lineterminator="\n")
        writer.writeheader()
        for what in [*(fault.what for fault in FAULTS.values()), *IN_THE_ENGINE, *IN_TIME]:
            now = {name: found[what] for name, found in measured.items()}
            writer.writerow({**rows.get(what, {}), WHAT: what, **now})


if __name__ == "__main__":
    main()
